"""Pixels of Bevy with the crate bevy_hemibake against Blender's preview."""

import shutil

import numpy as np
import pytest

from tests.export.states import WIDTH, changed, close_enough
from tools.engines import bevy, cornell, room


@pytest.fixture(scope="module")
def engine():
    if missing := bevy.missing():
        pytest.skip(f"{missing}: exports are not shown with Bevy")
    bevy.install()
    return bevy


@pytest.mark.parametrize(
    "check", ["fmt --check", "test", "clippy --all-targets -- -D warnings", "doc --no-deps"]
)
def test_the_crate_passes_the_checks_of_cargo(engine, check):
    """Its unit tests read the golden manifests; those of its documentation compile."""
    bevy.cargo(bevy.CRATE, *check.split())


@pytest.fixture(scope="module")
def stateful(hemibake, tmp_path_factory):
    """Return a folder with an export of the box with light states for Bevy, and the preview of each state."""
    folder = tmp_path_factory.mktemp("states")
    return folder, cornell.export_states(folder, WIDTH, "BEVY")


@pytest.mark.parametrize("output", [None, "directional", "spherical_harmonics"])
def test_bevy_shows_the_preview(hemibake, engine, tmp_path, output):
    """With a normal map by directional maps, too; without these the picture is another one."""
    cornell.bake(directional=output)
    wanted = cornell.preview(WIDTH, tmp_path)
    path = cornell.export(tmp_path, engine="BEVY")
    shown = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN)
    assert shown.problems == []
    close_enough(shown.pixels, wanted)
    if output is not None:
        flat = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN, shades_normal_maps=False).pixels
        assert np.median(cornell.differences(flat, wanted)) > 0.03


@pytest.mark.parametrize("state", ["", *cornell.STATES])
def test_light_states(stateful, engine, state):
    """With a fade to Night; without a state the light is that of all groups."""
    folder, wanted = stateful
    seconds = 0.2 if state == "Night" else 0.0
    shown = engine.show(folder / "room.glb", WIDTH, WIDTH, cornell.HIDDEN, state, seconds)
    assert shown.problems == []
    close_enough(shown.pixels, wanted[state or "Day"])


def test_a_group_has_a_color_and_a_strength(stateful, engine):
    """From the state without a lamp, whose light is a linear part of the light by day."""
    folder, wanted = stateful
    color, strength = (1.0, 0.5, 0.25), 0.5
    lamp = wanted["Day"] - wanted["Dark"]
    group = ["Lamp", color, strength]
    shown = engine.show(folder / "room.glb", WIDTH, WIDTH, cornell.HIDDEN, "Dark", group=group)
    close_enough(shown.pixels, wanted["Dark"] + strength * np.array(color, np.float32) * lamp)


def test_devices_without_filtered_floats(stateful, engine):
    """OpenEXR has 32-bit floats, which phones and WebGL 2 neither filter nor blend."""
    folder, wanted = stateful
    shown = engine.show(folder / "room.glb", WIDTH, WIDTH, cornell.HIDDEN, "Night", is_limited=True)
    assert shown.problems == []
    close_enough(shown.pixels, wanted["Night"])


def test_the_exposure_of_the_camera(stateful, engine):
    folder, wanted = stateful
    shown = engine.show(folder / "room.glb", WIDTH, WIDTH, cornell.HIDDEN, ev100=4.0)
    close_enough(shown.pixels, wanted["Day"])


def test_the_bicubic_filter_smooths_the_light(stateful, engine):
    folder, wanted = stateful
    shown = engine.show(folder / "room.glb", WIDTH, WIDTH, cornell.HIDDEN, bicubic=True)
    off = cornell.differences(shown.pixels, wanted["Day"])
    assert 0.0005 < np.median(off) < 0.01 and np.percentile(off, 90) < 0.05


def test_instances_and_lightmaps_of_two_sizes(hemibake, engine, tmp_path):
    """Two lightmaps of different sizes, two objects of one mesh, instances of a collection, odd names."""
    import bpy

    room.bake()
    wanted = cornell.preview(WIDTH, tmp_path)
    path = tmp_path / "level" / "room #1 %20 ü's (a).glb"
    path.parent.mkdir()
    bpy.ops.hemibake.export_for_engine(filepath=str(path), engine="BEVY")
    shown = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN)
    assert shown.problems == []
    close_enough(shown.pixels, wanted)


@pytest.mark.parametrize("kind", ["hdr", "ktx2", "rgbm", "rgbd", "logluv"])
def test_files_of_bakes(hemibake, engine, tmp_path, kind):
    """KTX2 within the error of its format; 8 bits show steps."""
    import bpy

    cornell.bake(64, "preview", states=True, file_format=kind, folder=tmp_path)
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(WIDTH, tmp_path)
    path = tmp_path / "room.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="NONE", use_files=False)
    shown = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN, "Night")
    assert shown.problems == []
    if kind in ("hdr", "ktx2"):
        close_enough(shown.pixels, wanted)
    assert (cornell.differences(shown.pixels, wanted) > 0.03).mean() < 0.02


def test_lightmaps_in_the_file(hemibake, engine, tmp_path):
    """8-bit PNG, which Bevy takes as sRGB; the files beside it are preferred if asked for."""
    import bpy

    cornell.bake(64, "preview", states=True)
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(WIDTH, tmp_path)
    path = tmp_path / "room.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="PNG", use_files=True)
    files = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN, "Night", prefers_files=True)
    close_enough(files.pixels, wanted)
    (tmp_path / "alone").mkdir()
    alone = tmp_path / "alone" / "room.glb"
    shutil.copy2(path, alone)
    shown = engine.show(alone, WIDTH, WIDTH, cornell.HIDDEN, "Night")
    assert files.problems == shown.problems == []
    assert shown.pixels.mean() == pytest.approx(wanted.mean(), rel=0.02)
    assert np.median(cornell.differences(shown.pixels, wanted)) < 0.03


def test_radiance_hdr_in_the_file(hemibake, engine, tmp_path):
    """As exported for three.js; Bevy alone refuses the file."""
    import bpy

    cornell.bake(64, "preview", states=True)
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(WIDTH, tmp_path)
    path = tmp_path / "room.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), engine="THREE")
    shown = engine.show(path, WIDTH, WIDTH, cornell.HIDDEN, "Night", hdr_inside=True)
    assert shown.problems == []
    close_enough(shown.pixels, wanted)


def test_what_is_missing_is_named_and_all_else_is_shown(stateful, engine, tmp_path):
    folder, wanted = stateful
    path = folder / "room.glb"

    def shown(name, change=lambda manifest: None):
        made = tmp_path / name
        made.mkdir()
        return changed(made, path, change)

    def state(manifest):
        manifest["states"]["Night"]["Fire"] = [1, 1, 1]

    def extra(path):
        """Let the manifest name the states: take those out of the glTF file."""
        data = path.read_bytes()
        path.write_bytes(data.replace(b'"states"', b'"_tates"'))
        return path

    (problem,) = engine.show(extra(shown("fire", state)), 8, 8).problems
    assert problem.startswith("State 'Night': no light group 'Fire'.")

    newer = engine.show(shown("newer", lambda manifest: manifest.update(version=9)), 8, 8).problems
    assert newer[0].startswith("hemibake.json: version 9 is unknown.")

    probes = [{"name": "Hall", "matrix": np.eye(4).tolist(), "ktx2": "lost.ktx2"}]
    (problem,) = engine.show(shown("probes", lambda manifest: manifest.update(probes=probes)), 8, 8).problems
    assert problem.startswith("Probe volume 'Hall': 'lost.ktx2' is not readable")

    absent = shown("absent")
    next(absent.parent.glob("*Blue*.exr")).unlink()
    answer = engine.show(absent, WIDTH, WIDTH, cornell.HIDDEN, "Day")
    assert "Blue" in answer.problems[0] and "not readable" in answer.problems[0]
    assert answer.pixels.mean() > 0.3 * wanted["Day"].mean()
    with pytest.raises(
        RuntimeError, match="Light state 'Noon': not in the file. Choose one of: 'Day', 'Night'"
    ):
        engine.show(path, 8, 8, state="Noon")
