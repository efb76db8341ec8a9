"""Levels of detail with the lightmap of their first level, by UVs from its surface."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.errors import EngineError
from ...engine.object_message import object_message
from ..levels import levels_of
from ..lookup import find
from ..rollback import Rollback
from ..scene import SceneContext, visible_meshes
from ..scene.bake_records import bake_record, writable_record
from ..scene.objects.evaluation import Evaluation, evaluate
from ..scene.objects.visible import visible_objects
from ..scene.uv_transform import UvTransform
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.uv_layers import MOST_LAYERS, replace_layer
from ..scene.uvs.uv_projection import UvMesh, UvProjection, read_uv_mesh
from ..scene.uvs.uv_targets import evaluated_mesh

#: Name of the UV layer of levels; it differs from layers of the user's own.
LEVEL_UVS = "Lightmap of Level 0"

#: Largest distance of a level from the surface of the first level, texels (chosen: a chart's margin).
FAR = 4.0

_OTHERWISE = "or set its role to No Lightmap"
_LINKED = (
    f"{{}}: this level of detail has a mesh that is linked from another file. Make it local, {_OTHERWISE}."
)
_EDITED = "{}: this level of detail is in Edit Mode. Leave Edit Mode and bake again."
_MODIFIED = f"{{}}: modifiers change the faces of this level of detail. Apply them, {_OTHERWISE}."
_FULL = (
    "{}: this level of detail has a mesh with 8 UV layers, as many as Blender allows. Remove one, "
    f"{_OTHERWISE}."
)
_SHARED = (
    "{}: levels of detail of different objects share one mesh. Use Object > Relations > Make Single User > "
    f"Object & Data, {_OTHERWISE}."
)
_HIDDEN = (
    "{}: renders of this scene show this level of detail but not the first level, so neither is baked. Show "
    "the first level in renders, or set the role of this object to No Lightmap."
)
_NAMED = f"{{}}: an attribute called '{LEVEL_UVS}' is not a UV layer. Rename it."
TOO_FAR = (
    f"{{}}: this level of detail has faces more than {FAR:g} texels away from the first level, so its light "
    f"may be wrong. Move it to the first level, {_OTHERWISE}."
)


@dataclass(frozen=True)
class Level:
    """A level of detail, read for the transfer of UVs.

    obj:       the level
    first:     its first level
    mesh:      its mesh, in world space; a level that stands beside its first level is moved to it
    surface:   projection to the first level, in world space
    distance:  largest distance of its vertices from the first level, UV units of the first level
    """

    obj: bpy.types.Object
    first: bpy.types.Object
    mesh: UvMesh
    surface: UvProjection
    distance: float


def store_levels(
    context: SceneContext, baked: Mapping[int, UvTransform], width: int
) -> tuple[dict[int, int], list[str]]:
    """Write UVs on the lightmap of their first level to all levels of baked objects.

    Returns the session uid of the first level by that of each level with such UVs, and notes. If Blender
    cannot evaluate the scene, a note has the reason, so that the bake can still be stored.

    baked:  place in the atlas of objects with new lightmaps, by session uid
    width:  width of the lightmaps, texels
    """
    try:
        levels, issues = _read_levels(context, baked.keys())
        hidden = _without_first(context)
    except EngineError as error:
        return {}, [str(error)]
    for level in levels:
        replace_layer(level.obj, LEVEL_UVS, level.surface.corner_uvs(level.mesh), Rollback())
        if level.distance * baked[level.first.session_uid].scale * width > FAR:
            issues.setdefault(TOO_FAR, []).append(level.obj.name)
    if hidden:
        issues[_HIDDEN] = hidden
    stored = {level.obj.session_uid: level.first.session_uid for level in levels}
    return stored, [object_message(sentence, sorted(names)) for sentence, names in issues.items()]


def mark_levels(scene: bpy.types.Scene, stored: dict[int, int]) -> None:
    """Copy the bake record of the first level to levels, with their UV layer; call it after `mark_objects`.

    stored:  session uid of the first level, by the session uid of each level
    """
    for uid, first in stored.items():
        record = writable_record(find(bpy.data.objects, uid), scene)
        source = bake_record(find(bpy.data.objects, first), scene)
        record.image, record.uv_layer = source.image, LEVEL_UVS
        record.uv_scale, record.uv_offset = source.uv_scale, source.uv_offset
        record.baked_uvs, record.fingerprint, record.on_vertices = "", "", False


def far_levels(context: SceneContext, width: int) -> list[str]:
    """Return the names of levels that are far from their first level, before a bake.

    width:  width of the lightmaps, texels; charts are taken as they are in the UV layer
    """
    levels, _ = _read_levels(context)
    return [level.obj.name for level in levels if level.distance * width > FAR]


def _without_first(context: SceneContext) -> list[str]:
    """Return the names of levels that renders show while neither they nor instances show the first level."""
    visible = set(visible_objects(context))
    hidden = [
        (first, level)
        for first, levels in levels_of(context.scene).items()
        for level in levels
        if first not in visible and level in visible
    ]
    instanced = set(visible_meshes(context)) if hidden else set()
    return [level.name for first, level in hidden if first not in instanced]


def _read_levels(
    context: SceneContext, baked: Collection[int] | None = None
) -> tuple[list[Level], dict[str, list[str]]]:
    """Return the levels of detail that can get UVs, and for each problem the names of levels that have it.

    baked:  session uids of the first levels (level 0) to use; None for all with lightmap UVs
    """
    scene = context.scene
    pairs = [
        (first, level)
        for first, levels in levels_of(scene).items()
        if baked is None or first.session_uid in baked
        for level in levels
    ]
    if not pairs:
        return [], {}
    objects = list(dict.fromkeys(obj for pair in pairs for obj in pair))

    def read(evaluation: Evaluation) -> dict[int, UvMesh]:
        return {obj.session_uid: mesh for obj in objects if (mesh := _read(obj, scene, evaluation))}

    meshes, users = evaluate(context, read, objects), dict[bpy.types.Mesh, set[bpy.types.Mesh]]()
    for first, level in pairs:
        users.setdefault(level.data, set()).add(first.data)
    surfaces: dict[int, tuple[UvProjection, float]] = {}
    levels, issues = [], dict[str, list[str]]()
    for first, level in pairs:
        mesh = meshes.get(level.session_uid)
        issue = _SHARED if len(users[level.data]) > 1 else _issue(level, mesh)
        own = meshes.get(first.session_uid)
        if issue:
            issues.setdefault(issue, []).append(level.name)
        elif mesh is not None and own is not None and own.uvs is not None:
            if first.session_uid not in surfaces:
                placed = _moved(own, _matrix(first))
                surfaces[first.session_uid] = UvProjection(placed), _uv_density(placed)
            levels.append(_placed(level, first, mesh, *surfaces[first.session_uid]))
    return levels, issues


def _placed(
    obj: bpy.types.Object, first: bpy.types.Object, mesh: UvMesh, surface: UvProjection, density: float
) -> Level:
    """Return a level at its own place or at its first level's, whichever is nearer to the surface.

    density:  UV units per metre
    """
    meshes = [_moved(mesh, _matrix(owner)) for owner in (obj, first)]
    distances = [surface.distances(moved.positions) for moved in meshes]
    nearest = int(np.argmin([part.mean() for part in distances]))
    return Level(obj, first, meshes[nearest], surface, float(distances[nearest].max()) * density)


def _uv_density(mesh: UvMesh) -> float:
    """Return the UV density of a mesh, sqrt(chart area / surface area), UV units per metre.

    It is 0 if a surface has no area.
    """
    uvs = np.zeros((len(mesh.triangles), 3, 3))
    if mesh.uvs is not None:
        uvs[..., :2] = mesh.uvs[mesh.triangles]
    flat, surface = (
        np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1).sum()
        for points in (uvs, mesh.points)
    )
    return float(np.sqrt(flat / surface)) if surface > 0 else 0.0


def _issue(level: bpy.types.Object, mesh: UvMesh | None) -> str:
    """Return the sentence on why a level gets no UVs; empty if it can."""
    data = level.data
    if not len(data.polygons):
        return ""
    if not level.is_editable or not data.is_editable:
        return _LINKED
    if data.is_editmode:
        return _EDITED
    if LEVEL_UVS not in data.uv_layers:
        if LEVEL_UVS in data.attributes:
            return _NAMED
        if len(data.uv_layers) >= MOST_LAYERS:
            return _FULL
    return _MODIFIED if mesh is None or not mesh.has_faces_of(read_uv_mesh(data, "")) else ""


def _read(obj: bpy.types.Object, scene: bpy.types.Scene, evaluation: Evaluation) -> UvMesh | None:
    """Return the evaluated mesh of an object with its lightmap UVs; None without faces.

    Objects that neither viewport nor renders show are not evaluated; without modifiers, their mesh is used.
    """
    with evaluated_mesh(obj, evaluation) as mesh:
        shown = obj.data if mesh is None and not obj.modifiers and not obj.data.is_editmode else mesh
        if shown is None or not len(shown.polygons):
            return None
        return read_uv_mesh(shown, lightmap_layer(obj, scene.hemibake.uv_layer))


def _matrix(obj: bpy.types.Object) -> np.ndarray:
    return np.array(obj.matrix_world, np.float64)


def _moved(mesh: UvMesh, matrix: np.ndarray) -> UvMesh:
    """Return a mesh transformed by a (4, 4) matrix."""
    positions = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return UvMesh(positions, mesh.corners, mesh.starts, mesh.triangles, mesh.polygon, mesh.uvs)
