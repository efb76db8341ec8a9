"""Selects the objects that get lightmaps; all others with faces are occluders.

The scene is read as for a bake of all objects, so that each chart has the same place as in such a bake.
Objects that are not baked then become occluders.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.scene.model import NO_LIGHTMAP
from ..lookup import find
from .bake_records import Record, bake_record
from .fingerprints import own_part
from .objects.instancing import instance_pairs, visible_meshes
from .read import Entry, InstanceEntry, ReadScene
from .scene_context import SceneContext
from .uv_transform import UvTransform

NOTHING_SELECTED = "No selected object gets a lightmap. Select what is to be baked, or choose the target All."


class NothingChangedError(SceneError):
    """Raised if no object has changed since its last bake, so that there is nothing to do."""

    def __init__(self) -> None:
        super().__init__("Nothing has changed since it was baked. Choose the target All to bake anyway.")


def target_uids(context: SceneContext, target: str) -> set[int]:
    """Return the session uids of the mesh objects that may be baked: "SELECTED" ones, or all.

    "CHANGED" ones are known only after the scene was read, see `ChangedObjects`. An instance counts as its
    source object. Raises SceneError if none is selected.
    """
    meshes = {obj.session_uid for obj in visible_meshes(context)}
    if target != "SELECTED":
        return meshes
    layer = context.view_layer
    selected = {obj.session_uid for obj in layer.objects if obj.select_get(view_layer=layer)}
    shown = {source for instancer, source in instance_pairs(context) if instancer in selected}
    if not meshes & (selected | shown):
        raise SceneError(NOTHING_SELECTED)
    return meshes & (selected | shown)


def changed_uids(read: ReadScene, uids: set[int], scene: bpy.types.Scene) -> set[int]:
    """Return the session uids of objects that changed since their last bake, or were never baked.

    A change of any light source changes all objects.
    """
    return _differing(read, uids, scene, lambda fingerprint: fingerprint)


def changed_themselves(read: ReadScene, uids: set[int], scene: bpy.types.Scene) -> set[int]:
    """Return the session uids of objects whose own data changed since their last bake, or without a bake."""
    return _differing(read, uids, scene, own_part)


def _differing(
    read: ReadScene, uids: set[int], scene: bpy.types.Scene, part: Callable[[str], str]
) -> set[int]:
    """Return the objects for which a part of the fingerprint differs from the last bake's."""
    known = {obj.session_uid: bake_record(obj, scene).fingerprint for obj in bpy.data.objects}
    return {
        uid
        for uid, digest in read.fingerprints.items()
        if uid in uids and part(known.get(uid, "")) != part(digest)
    }


def only_targets(read: ReadScene, uids: set[int], scene: bpy.types.Scene) -> ReadScene:
    """Return the scene with lightmaps only for objects with the given session uids.

    Other objects of these lightmaps are baked as well if their place there has changed, and so are all
    instances in them. Raises SceneError if nothing is left.
    """
    atlases = {entry.place.atlas for entry in read.entries if entry is not None and source_of(entry) in uids}
    if not atlases:
        raise SceneError(NOTHING_SELECTED)
    baked = [
        entry is not None
        and (source_of(entry) in uids or (entry.place.atlas in atlases and not _is_kept(entry, scene)))
        for entry in read.entries
    ]
    names = tuple(name for name in read.scene.atlases if name in atlases)
    left = {
        source_of(entry)
        for entry, stays in zip(read.entries, baked, strict=True)
        if entry is not None and not stays
    }
    meshes = tuple(
        replace(mesh, atlas=names.index(read.scene.atlases[mesh.atlas]) if stays else NO_LIGHTMAP)
        for mesh, stays in zip(read.scene.meshes, baked, strict=True)
    )
    return replace(
        read,
        scene=replace(read.scene, meshes=meshes, atlases=names),
        entries=tuple(entry if stays else None for entry, stays in zip(read.entries, baked, strict=True)),
        fingerprints={uid: digest for uid, digest in read.fingerprints.items() if uid not in left},
    )


def source_of(entry: Entry) -> int:
    """Return the session uid of the source object of a key."""
    shown = bpy.data.objects.get(entry.name) if isinstance(entry, InstanceEntry) else None
    return entry.uid if shown is None else shown.session_uid


def _is_kept(entry: Entry, scene: bpy.types.Scene) -> bool:
    """Return True if an object that is not baked has no lightmap in the atlas, or keeps its place in it."""
    obj, place = find(bpy.data.objects, entry.uid), entry.place
    if isinstance(entry, InstanceEntry) or obj is None:
        return False
    known = scene.hemibake.lightmaps.get(place.atlas)
    record = bake_record(obj, scene)
    if known is None or known.image is None or record.image != known.image:
        return True
    return _same_place(place, record)


def _same_place(place: UvTransform, record: Record) -> bool:
    before = (record.uv_scale, *record.uv_offset)
    return bool(np.allclose(before, (place.scale, *place.offset), rtol=0, atol=1e-5))
