"""Direct and indirect light, ambient occlusion and shadow masks as images of their own."""

import numpy as np
import pytest

from tests.analytic.tilts import directions, fitted
from tests.blender.things import furnace, pixels, report


def bake(*outputs):
    import bpy

    bpy.context.scene.hemibake.outputs = set(outputs)
    bpy.context.scene.hemibake.tolerance = 0.0005
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def mean_of_patches(name):
    import bpy

    values = pixels(bpy.data.images[name])[..., :3]
    return float(np.median(values))


def test_direct_and_indirect_light_are_images_of_their_own():
    furnace()
    bake("combined", "direct", "indirect")
    assert report()["images"] == ["Lightmap", "Lightmap direct", "Lightmap indirect"]
    assert mean_of_patches("Lightmap") == pytest.approx(2, rel=0.01)
    assert mean_of_patches("Lightmap direct") == pytest.approx(1, rel=0.01)
    assert mean_of_patches("Lightmap indirect") == pytest.approx(1, rel=0.02)


def test_directional_maps_are_images_with_a_formula_in_the_manifest(tmp_path):
    """In a furnace all light is even: L0 and L1 along the normal make it up."""
    import json

    import bpy

    furnace()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "furnace.blend"))
    bake("combined", "directional", "dominant_direction")
    names = [
        "Lightmap",
        *(f"Lightmap {name}" for name in ("L0", "L1 x", "L1 y", "L1 z", "dominant direction")),
    ]
    assert report()["images"] == names
    assert bpy.context.scene.hemibake.lightmaps["Lightmap"].directional == "DIRECTIONAL"
    lit = pixels(bpy.data.images["Lightmap"])[..., 0] > 0
    l0, *l1 = (pixels(bpy.data.images[name])[..., :3] for name in names[1:5])
    length = np.sqrt(sum(axis**2 for axis in l1))
    even = 4 * fitted(directions(5000), 3000).mean(axis=0)[2]
    assert np.median(length[lit]) == pytest.approx(even, rel=0.02)
    assert np.median((l0 + length)[lit]) == pytest.approx(2, rel=0.01)
    entries = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())["lightmaps"]
    decoded = {entry["output"]: entry.get("decode", "") for entry in entries.values()}
    assert decoded["combined"] == "" and decoded["L1 y"].startswith("max(0, L0 + L1x n'.x")
    bake("combined")
    assert bpy.context.scene.hemibake.lightmaps["Lightmap"].directional == "NONE"


def test_directional_maps_alone_are_refused():
    import bpy

    furnace()
    bpy.context.scene.hemibake.outputs = {"directional"}
    with pytest.raises(RuntimeError, match="Add combined"):
        bpy.ops.hemibake.bake()


def test_direct_light_alone_takes_one_iteration():
    furnace()
    bake("direct")
    assert report()["images"] == ["Lightmap"] and report()["iterations"] == 1
    assert mean_of_patches("Lightmap") == pytest.approx(1, rel=0.01)


def test_shadow_masks_need_a_light():
    furnace()
    import bpy

    bpy.context.scene.hemibake.outputs = {"shadow_mask"}
    with pytest.raises(RuntimeError, match="Shadow masks need a light"):
        bpy.ops.hemibake.bake()


def test_no_output_is_refused():
    furnace()
    import bpy

    bpy.context.scene.hemibake.outputs = set()
    with pytest.raises(RuntimeError, match="outputs is empty"):
        bpy.ops.hemibake.bake()
