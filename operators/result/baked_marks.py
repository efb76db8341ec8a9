"""Records of a bake on the scene's lightmap list and on objects, for the preview and later bakes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import bpy

from ...engine.bake_result import BakeResult
from ...engine.outputs import DOMINANT_DIRECTION
from ...engine.scene.light_groups import light_group_names
from ...engine.settings import Settings
from ..scene import ReadScene
from ..scene.bake_records import claim_bake_id, writable_record
from ..scene.uvs.lightmap_layer import lightmap_layer
from .directional_images import directional_kind
from .preserved_texels import PreservedTexels


def mark_lightmaps(
    entries: bpy.types.bpy_prop_collection,
    lightmap: BakeResult,
    read: ReadScene,
    settings: Settings,
    kept: PreservedTexels,
) -> None:
    """Record on each lightmap of a scene the other maps that belong to it, and its texel usage.

    The usage is known only if all objects of the lightmap were baked.
    """
    groups = light_group_names(read.scene) if settings.by_light_groups else []
    partial = {atlas for atlas, _ in kept.objects()}
    for atlas, has_patch in zip(lightmap.atlases, lightmap.has_patch, strict=True):
        if atlas in entries:
            entries[atlas].directional = directional_kind(settings.outputs)
            entries[atlas].has_dominant_direction = DOMINANT_DIRECTION in settings.outputs
            entries[atlas].light_groups = json.dumps(groups)
        if atlas in entries and atlas not in partial:
            entries[atlas].used = 100 * float(has_patch.mean())


def mark_objects(
    scene: bpy.types.Scene,
    read: ReadScene,
    images: Sequence[bpy.types.Image],
    uv_layer: str,
    lost: Mapping[int, str],
) -> None:
    """Record on each baked object its image of the first output, its UV layer and UV transform.

    images:  images of the first output, one for each atlas
    lost:    session uids and names of objects without lightmap UVs, which stay unchanged
    """
    claim_bake_id(scene)
    image_of = dict(zip(read.scene.atlases, images, strict=False))
    editable = {obj.session_uid: obj for obj in bpy.data.objects if obj.is_editable}
    instances: dict[int, list[dict]] = {}
    for uid, name, number, place in read.instances:
        if uid in editable and name not in lost.values():
            where = {"image": image_of[place.atlas].name, "atlas": place.atlas}
            known = {"object": name, "persistent_id": number, **where}
            instances.setdefault(uid, []).append({**known, "scale": place.scale, "offset": place.offset})
    for uid, entries in instances.items():
        writable_record(editable[uid], scene).instances = json.dumps(entries)
    for uid, place in read.objects:
        if uid in editable and uid not in lost:
            properties = writable_record(editable[uid], scene)
            properties.image = image_of[place.atlas]
            properties.uv_layer = lightmap_layer(editable[uid], uv_layer)
            properties.uv_scale, properties.uv_offset = place.scale, place.offset
    for uid, fingerprint in read.fingerprints.items():
        if uid in editable and uid not in lost:
            record = writable_record(editable[uid], scene)
            record.fingerprint, record.baked_uvs = fingerprint, read.uv_digests.get(uid, "")
