"""Replacement of objects by copies with applied modifiers."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .result.preview import hide_preview
from .scene.messages import Issues
from .scene.uvs.lightmap_layer import lightmap_layer
from .scene.uvs.uv_modifier import remove_uv_modifiers, uv_modifiers
from .scene.uvs.uv_targets import is_usable_layer

#: Reasons why an object is not replaced.
_NOTHING = "it has no modifiers. Nothing to do."
_EDITED = "it is being edited. Leave Edit Mode first."
_NOT_SHOWN = "it is not in the view layer. Include its collection there first."
_INSTANCES = "it makes instances, which a copy would lose. Add a Realize Instances node first."
_FOREIGN = "its collection is linked from another file. Make the collection local or override it."

#: Types of parents that deform their children.
_DEFORMING = {"ARMATURE", "LATTICE"}


def apply_on_copies(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object]
) -> tuple[list[bpy.types.Object], list[str]]:
    """Replace each mesh object by a copy with the evaluated mesh; hide the original and set it to Ignored.

    Returns the copies, and sentences about objects that were not replaced. A copy keeps usable lightmap UVs
    and therefore its light. An object linked from another file is removed from the scene's collections.
    """
    copies, issues = [], Issues()
    for obj in objects:
        issue = _issue(context, obj)
        if issue:
            issues.add(issue, obj.name)
        else:
            copies.append(_replace(context, obj))
    return copies, issues.messages()


def _issue(context: bpy.types.Context, obj: bpy.types.Object) -> str | None:
    """Return the reason why an object cannot be replaced, None if it can."""
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
    """Replace an object by a copy with applied modifiers and return the copy."""
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
    """Return a copy of an object with its evaluated mesh and without modifiers."""
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
    """Return the collections of the scene that contain an object."""
    scene = context.scene.collection
    return [each for each in (scene, *scene.children_recursive) if each in obj.users_collection]
