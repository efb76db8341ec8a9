"""Direct and indirect light, ambient occlusion and shadow masks as images of their own."""

import numpy as np
import pytest

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
