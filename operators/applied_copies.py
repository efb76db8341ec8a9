"""Copies of objects with their modifiers applied, in the place of the objects themselves."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .result.preview import hide_preview
from .scene.messages import Troubles
from .scene.uvs.lightmap_layer import lightmap_layer
from .scene.uvs.uv_modifier import remove_uv_modifiers, uv_modifiers
from .scene.uvs.uv_targets import is_usable_layer

#: Why an object stays as it is.
_NOTHING = "no modifiers, so there is nothing to apply."
_EDITED = "being edited: leave Edit Mode to apply its modifiers."
_NOT_SHOWN = "not in the view layer: include its collection there to apply its modifiers."
_INSTANCES = "making instances, which a copy would not have: realize them, as by a Realize Instances node."
_FOREIGN = "in a collection of another file: make that collection local, or override it, to apply modifiers."

#: Types of parents that deform their children.
_DEFORMING = {"ARMATURE", "LATTICE"}


def apply_on_copies(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object]
) -> tuple[list[bpy.types.Object], list[str]]:
    """Put a copy with the evaluated mesh in the place of each mesh object, which is hidden and ignored.

    Returns the copies, and sentences about the objects that stay as they are. A copy keeps lightmap UVs that
    are of use, and so the light. An object of another file is taken out of the scene's collections instead.
    """
    copies, troubles = [], Troubles()
    for obj in objects:
        trouble = _trouble(context, obj)
        if trouble:
            troubles.add(trouble, obj.name)
        else:
            copies.append(_replace(context, obj))
    return copies, troubles.tell()


def _trouble(context: bpy.types.Context, obj: bpy.types.Object) -> str | None:
    """Return why an object cannot be replaced by a copy."""
    depsgraph = context.evaluated_depsgraph_get()
    if obj.is_editable and len(obj.modifiers) == len(uv_modifiers(obj)):
        return _NOTHING
    if obj.mode != "OBJECT":
        return _EDITED
    if not obj.evaluated_get(depsgraph).is_evaluated:
        return _NOT_SHOWN
    instancers = {item.parent.original for item in depsgraph.object_instances if item.is_instance}
    if obj in instancers:
        return _INSTANCES
    if not obj.is_editable and not all(each.is_editable for each in _collections(context, obj)):
        return _FOREIGN
    return None


def _replace(context: bpy.types.Context, obj: bpy.types.Object) -> bpy.types.Object:
    """Put a copy in the place of an object and return it."""
    collections, selected = _collections(context, obj), obj.select_get()
    active = context.view_layer.objects.active == obj
    if obj.is_editable:
        hide_preview([obj])
    copy = _applied_copy(context, obj)
    for collection in collections:
        if collection.is_editable:
            collection.objects.link(copy)
        if not obj.is_editable:
            collection.objects.unlink(obj)
    if obj.is_editable:
        remove_uv_modifiers(obj)
        obj.hide_render = obj.hide_viewport = True
        obj.hemibake.role = "IGNORED"
    copy.select_set(selected)
    if active:
        context.view_layer.objects.active = copy
    return copy


def _applied_copy(context: bpy.types.Context, obj: bpy.types.Object) -> bpy.types.Object:
    """Return a copy of an object whose mesh is what its modifiers make."""
    depsgraph = context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(
        obj.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph
    )
    mesh.name = f"{obj.data.name} applied"
    layer = mesh.uv_layers.get(lightmap_layer(obj, context.scene.hemibake.uv_layer))
    if layer is not None and not is_usable_layer(mesh, layer.name):
        mesh.uv_layers.remove(layer)
    copy = obj.copy()
    copy.name = f"{obj.name} applied"
    copy.modifiers.clear()
    copy.data = mesh
    if copy.parent_type in _DEFORMING:
        copy.parent_type = "OBJECT"
    return copy


def _collections(context: bpy.types.Context, obj: bpy.types.Object) -> list[bpy.types.Collection]:
    """Return the collections of the scene that have an object."""
    scene = context.scene.collection
    return [each for each in (scene, *scene.children_recursive) if each in obj.users_collection]
