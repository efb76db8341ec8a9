"""Pixels of three.js in Chromium against Blender's preview."""

import numpy as np
import pytest

from tests.export.states import WIDTH as _WIDTH
from tests.export.states import changed, close_enough
from tools.engines import cornell


@pytest.fixture(scope="module")
def wanted(hemibake, engine, tmp_path_factory):
    """Bake the Cornell box and return its preview."""
    cornell.bake()
    return cornell.preview(_WIDTH, tmp_path_factory.mktemp("preview"))


def shown(engine, folder, ending=".glb", kind="HDR", files=False):
    import bpy

    path = folder / f"Cornell box ü{ending}"
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=kind) == {"FINISHED"}
    return engine.render(path, _WIDTH, _WIDTH, cornell.HIDDEN, files)


@pytest.mark.parametrize(
    ("ending", "kind", "files"),
    [(".glb", "HDR", False), (".gltf", "HDR", False), (".glb", "PNG", False), (".glb", "HDR", True)],
)
def test_three_shows_the_preview(wanted, engine, tmp_path, ending, kind, files):
    """At silhouettes single pixels show the other side; 8 bits are coarse where it is dark."""
    picture = shown(engine, tmp_path, ending, kind, files)
    off = cornell.differences(picture, wanted)
    assert picture.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(off, 99) < (0.02 if kind == "HDR" else 0.5)


@pytest.mark.parametrize("output", ["directional", "spherical_harmonics"])
def test_three_shades_a_normal_map_with_directional_maps(hemibake, engine, tmp_path, output):
    """As the preview does; the .glb alone has no directional maps and another picture."""
    cornell.bake(directional=output)
    wanted = cornell.preview(_WIDTH, tmp_path)
    path = cornell.export(tmp_path, "HDR")
    (tmp_path / "alone").mkdir()
    alone = tmp_path / "alone" / path.name
    alone.write_bytes(path.read_bytes())
    pictures = [engine.render(file, _WIDTH, _WIDTH, cornell.HIDDEN) for file in (path, alone)]
    shaded, flat = (cornell.differences(picture, wanted) for picture in pictures)
    assert pictures[0].mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(shaded, 99) < 0.02
    assert np.median(flat) > 0.03


@pytest.mark.parametrize("files", [False, True])
@pytest.mark.parametrize("state", [*cornell.STATES])
def test_three_shows_light_states(stateful, engine, state, files):
    folder, wanted = stateful
    seconds = 0.2 if state == "Night" else 0.0
    shown = engine.show(folder / "room.glb", _WIDTH, _WIDTH, cornell.HIDDEN, files, state, seconds)
    assert shown.problems == []
    close_enough(shown.pixels, wanted[state])


def test_three_sets_single_groups(stateful, engine):
    folder, wanted = stateful
    groups = tuple((name, *mix) for name, mix in cornell.STATES["Night"].items())
    shown = engine.show(folder / "room.glb", _WIDTH, _WIDTH, cornell.HIDDEN, groups=groups)
    close_enough(shown.pixels, wanted["Night"])


def test_three_mixes_directional_maps(hemibake, engine, tmp_path):
    import bpy

    cornell.bake(96, "preview", directional="directional", states=True)
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(_WIDTH, tmp_path)
    path = cornell.export(tmp_path, "HDR")
    close_enough(engine.show(path, _WIDTH, _WIDTH, cornell.HIDDEN, True, "Night").pixels, wanted)


@pytest.mark.parametrize("kind", ["hdr", "ktx2", "rgbm", "rgbd", "logluv"])
def test_three_reads_files_of_bakes(hemibake, engine, tmp_path, kind):
    """A .glb without lightmaps in the folder of a bake, with encoded maps of light groups."""
    import bpy

    cornell.bake(64, "preview", states=True, file_format=kind, folder=tmp_path / "maps")
    bpy.ops.hemibake.light_state_apply(name="Night")
    wanted = cornell.preview(_WIDTH, tmp_path)
    path = tmp_path / "maps" / "box.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="NONE", use_files=False)
    shown = engine.show(path, _WIDTH, _WIDTH, cornell.HIDDEN, state="Night")
    assert shown.problems == []
    assert np.median(cornell.differences(shown.pixels, wanted)) < 0.01
    assert np.percentile(cornell.differences(shown.pixels, wanted), 98) < 0.03


@pytest.mark.parametrize(("width", "levels", "channel"), [(9, 8, 1), (9, 1, 0), (_WIDTH, 8, 0)])
def test_three_uses_the_mip_levels_of_ktx2(hemibake, engine, tmp_path, width, levels, channel):
    """Of a file whose first level is red and all others are green: small pictures are green."""
    import bpy

    from engine.encoding.ktx2 import ktx2_texture

    cornell.bake(128, "draft", file_format="ktx2", folder=tmp_path)
    path = tmp_path / "box.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="NONE", use_files=False)
    red, green = np.eye(3, dtype=np.float32)[:2]
    sizes = [128 >> level for level in range(levels)]
    maps = [np.tile(red if size == 128 else green, (size, size, 1)) for size in sizes]
    (tmp_path / "Lightmap.ktx2").write_bytes(ktx2_texture(maps))
    shown = engine.show(path, width, width, (*cornell.HIDDEN, "Light"))
    assert shown.problems == []
    light = shown.pixels.sum(axis=(0, 1))
    assert light[channel] > (9 if channel else 2) * light[1 - channel] and light[2] < 1e-3 * light[channel]


def test_three_names_what_is_missing_and_shows_the_rest(stateful, engine, tmp_path):
    """A group that a state names, a file, and the version of a manifest; the lightmaps inside are shown."""
    folder, wanted = stateful

    def edit(manifest):
        manifest["version"] = 9

    path = changed(tmp_path, folder / "room.glb", edit)
    shown = engine.show(path, _WIDTH, _WIDTH, cornell.HIDDEN, True, "Night")
    assert any("hemibake.json: version 9 is unknown" in problem for problem in shown.problems)
    close_enough(shown.pixels, wanted["Night"])

    path = changed(tmp_path, folder / "room.glb", lambda manifest: None)
    (tmp_path / "room.Lightmap light group Blue.exr").unlink()
    shown = engine.show(path, _WIDTH, _WIDTH, cornell.HIDDEN, True, groups=(("Lamp", (1, 1, 1), 1.0),))
    assert ["room.Lightmap light group Blue.exr" in problem for problem in shown.problems].count(True) == 1
    assert any("no light group 'Blue'" in problem for problem in shown.problems)
    assert 0 < shown.pixels.mean() < wanted["Day"].mean()

    with pytest.raises(
        RuntimeError, match="Light state 'Noon': not in the file. Choose one of: 'Day', 'Night'"
    ):
        engine.show(folder / "room.glb", 8, 8, state="Noon")
