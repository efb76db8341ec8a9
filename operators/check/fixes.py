"""Fixes for findings: each one changes the objects of one finding, and can be undone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bmesh
import bpy

from ...engine.errors import SceneError
from ...engine.object_message import object_message
from ...engine.progress import finished
from ..applied_copies import apply_on_copies
from ..lightmap_size import choose_width
from ..object_properties import set_property
from ..result.preview import hide_preview
from ..rollback import Rollback
from ..scene import SceneContext, visible_meshes
from ..scene.objects.render_settings import show_as_rendered
from ..scene.uvs.known_charts import has_chosen_uvs
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.unwrap import UvAction, unwrap_missing
from ..scene.uvs.uv_modifier import remove_uv_modifiers
from ..scene.uvs.wall_cuts import objects_on_walls

Fix = Callable[[bpy.types.Context, Sequence[bpy.types.Object], int, Rollback], None]


def unwrap(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Make lightmap UVs for objects that have none."""
    settings = context.scene.hemibake
    where = SceneContext(context)
    resolution = finished(choose_width(where, visible_meshes(where), changes)).width
    made = finished(
        unwrap_missing(where, objects, settings.uv_layer, resolution, changes, movable=visible_meshes(where))
    )
    if made.skipped:
        raise SceneError("\n".join(made.issues))


def unwrap_again(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Make lightmap UVs in another layer, which the objects then use; the unusable layer is kept."""
    for obj in objects:
        set_property(obj, "own_uv_layer", _free_layer(obj, context.scene.hemibake.uv_layer), changes)
    unwrap(context, objects, value, changes)


def set_resolution(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Set the resolution that the charts of the lightmaps need."""
    settings = context.scene.hemibake
    settings.size_mode, settings.resolution = "SIZE", value


def recalculate_normals(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Make the face normals of closed meshes point outwards."""
    for mesh in dict.fromkeys(obj.data for obj in objects if obj.data.is_editable):
        edited = bmesh.from_edit_mesh(mesh) if mesh.is_editmode else bmesh.new()
        if not mesh.is_editmode:
            edited.from_mesh(mesh)
        bmesh.ops.recalc_face_normals(edited, faces=edited.faces)
        if mesh.is_editmode:
            bmesh.update_edit_mesh(mesh)
        else:
            edited.to_mesh(mesh)
            edited.free()
            mesh.update()


def apply_on_copy(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Replace each object by a copy with applied modifiers."""
    copies, notes = apply_on_copies(context, objects)
    if not copies:
        raise SceneError("\n".join(notes))


def use_settings_of_renders(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Give modifiers the same settings in the viewport as in renders, then make new lightmap UVs."""
    for obj in objects:
        show_as_rendered(obj, changes)
    unwrap(context, objects, value, changes)


def remove_modifiers(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Remove the modifiers that store lightmap UVs."""
    hide_preview(objects)
    for obj in objects:
        remove_uv_modifiers(obj)


def cut_along_walls(
    context: bpy.types.Context, objects: Sequence[bpy.types.Object], value: int, changes: Rollback
) -> None:
    """Make new lightmap UVs for the objects under thin walls, with chart boundaries along the walls."""
    settings, where = context.scene.hemibake, SceneContext(context)
    floors = objects_on_walls(
        visible_meshes(where), objects, where.evaluated_depsgraph_get(), settings.uv_layer
    )
    kept = [obj.name for obj in floors if has_chosen_uvs(obj)]
    if kept:
        sentence = (
            "{}: UV layer of your choice, which this fix does not change. Clear the object's UV Layer to let "
            "the fix make new lightmap UVs, cut along the walls."
        )
        raise SceneError(object_message(sentence, kept))
    if not floors:
        sentence = (
            "{}: the surface below has no edge along the wall. Cut an edge loop into that surface along the "
            "wall, or raise the density."
        )
        raise SceneError(object_message(sentence, [obj.name for obj in objects]))
    for obj in floors:
        set_property(obj, "cut_along_walls", True, changes)
    resolution = finished(choose_width(where, visible_meshes(where), changes)).width
    work = unwrap_missing(
        where, floors, settings.uv_layer, resolution, changes, UvAction.CHARTS, visible_meshes(where)
    )
    finished(work)


#: Label of the button and function of each fix, by its name.
FIXES: dict[str, tuple[str, Fix]] = {
    "unwrap": ("Unwrap", unwrap),
    "unwrap_again": ("Unwrap Again", unwrap_again),
    "resolution": ("Set Resolution", set_resolution),
    "normals": ("Recalculate", recalculate_normals),
    "apply_on_copy": ("Apply on a Copy", apply_on_copy),
    "show_as_rendered": ("Show as Rendered", use_settings_of_renders),
    "remove_uv_modifiers": ("Remove", remove_modifiers),
    "cut_along_walls": ("Cut Charts Along Walls", cut_along_walls),
}


def _free_layer(obj: bpy.types.Object, uv_layer: str) -> str:
    """Return a name that no UV layer or attribute of the object's mesh has."""
    base = lightmap_layer(obj, uv_layer)
    names = {base, *obj.data.uv_layers.keys(), *obj.data.attributes.keys()}
    numbered = (f"{base}.{number:03d}" for number in range(1, len(names) + 2))
    return next(name for name in ("Lightmap", *numbered) if name not in names)
