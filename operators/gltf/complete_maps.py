"""Complete maps: albedo x light + emission over lightmap UVs, evaluated by Cycles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from ..compat import remove_scene
from ..result.directional_images import companion_images
from ..result.lightmap_nodes import ShownLightmap
from ..result.pictures import read_pixels
from ..result.preview_material import preview_material, remove_unused_previews
from ..scene.materials.shader_bake import (
    EvaluatedMesh,
    add_lightmap_uv_map,
    assign_materials,
    bake_emission,
    copy_shape,
    place_shape,
    remove_shapes,
    use_cycles,
)
from ..scene.objects.items import SceneItem, scene_items
from ..scene.objects.meshes import LIGHTMAP_UVS
from ..scene.objects.visible import visible_objects
from ..working_space import to_rec709
from .export_items import ExportItem, ExportItems

#: Texels of margin around charts, as a fraction of the width, and at least.
_MARGIN, _SMALLEST = 1 / 128, 2


def complete_maps(
    context: bpy.types.Context, surfaces: ExportItems, images: Sequence[bpy.types.Image], width: int
) -> dict[bpy.types.Image, np.ndarray]:
    """Return the complete map of each lightmap, (h, w, 3) float32, scene-linear Rec.709, bottom row first.

    The surfaces wear their preview materials, so textures, mixing, and normal maps with directional maps are
    evaluated as in the preview. Raises RuntimeError if Cycles cannot bake.

    width:  texels; 0 for the width of each lightmap
    """
    shapes = _copies(context, surfaces)
    try:
        return {
            image: _baked(context.scene, image, shapes[image], width) for image in images if image in shapes
        }
    finally:
        for group in shapes.values():
            remove_shapes(group)


def _copies(context: bpy.types.Context, surfaces: ExportItems) -> dict[bpy.types.Image, list[EvaluatedMesh]]:
    """Return copies of the evaluated meshes with final lightmap UVs, by lightmap."""
    depsgraph = context.evaluated_depsgraph_get()
    visible = {obj.session_uid for obj in visible_objects(context)}
    items = (item for item in scene_items(depsgraph, visible) if item.source.type == "MESH")
    found: dict[bpy.types.Image, list[EvaluatedMesh]] = {}
    for item, surface in zip(items, surfaces.all, strict=True):
        shape = None if surface.place is None else _copy(item, surface, depsgraph)
        if shape is not None:
            found.setdefault(surface.lightmap.image, []).append(shape)
    return found


def _copy(item: SceneItem, surface: ExportItem, depsgraph: bpy.types.Depsgraph) -> EvaluatedMesh | None:
    """Return a copy of a mesh with final lightmap UVs; None if it lacks the UV layer."""
    slots = [slot.material and slot.material.original for slot in item.object.material_slots] or [None]
    place = surface.lightmap
    shape = copy_shape(item.object, place.layer, surface.matrix, depsgraph, slots)
    if add_lightmap_uv_map(shape.mesh, place.layer, place.apply):
        return shape
    remove_shapes([shape])
    return None


def _baked(
    scene: bpy.types.Scene, lightmap: bpy.types.Image, shapes: Sequence[EvaluatedMesh], width: int
) -> np.ndarray:
    """Bake the preview of meshes into a complete map."""
    size = (width, width) if width else tuple(lightmap.size)
    target = bpy.data.images.new("hemibake", *size, alpha=True, float_buffer=True, is_data=True)
    try:
        target.generated_color = (0.0, 0.0, 0.0, 0.0)
        shown = ShownLightmap((lightmap,), companion_images(scene, [lightmap]), LIGHTMAP_UVS)
        with _stage(shapes, shown, target) as (stage, objects):
            bake_emission(stage, objects, max(_SMALLEST, round(size[0] * _MARGIN)))
        return to_rec709(read_pixels(target)).copy()
    finally:
        bpy.data.images.remove(target)


@contextmanager
def _stage(
    shapes: Sequence[EvaluatedMesh], shown: ShownLightmap, target: bpy.types.Image
) -> Iterator[tuple[bpy.types.Scene, list[bpy.types.Object]]]:
    """Set up a scene with meshes that show a lightmap, and remove it at the end.

    target:  image that their materials bake into
    """
    stage = bpy.data.scenes.new("hemibake")
    objects: list[bpy.types.Object] = []
    materials: dict[bpy.types.Material | None, bpy.types.Material] = {}
    try:
        for material in dict.fromkeys(slot for shape in shapes for slot in shape.slots):
            materials[material] = preview_material(material, shown)
            node = materials[material].node_tree.nodes.new("ShaderNodeTexImage")
            node.image = target
            materials[material].node_tree.nodes.active = node
        for shape in shapes:
            objects.append(place_shape(stage, shape))
            assign_materials(shape, [materials[slot] for slot in shape.slots])
        use_cycles(stage)
        yield stage, objects
    finally:
        for obj in objects:
            bpy.data.objects.remove(obj)
        remove_scene(stage)
        for shape in shapes:
            shape.mesh.materials.clear()
        remove_unused_previews()
