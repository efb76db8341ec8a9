"""Preview of lightmaps on objects: shows and removes preview materials.

Preview materials use slots linked to the object. The original slots are stored on the object
(`HemibakeObjectProperties.slots`), so they survive saving and are restored exactly.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ..original_slots import PREVIEW_MARK, is_filled, own_slots
from ..scene.bake_records import bake_record
from ..scene.objects.meshes import read_array
from ..scene.uvs.lightmap_layer import lightmap_layer
from .color_nodes import ShownColors
from .directional_images import companion_images
from .instance_uv_table import InstanceUvTransform, instance_places, place_table
from .light_mixer import group_images, light_mixer
from .lightmap_nodes import ShownLightmap
from .preview_material import ShownLight, preview_material, remove_unused_previews
from .probe_nodes import ShownProbes, shown_probes
from .vertex_light import COLORS, shows_vertices

#: Indices of all material slots of an object.
ALL_SLOTS = range(1 << 15)


def has_preview(obj: bpy.types.Object) -> bool:
    """Return True if an object shows its lightmap."""
    return len(obj.hemibake.slots) > 0


def previewed(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Yield the objects of a scene that show their lightmaps, and objects that only instances show."""
    yield from filter(has_preview, scene.objects)
    in_scenes = {obj for other in bpy.data.scenes for obj in other.objects}
    yield from (obj for obj in bpy.data.objects if has_preview(obj) and obj not in in_scenes)


def is_previewed(scene: bpy.types.Scene) -> bool:
    """Return True if an object of a scene has a preview, even if other materials are assigned now."""
    return any(True for _ in previewed(scene))


def shows_preview(scene: bpy.types.Scene) -> bool:
    """Return True if an object of a scene shows its lightmap; fast without a preview, for panels."""
    return any(PREVIEW_MARK in material for material in bpy.data.materials) and is_previewed(scene)


def show_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[int, list[str]]:
    """Show the lightmaps of the baked objects and instances of a scene, and dynamic objects lit by probes.

    Returns the number of objects and messages for the user.
    """
    instances = instance_places(scene, depsgraph)
    meshes = [obj for obj in scene.objects if obj.type == "MESH"]
    dynamic = [obj for obj in meshes if _is_dynamic(obj)]
    baked = [obj for obj in meshes if not _is_dynamic(obj) and bake_record(obj, scene).image]
    probes = shown_probes(scene) if dynamic else None
    made: dict[tuple[bpy.types.Material | None, ShownLight], bpy.types.Material] = {}
    shown, notes = 0, []
    for obj in dict.fromkeys([*baked, *instances, *(dynamic if probes else ())]):
        if not obj.is_editable:
            notes.append(f"Object '{obj.name}' is linked from another file, so it cannot show a preview.")
        elif not obj.material_slots and not obj.data.is_editable:
            notes.append(
                f"Object '{obj.name}' has no material slot and a linked mesh, so it cannot show a preview."
            )
        else:
            shown += 1
            _remember(obj)
            light = _shown_light(obj, instances.get(obj), scene, probes)
            for slot in obj.material_slots:
                _show_slot(slot, light, made)
    layer = depsgraph.view_layer
    if shown and layer.material_override is not None:
        notes.append(
            f"View layer '{layer.name}': its Material Override hides the lightmaps. Remove it to see them."
        )
    return shown, notes


def hide_preview(objects: Sequence[bpy.types.Object]) -> None:
    """Restore the materials of objects and remove unused preview materials."""
    for obj in objects:
        _give_back(obj)
    for obj in objects:
        if obj.hemibake.slot_added and len(obj.data.materials) == 1:
            _remove_slot(obj.data)
        obj.hemibake.slot_added = False
        obj.hemibake.slots.clear()
    remove_unused_previews()


def renew_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Update the preview of a scene to its current objects, maps, UV transforms and materials.

    Slots that were added for the preview stay, since the mesh may be in Edit Mode.
    """
    shown = list(previewed(scene))
    for obj in shown:
        _give_back(obj)
        obj.hemibake.slots.clear()
    remove_unused_previews()
    if shown:
        show_preview(scene, depsgraph)
    hide_preview([obj for obj in shown if not has_preview(obj)])


def shows_other_scene(scene: bpy.types.Scene) -> bool:
    """Return True if an object with a lightmap in a scene shows the lightmap of another scene.

    Two windows with two scenes that share objects lead to this: Blender has one material for both.
    """
    own = _lightmaps_of([scene])
    others = _lightmaps_of([other for other in bpy.data.scenes if other != scene]) - own
    if not others:
        return False
    baked = (obj for obj in previewed(scene) if bake_record(obj, scene).image)
    return any(images & others and not images & own for images in map(_images_shown, baked))


def _lightmaps_of(scenes: Sequence[bpy.types.Scene]) -> set[bpy.types.Image]:
    """Return the images of the lightmaps of scenes, including their further outputs."""
    return {entry.image for scene in scenes for entry in scene.hemibake.lightmaps if entry.image}


def _images_shown(obj: bpy.types.Object) -> set[bpy.types.Image]:
    """Return the images of the preview materials of an object."""
    shown = (slot.material for slot in obj.material_slots if slot.material)
    nodes = (node for material in shown if PREVIEW_MARK in material for node in material.node_tree.nodes)
    return {node.image for node in nodes if node.type == "TEX_IMAGE" and node.image}


def switch_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> bool:
    """Show this scene's lightmaps on objects that show another scene's; return True if any changed.

    Objects without a lightmap in this scene show their own materials until another scene is shown.
    """
    shown = list(previewed(scene))
    for obj in shown:
        _give_back(obj)
    remove_unused_previews()
    if shown:
        show_preview(scene, depsgraph)
    return bool(shown)


def set_preview_aside(scene: bpy.types.Scene) -> None:
    """Restore the materials of a scene's objects until `refresh_preview`, as needed before an undo.

    An undo frees preview materials that no undo step holds, even if an object uses them.
    """
    for obj in previewed(scene):
        _give_back(obj)
    remove_unused_previews()


def refresh_preview(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, changed: Container[int]) -> None:
    """Update the preview to the current state of materials.

    changed:  session uids of materials; new or refilled slots are always updated
    """
    stale = {obj: slots for obj in previewed(scene) if (slots := _stale_slots(obj, changed))}
    instances = instance_places(scene, depsgraph) if stale else {}
    probes = shown_probes(scene) if any(map(_is_dynamic, stale)) else None
    made: dict[tuple[bpy.types.Material | None, ShownLight], bpy.types.Material] = {}
    for obj, slots in stale.items():
        _give_back(obj, slots)
        _remember(obj, slots)
        light = _shown_light(obj, instances.get(obj), scene, probes)
        for index in slots:
            _show_slot(obj.material_slots[index], light, made)
    if stale:
        remove_unused_previews()


def _stale_slots(obj: bpy.types.Object, changed: Container[int]) -> list[int]:
    """Return the indices of slots whose preview is missing or out of date."""
    stale = []
    for index, (slot, own) in enumerate(zip(obj.material_slots, own_slots(obj), strict=True)):
        material = own.material if own.link == "OBJECT" else obj.data.materials[index]
        is_shown = slot.material is not None and PREVIEW_MARK in slot.material
        if not is_shown or (material is not None and material.session_uid in changed):
            stale.append(index)
    return stale


def _give_back(obj: bpy.types.Object, slots: Container[int] = ALL_SLOTS) -> None:
    """Restore the original materials of slots that hold preview materials or nothing."""
    for index, (slot, own) in enumerate(zip(obj.material_slots, own_slots(obj), strict=True)):
        if index in slots and not is_filled(slot):
            link, slot.link = own.link, "OBJECT"
            slot.material, slot.link = own.material, link


def _remove_slot(mesh: bpy.types.Mesh) -> None:
    """Remove the only slot of a mesh; keep the faces' material indices, which Blender would reset."""
    before = read_array(mesh.polygons, "material_index", 1, np.int32)[:, 0]
    stored = "material_index" in mesh.attributes or before.any()
    mesh.materials.clear()
    if stored:
        mesh.polygons.foreach_set("material_index", before)


def _remember(obj: bpy.types.Object, slots: Container[int] = ALL_SLOTS) -> None:
    """Store the materials of an object's slots before a preview; add a slot if there is none."""
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


def _is_dynamic(obj: bpy.types.Object) -> bool:
    """Return True if light probes light an object."""
    return obj.hemibake.role == "DYNAMIC"


def _show_slot(slot: bpy.types.MaterialSlot, light: ShownLight, made: dict) -> None:
    key = (slot.material, light)
    if key not in made:
        made[key] = preview_material(slot.material, light)
    slot.link = "OBJECT"
    slot.material = made[key]


def _shown_light(
    obj: bpy.types.Object,
    instances: list[InstanceUvTransform] | None,
    scene: bpy.types.Scene,
    probes: ShownProbes | None,
) -> ShownLight:
    """Return the probes for a dynamic object, else the light of its vertices or its lightmap."""
    if probes and _is_dynamic(obj):
        return probes
    if instances is None and shows_vertices(obj, bake_record(obj, scene)):
        return ShownColors(COLORS)
    return _shown_lightmap(obj, instances, scene)


def _shown_lightmap(
    obj: bpy.types.Object, instances: list[InstanceUvTransform] | None, scene: bpy.types.Scene
) -> ShownLightmap:
    """Return the lightmap of an object or of its instances; the UV layer may be the default one."""
    own = bake_record(obj, scene)
    if instances is None:
        place = own.uv_layer, own.uv_scale, tuple(own.uv_offset)
        return _with_groups(ShownLightmap((own.image,), companion_images(scene, [own.image]), *place), scene)
    images = tuple(dict.fromkeys(place.image for place in instances))
    table = place_table(instances, images)
    rows, width, _ = table.texels.shape
    image = bpy.data.images.new(
        f"{obj.name} (places)", width, rows, alpha=True, float_buffer=True, is_data=True
    )
    image[PREVIEW_MARK], image.alpha_mode = True, "CHANNEL_PACKED"
    image.pixels.foreach_set(table.texels.reshape(-1))
    image.pack()
    layer = own.uv_layer or lightmap_layer(obj, scene.hemibake.uv_layer)
    shown = ShownLightmap(images, companion_images(scene, images), layer, table=image, buckets=table.buckets)
    return _with_groups(shown, scene)


def _with_groups(lightmap: ShownLightmap, scene: bpy.types.Scene) -> ShownLightmap:
    """Return the lightmap with its light groups and mixer, if it has their maps."""
    groups = group_images(scene, lightmap.images)
    if not groups:
        return lightmap
    mixer = light_mixer(scene, list(groups))
    return replace(lightmap, groups=tuple(groups.values()), mixer=mixer)
