import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine import Light, PatchFileError, SceneError, Settings, SettingsError, bake
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace, quads, rectangle, room_walls

ROOT = Path(__file__).resolve().parents[2]
QUICK = Settings(resolution=32, hemicube=8, max_bounces=3, tolerance=0, visibility="raster", accelerate=False)


def test_dilation_touches_no_texel_that_has_a_patch():
    """The light is the same, bit for bit, with and without dilation."""
    plain = drive(furnace(0.5, 1.0), replace(QUICK, margin=0))
    dilated = drive(furnace(0.5, 1.0), replace(QUICK, margin=32))
    has_patch = plain.has_patch
    assert (plain.image.view(np.uint32) == dilated.image.view(np.uint32)).all()
    assert (dilated.display[has_patch].view(np.uint32) == plain.image[has_patch].view(np.uint32)).all()
    assert (plain.display[~has_patch] == 0).all() and (dilated.display > 0).all()


def test_light_at_centres_is_returned_where_it_is_asked_for():
    lightmap, shown = (drive(furnace(0.5, 1.0), replace(QUICK, centres=centres)) for centres in (True, False))
    assert lightmap.image.shape == (1, 32, 32, 3) and shown.image.shape == (0, 32, 32, 3)
    assert (lightmap.display.view(np.uint32) == shown.display.view(np.uint32)).all()


def test_a_patch_list_from_a_file_gives_the_same_bits(tmp_path):
    settings = replace(QUICK, patch_file=str(tmp_path / "furnace.patches"))
    made, loaded = (drive(furnace(0.5, 1.0), settings) for _ in range(2))
    assert (tmp_path / "furnace.patches").stat().st_size > 384 * 32
    assert (made.image.view(np.uint32) == loaded.image.view(np.uint32)).all()
    with pytest.raises(PatchFileError, match="Delete it"):
        drive(furnace(0.5, 1.0), replace(settings, resolution=64))


def test_progress_reports_stages_energy_and_intermediate_lightmaps():
    steps = list(bake(furnace(0.5, 1.0), QUICK))
    assert [step.stage for step in steps][:2] == ["Preparing texels", "Preparing texels"]
    intermediate = [step for step in steps if step.intermediate is not None]
    assert [step.iteration for step in intermediate] == [1, 2, 3]
    assert all(step.intermediate.shape == (1, 32, 32, 3) for step in intermediate)
    energies = [step.energy for step in intermediate]
    assert energies[1] == pytest.approx(energies[0] / 2, rel=1e-3)
    fractions = [step.fraction for step in steps if step.stage.startswith(("Visibility", "Bounce"))]
    assert all(0 <= fraction <= 1 for fraction in fractions) and len(fractions) >= 3


@pytest.mark.parametrize("first", ["combined", "direct", "indirect", "shadow_mask"])
def test_the_room_appears_in_direct_light_first(first):
    """Unless an output without it is shown. Later, texels beside the lamp show more than their centres."""
    settings = replace(QUICK, texel_samples=1, outputs=(first, "direct") if first != "direct" else (first,))
    lamp = Light("Lamp", "point", (0.3, 0.6, 0.7), np.eye(3), strength=np.array([3.0, 2, 1], np.float32))
    lit = replace(furnace(0.5, 0.0), lights=(lamp,))
    steps, lightmap = [], None
    work = bake(lit, settings)
    while lightmap is None:
        try:
            steps.append(next(work))
        except StopIteration as end:
            lightmap = end.value
    first_shown = next(step for step in steps if step.intermediate is not None)
    if first == "indirect":
        assert first_shown.iteration == 1
    else:
        assert first_shown.iteration == 0 and first_shown.stage == "Direct light"
        shown = first_shown.intermediate[lightmap.has_patch]
        np.testing.assert_array_equal(shown, lightmap.passes["direct"][lightmap.has_patch])


def test_closing_the_generator_cancels_and_the_next_bake_works():
    for _ in range(3):
        steps = bake(furnace(0.5, 1.0), QUICK)
        for _ in range(4):
            next(steps)
        steps.close()
    assert drive(furnace(0.5, 1.0), QUICK).report.iterations == 3


def test_report_tells_the_facts():
    report = drive(furnace(0.5, 1.0), QUICK).report
    assert report.patches == 384 and len(report.added_flux) == 3 and not report.converged
    assert set(report.devices) == {"gl", "cl"} and all(report.devices.values())
    assert {"devices", "patches", "hemicubes"} <= set(report.seconds)


def test_an_object_without_a_covered_texel_is_named():
    furnace_mesh = furnace(0.5, 1.0).meshes[0]
    flat = replace(furnace_mesh, name="Crumb", uvs=furnace_mesh.uvs * np.float32(1e-3) + np.float32(0.97))
    lightmap = drive(replace(furnace(0.5, 1.0), meshes=(furnace_mesh, flat)), QUICK)
    assert any("'Crumb'" in warning and "Unwrap" in warning for warning in lightmap.report.warnings)


def test_lightmaps_that_fit_no_device_are_refused():
    names = tuple(f"Atlas {index}" for index in range(5000))
    with pytest.raises(SettingsError, match="5000 lightmaps.*same atlas name"):
        next(bake(replace(furnace(0.5, 1.0), atlases=names), QUICK))
    huge = replace(furnace(0.5, 1.0), atlases=names[:1000])
    with pytest.raises(SettingsError, match="GiB.*Lower the resolution"):
        next(bake(huge, replace(QUICK, resolution=16384)))


def test_world_light_reaches_an_open_plane():
    plane = quads(rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0))[None], [(2, 2, 16, 16)], [0], 32, "Plane")
    scene = replace(furnace(0.5, 0.0), meshes=(plane,), world=np.float32([0.2, 0.4, 0.6]))
    lightmap = drive(scene, QUICK)
    assert lightmap.image[lightmap.has_patch] == pytest.approx(np.tile([0.2, 0.4, 0.6], (256, 1)), rel=1e-5)


def test_texels_inside_a_closed_object_are_filled_for_display_only():
    """A box without a floor stands on a plane: the texels below it see the insides of its walls."""
    plane = quads(rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0))[None], [(2, 2, 16, 16)], [0], 32, "Floor")
    walls = room_walls(1, 1, 1)[1:, ::-1] - [0.5, 0.5, 0]
    box = quads(walls, [(20 + 6 * (i % 2), 2 + 6 * (i // 2), 4, 4) for i in range(5)], [0] * 5, 32, "Box")
    scene = replace(furnace(0.5, 0.0), meshes=(plane, box), world=np.ones(3, np.float32))
    lightmap = drive(scene, QUICK)
    hidden = lightmap.has_patch[0] & (lightmap.image[0].max(axis=-1) < 1e-3)
    assert hidden[8:12, 8:12].all() and hidden.sum() == 16
    assert (lightmap.display[0][hidden] > 0.1).all()


def test_bad_settings_and_scenes_raise_before_any_device_is_opened():
    with pytest.raises(SettingsError, match="resolution is 100000; choose 8 to 16384"):
        next(bake(furnace(0.5, 1.0), replace(QUICK, resolution=100000)))
    with pytest.raises(SceneError, match="no mesh"):
        next(bake(replace(furnace(0.5, 1.0), meshes=()), QUICK))


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        ("__EGL_VENDOR_LIBRARY_FILENAMES", "No OpenGL 4.1 driver.*apt install libegl1"),
    ],
)
def test_a_missing_driver_is_a_clear_error(variable, message, tmp_path):
    code = (
        "from engine import bake, Settings, DeviceError\n"
        "from tests.analytic.scenes import furnace\n"
        "try: next(bake(furnace(0.5, 1.0), Settings(outputs=('ambient_occlusion',))))\n"
        "except DeviceError as error: print(error)\n"
    )
    environment = {**os.environ, variable: str(tmp_path / "missing")}
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60
    )
    assert result.returncode == 0, result.stderr
    assert re.search(message, result.stdout)


@pytest.mark.long
def test_what_a_bake_keeps_between_sessions_lies_in_the_folder_of_the_settings(tmp_path):
    """PyOpenCL opens no database: it would outlive the add-on, and bakes would fail once it is cleared."""
    code = (
        "import sys\n"
        "from engine import Settings, bake, finished\n"
        "from tests.analytic.scenes import furnace\n"
        "finished(bake(furnace(0.5, 1.0), Settings(resolution=8, hemicube=8, cache_dir=sys.argv[1])))\n"
    )
    home, kept = tmp_path / "home", tmp_path / "kept"
    home.mkdir()
    kept.mkdir()
    environment = {key: value for key, value in os.environ.items() if not key.startswith("XDG")}
    environment |= {"HOME": str(home), "POCL_CACHE_DIR": str(tmp_path / "pocl")}
    command = [sys.executable, "-c", code, str(kept)]
    subprocess.run(command, cwd=ROOT, env=environment, check=True, timeout=120)
    assert not list(home.rglob("*pyopencl*")) and not list(tmp_path.rglob("*.sqlite"))
