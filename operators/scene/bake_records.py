"""Bake records: lightmap, UVs and fingerprint of an object's last bake in each scene.

Scenes may share objects. The object's own properties are the record of one scene, and `other_bakes` has one
record for each further scene. A record refers to its scene by the scene's `bake_id`, a string. A pointer
would append the whole scene along with the object to other files.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import TypeAlias

import bpy

#: The properties of a record.
FIELDS = (
    "image", "uv_layer", "uv_scale", "uv_offset", "baked_uvs", "fingerprint", "light_change", "instances",
    "on_vertices",
)  # fmt: skip


@dataclass(frozen=True)
class NoRecord:
    """Empty record of an object that was never baked in a scene."""

    image: None = None
    uv_layer: str = ""
    uv_scale: float = 1.0
    uv_offset: tuple[float, float] = (0.0, 0.0)
    baked_uvs: str = ""
    fingerprint: str = ""
    light_change: float = 0.0
    instances: str = ""
    on_vertices: bool = False


Record: TypeAlias = bpy.types.PropertyGroup | NoRecord


def bake_record(obj: bpy.types.Object, scene: bpy.types.Scene) -> Record:
    """Return the read-only record of the last bake of an object in a scene.

    If the file lacks a record's scene, the record applies to each scene that has none for the object. Such
    records are those of appended objects, and of files from versions without records by scene.
    """
    own, scene_id = obj.hemibake, scene.hemibake.bake_id
    if own.scene_id and own.scene_id == scene_id:
        return own
    other = _other(obj, scene_id)
    if other is not None:
        return other
    return NoRecord() if own.scene_id and own.scene_id in _scene_ids() else own


def writable_record(obj: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.PropertyGroup:
    """Return the record that a bake of an object in a scene writes; call `claim_bake_id` first.

    Records of scenes that the file no longer has are removed.
    """
    own, scene_id, present = obj.hemibake, scene.hemibake.bake_id, _scene_ids()
    for index in reversed(range(len(own.other_bakes))):
        if own.other_bakes[index].scene_id not in present:
            own.other_bakes.remove(index)
    other = _other(obj, scene_id)
    if other is not None:
        return other
    if own.scene_id not in present - {scene_id}:
        own.scene_id = scene_id
        return own
    record = own.other_bakes.add()
    record.scene_id = scene_id
    return record


def claim_bake_id(scene: bpy.types.Scene) -> None:
    """Give a scene a `bake_id` that no other scene has; its objects keep their records in it.

    A copied scene has the same ID as the original at first, and so shows the same lightmaps.
    """
    before = scene.hemibake.bake_id
    same = [other for other in bpy.data.scenes if other != scene and other.hemibake.bake_id == before]
    if before and not same:
        return
    scene_id = uuid.uuid4().hex
    if before:
        for obj in scene.objects:
            if obj.is_editable:
                is_shared = any(obj.name in other.objects for other in same)
                _rename_record(obj, before, scene_id, is_shared)
    scene.hemibake.bake_id = scene_id


def forget_bakes(obj: bpy.types.Object) -> None:
    """Remove an object's bake records of all scenes."""
    for name in ("scene_id", "other_bakes", *FIELDS):
        obj.hemibake.property_unset(name)


def _rename_record(obj: bpy.types.Object, before: str, scene_id: str, is_shared: bool) -> None:
    """Assign an object's record to a scene with a new ID; copy it if another scene shares the object."""
    own = obj.hemibake
    record = own if own.scene_id == before else _other(obj, before)
    if record is None:
        return
    if not is_shared:
        record.scene_id = scene_id
        return
    values = {name: getattr(record, name) for name in FIELDS}
    copy = own.other_bakes.add()
    copy.scene_id = scene_id
    for name, value in values.items():
        setattr(copy, name, value)


def _other(obj: bpy.types.Object, scene_id: str) -> bpy.types.PropertyGroup | None:
    """Return the record of a further scene; None without one."""
    others = obj.hemibake.other_bakes
    return next((record for record in others if record.scene_id == scene_id), None) if scene_id else None


def _scene_ids() -> set[str]:
    """Return the IDs of all baked scenes of the file."""
    return {scene.hemibake.bake_id for scene in bpy.data.scenes} - {""}
