"""Cycles' bake of a user's own object: shows that the copies of the reference equal the render's scene."""

from __future__ import annotations

import bpy
import numpy as np

from tools.verification.cycles import remove_bias

#: Width of the image, texels.
_WIDTH = 64


def original_mean(context: bpy.types.Context, name: str, samples: int) -> np.ndarray:
    """Return the mean E/pi of an object with lightmap UVs, (3,) float64; changes the open file.

    All faces of the object must have the same number of texels for each area.
    """
    obj, layer = context.scene.objects[name], context.scene.hemibake.uv_layer
    remove_bias(context.scene, samples, 3)
    image = bpy.data.images.new("Original", _WIDTH, _WIDTH, alpha=True, float_buffer=True)
    image.pixels.foreach_set(np.zeros(_WIDTH * _WIDTH * 4, np.float32))
    for slot in obj.material_slots:
        tree = slot.material.node_tree
        tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
        tree.nodes.active.image = image
    selected = {
        "active_object": obj, "object": obj, "selected_objects": [obj], "selected_editable_objects": [obj],
    }  # fmt: skip
    with context.temp_override(**selected):
        bpy.ops.object.bake(
            type="DIFFUSE", pass_filter={"DIRECT", "INDIRECT"}, margin=0, use_clear=False, uv_layer=layer
        )
    pixels = np.empty(_WIDTH * _WIDTH * 4, np.float32)
    image.pixels.foreach_get(pixels)
    texels = pixels.reshape(-1, 4)
    return texels[texels[:, 3] > 0, :3].mean(axis=0, dtype=np.float64)
