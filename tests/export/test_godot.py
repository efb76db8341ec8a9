"""Pixels of Godot 4.6 against Blender's preview."""

import numpy as np
import pytest

from tools.engines import cornell, godot, room
from tools.headless import ROOT

_WIDTH = 200

#: Nodes that are not shown. Godot's Compatibility renderer shows emission above 1 with another brightness.
_HIDDEN = (*cornell.HIDDEN, "Light")


@pytest.fixture(scope="module")
def engine():
    if missing := godot.missing():
        pytest.skip(f"{missing}: exports are not shown with Godot")
    return godot


def export(folder, **options):
    """Export the scene, and return the path of the scene for Godot."""
    import bpy

    path = folder / "level #1 %20 ü's (a).glb"
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), engine="GODOT", **options) == {"FINISHED"}
    return path.with_suffix(".tscn")


def assert_same(shown, wanted, percentile=99):
    """Fail unless most pixels outside the lamp are equal up to 2 %."""
    off = cornell.differences(shown, np.where(wanted.max(axis=-1, keepdims=True) < 1, wanted, 0))
    assert len(off) > 0.8 * wanted.shape[0] * wanted.shape[1]
    assert np.percentile(off, percentile) < 0.02


def test_sizes_instances_and_names(hemibake, engine, tmp_path):
    """Two lightmaps of different sizes, two objects of one mesh, instances of a collection, odd names."""
    room.bake()
    wanted = cornell.preview(_WIDTH, tmp_path)
    assert_same(engine.render(export(tmp_path), _WIDTH, _WIDTH, _HIDDEN), wanted)


def test_normal_maps_with_spherical_harmonics(hemibake, engine, tmp_path):
    """As the preview; without them the picture is another one, and the export names the objects."""
    import bpy

    cornell.bake(64, "draft", "spherical_harmonics")
    wanted = cornell.preview(_WIDTH, tmp_path)
    assert_same(engine.render(export(tmp_path), _WIDTH, _WIDTH, _HIDDEN), wanted)
    bpy.context.scene.hemibake.lightmaps["Lightmap"].directional = "NONE"
    (tmp_path / "flat").mkdir()
    flat = engine.render(export(tmp_path / "flat"), _WIDTH, _WIDTH, _HIDDEN)
    assert np.median(cornell.differences(flat, wanted)) > 0.03


def test_bicubic_filter_keeps_charts_apart(hemibake, engine, tmp_path):
    """Godot's own filter blurs light over two texels, but does not take light of other charts."""
    cornell.bake(64, "draft")
    wanted = cornell.preview(_WIDTH, tmp_path)
    shown = engine.render(export(tmp_path), _WIDTH, _WIDTH, _HIDDEN, bicubic=True)
    off = cornell.differences(shown, np.where(wanted.max(axis=-1, keepdims=True) < 1, wanted, 0))
    assert np.median(off) < 0.01 and np.percentile(off, 90) < 0.05


_ADDON = ROOT / "clients" / "godot" / "addons" / "hemibake"


@pytest.mark.parametrize(("lightmaps", "ending"), [("HDR", ".glb"), ("HDR", ".gltf"), ("NONE", ".glb")])
def test_addon_shows_files_of_other_engines(hemibake, engine, tmp_path, lightmaps, ending):
    """With lightmaps in the file, or OpenEXR files and the manifest beside it; also sizes and instances."""
    import bpy

    room.bake()
    wanted = cornell.preview(_WIDTH, tmp_path)
    folder = tmp_path / "files"
    folder.mkdir()
    path, beside = folder / f"room{ending}", lightmaps == "NONE"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=lightmaps, use_files=beside)
    assert_same(engine.render(path, _WIDTH, _WIDTH, _HIDDEN, addon=_ADDON), wanted)
    with pytest.raises(AssertionError):
        assert_same(engine.render(path, _WIDTH, _WIDTH, _HIDDEN), wanted)
