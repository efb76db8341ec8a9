"""Objects that show their lightmaps, and their own materials again.

The preview materials sit in slots linked to the object; what was there is remembered on the object
(`HemibakeObjectProperties.slots`), so that it survives saving and comes back exactly.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..original_slots import is_filled, own_slots
from ..scene.bake_records import bake_record
from ..scene.objects.meshes import read_array
from ..scene.uvs.lightmap_layer import lightmap_layer
from .directional_images import images_beside
from .instance_uv_table import InstanceUvTransform, instance_places, place_table
from .light_mixer import group_images, light_mixer
from .lightmap_nodes import ShownLightmap
from .preview_material import MARK, preview_material, remove_unused_previews

#: The indices of all material slots of an object.
ALL_SLOTS = range(1 << 15)


def has_preview(obj: bpy.types.Object) -> bool:
    """Return whether an object shows its lightmap."""
    return len(obj.hemibake.slots) > 0


def previewed(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Yield the objects of a scene that show their lightmaps, and those that only its instances may show."""
    for obj in bpy.data.objects:
        if has_preview(obj) and (obj.name in scene.objects or not obj.users_scene):
            yield obj


def is_previewed(scene: bpy.types.Scene) -> bool:
    """Return whether an object of a scene is to show its lightmap, whatever materials it wears."""
    return any(True for _ in previewed(scene))


def shows_preview(scene: bpy.types.Scene) -> bool:
    """Return whether an object of a scene shows its lightmap; quick without a preview, for panels."""
    return any(MARK in material for material in bpy.data.materials) and is_previewed(scene)


def show_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[int, list[str]]:
    """Let the baked objects and instances of a scene show their lightmaps.

    Returns how many objects do, and sentences for the user.
    """
    instances = instance_places(scene, depsgraph)
    baked = [obj for obj in scene.objects if obj.type == "MESH" and bake_record(obj, scene).image]
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
        _give_back(obj)
    for obj in objects:
        if obj.hemibake.slot_added and len(obj.data.materials) == 1:
            _remove_slot(obj.data)
        obj.hemibake.slot_added = False
        obj.hemibake.slots.clear()
    remove_unused_previews()


def renew_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Let a scene that shows its lightmaps show those of now: new objects, maps and places, own materials.

    Slots that were added for the preview stay where they are: the mesh may be in Edit Mode.
    """
    shown = list(previewed(scene))
    for obj in shown:
        _give_back(obj)
        obj.hemibake.slots.clear()
    remove_unused_previews()
    if shown:
        show_preview(scene, depsgraph)
    hide_preview([obj for obj in shown if not has_preview(obj)])


def switch_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> bool:
    """Let objects that show the lightmaps of another scene show those of this one; return True if any did.

    Objects without a lightmap in this scene show their own materials until a scene with one is shown.
    """
    shown = list(previewed(scene))
    for obj in shown:
        _give_back(obj)
    remove_unused_previews()
    if shown:
        show_preview(scene, depsgraph)
    return bool(shown)


def set_preview_aside(scene: bpy.types.Scene) -> None:
    """Give the objects of a scene their own materials until `refresh_preview`, as before an undo.

    An undo frees preview materials that no step knows, even those that an object still refers to.
    """
    for obj in previewed(scene):
        _give_back(obj)
    remove_unused_previews()


def refresh_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, changed: Container[int]) -> None:
    """Let objects that show their lightmaps show their materials as these are now.

    changed: session uids of materials; slots that were filled or added since are refreshed anyhow
    """
    stale = {obj: slots for obj in previewed(scene) if (slots := _stale_slots(obj, changed))}
    instances = instance_places(scene, depsgraph) if stale else {}
    made: dict[tuple[bpy.types.Material | None, ShownLightmap], bpy.types.Material] = {}
    for obj, slots in stale.items():
        _give_back(obj, slots)
        _remember(obj, slots)
        lightmap = _shown_lightmap(obj, instances.get(obj), scene)
        for index in slots:
            _show_slot(obj.material_slots[index], lightmap, made)
    if stale:
        remove_unused_previews()


def _stale_slots(obj: bpy.types.Object, changed: Container[int]) -> list[int]:
    """Return the indices of slots that do not show their own material as it is now."""
    stale = []
    for index, (slot, own) in enumerate(zip(obj.material_slots, own_slots(obj), strict=True)):
        material = own.material if own.link == "OBJECT" else obj.data.materials[index]
        is_shown = slot.material is not None and MARK in slot.material
        if not is_shown or (material is not None and material.session_uid in changed):
            stale.append(index)
    return stale


def _give_back(obj: bpy.types.Object, slots: Container[int] = ALL_SLOTS) -> None:
    """Put an object's own materials back into slots where there are none of its own."""
    for index, (slot, own) in enumerate(zip(obj.material_slots, own_slots(obj), strict=True)):
        if index in slots and not is_filled(slot):
            link, slot.link = own.link, "OBJECT"
            slot.material, slot.link = own.material, link


def _remove_slot(mesh: bpy.types.Mesh) -> None:
    """Take the only slot away from a mesh; the faces keep the indices that Blender would drop."""
    before = read_array(mesh.polygons, "material_index", 1, np.int32)[:, 0]
    stored = "material_index" in mesh.attributes or before.any()
    mesh.materials.clear()
    if stored:
        mesh.polygons.foreach_set("material_index", before)


def _remember(obj: bpy.types.Object, slots: Container[int] = ALL_SLOTS) -> None:
    """Store what slots of an object hold; one without slots gets one."""
    if not obj.material_slots:
        obj.data.materials.append(None)
        obj.hemibake.slot_added = True
    kept = obj.hemibake.slots
    for index, slot in enumerate(obj.material_slots):
        before = kept[index] if index < len(kept) else kept.add()
        if index not in slots:
            continue
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
    obj: bpy.types.Object, instances: list[InstanceUvTransform] | None, scene: bpy.types.Scene
) -> ShownLightmap:
    """Return where the light of an object, or of all its instances, is; the layer where it was not baked."""
    own = bake_record(obj, scene)
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
