"""Objects that show their lightmaps, and their own materials again.

The preview materials sit in slots linked to the object; what was there is remembered on the object
(`HemibakeObjectProperties.slots`), so that it survives saving and comes back exactly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..scene.objects.meshes import read_array
from ..scene.uvs.lightmap_layer import lightmap_layer
from .directional_images import images_beside
from .instance_places import InstancePlace, instance_places, place_table
from .light_mixer import group_images, light_mixer
from .lightmap_nodes import ShownLightmap
from .preview_material import MARK, preview_material, remove_unused_previews


def has_preview(obj: bpy.types.Object) -> bool:
    """Return whether an object shows its lightmap."""
    return len(obj.hemibake.slots) > 0


def previewed(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Yield the objects of a scene that show their lightmaps, and those that only its instances may show."""
    for obj in bpy.data.objects:
        if has_preview(obj) and (obj.name in scene.objects or not obj.users_scene):
            yield obj


def shows_preview(scene: bpy.types.Scene) -> bool:
    """Return whether an object of a scene shows its lightmap; quick without a preview, for panels."""
    return any(MARK in material for material in bpy.data.materials) and any(True for _ in previewed(scene))


def show_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[int, list[str]]:
    """Let the baked objects and instances of a scene show their lightmaps.

    Returns how many objects do, and sentences for the user.
    """
    instances = instance_places(scene, depsgraph)
    baked = [obj for obj in scene.objects if obj.type == "MESH" and obj.hemibake.image is not None]
    made: dict[tuple[bpy.types.Material | None, ShownLightmap], bpy.types.Material] = {}
    shown, notes = 0, []
    for obj in dict.fromkeys([*baked, *instances]):
        if not obj.is_editable:
            notes.append(f"Object '{obj.name}' is linked from another file: it has no preview.")
        elif not obj.material_slots and not obj.data.is_editable:
            notes.append(f"Object '{obj.name}' has no material slot and a linked mesh: it has no preview.")
        else:
            shown += 1
            _remember(obj)
            lightmap = _shown_lightmap(obj, instances.get(obj), scene)
            for slot in obj.material_slots:
                _show_slot(slot, lightmap, made)
    return shown, notes


def hide_preview(objects: Sequence[bpy.types.Object]) -> None:
    """Give objects their own materials back and remove preview materials that nobody uses."""
    for obj in objects:
        for slot, before in zip(obj.material_slots, obj.hemibake.slots, strict=False):
            slot.link = "OBJECT"
            slot.material = before.material
            slot.link = before.link
    for obj in objects:
        if obj.hemibake.slot_added and len(obj.data.materials) == 1:
            _remove_slot(obj.data)
        obj.hemibake.slot_added = False
        obj.hemibake.slots.clear()
    remove_unused_previews()


def _remove_slot(mesh: bpy.types.Mesh) -> None:
    """Take the only slot away from a mesh; the faces keep the indices that Blender would drop."""
    before = read_array(mesh.polygons, "material_index", 1, np.int32)[:, 0]
    stored = "material_index" in mesh.attributes or before.any()
    mesh.materials.clear()
    if stored:
        mesh.polygons.foreach_set("material_index", before)


def _remember(obj: bpy.types.Object) -> None:
    """Store what the slots of an object hold; one without slots gets one."""
    if not obj.material_slots:
        obj.data.materials.append(None)
        obj.hemibake.slot_added = True
    for slot in obj.material_slots:
        before = obj.hemibake.slots.add()
        before.link = slot.link
        slot.link = "OBJECT"
        before.material = slot.material
        slot.link = before.link


def _show_slot(slot: bpy.types.MaterialSlot, lightmap: ShownLightmap, made: dict) -> None:
    key = (slot.material, lightmap)
    if key not in made:
        made[key] = preview_material(slot.material, lightmap)
    slot.link = "OBJECT"
    slot.material = made[key]


def _shown_lightmap(
    obj: bpy.types.Object, instances: list[InstancePlace] | None, scene: bpy.types.Scene
) -> ShownLightmap:
    """Return where the light of an object, or of all its instances, is; the layer where it was not baked."""
    own = obj.hemibake
    if instances is None:
        place = own.uv_layer, own.uv_scale, tuple(own.uv_offset)
        return _with_groups(ShownLightmap((own.image,), images_beside(scene, [own.image]), *place), scene)
    images = tuple(dict.fromkeys(place.image for place in instances))
    table = place_table(instances, images)
    rows, width, _ = table.texels.shape
    image = bpy.data.images.new(
        f"{obj.name} (places)", width, rows, alpha=True, float_buffer=True, is_data=True
    )
    image[MARK], image.alpha_mode = True, "CHANNEL_PACKED"
    image.pixels.foreach_set(table.texels.reshape(-1))
    image.pack()
    layer = own.uv_layer or lightmap_layer(obj, scene.hemibake.uv_layer)
    shown = ShownLightmap(images, images_beside(scene, images), layer, table=image, buckets=table.buckets)
    return _with_groups(shown, scene)


def _with_groups(lightmap: ShownLightmap, scene: bpy.types.Scene) -> ShownLightmap:
    """Return a lightmap mixed from its light groups, if it has maps of them."""
    groups = group_images(scene, lightmap.images)
    if not groups:
        return lightmap
    mixer = light_mixer(scene, list(groups))
    return replace(lightmap, groups=tuple(groups.values()), mixer=mixer)
