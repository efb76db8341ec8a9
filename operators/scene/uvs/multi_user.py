"""Finds lightmap UVs that several objects or instances share."""

from __future__ import annotations

from collections import Counter

import bpy

from .uv_modifier import uv_source


def multi_user_sources(uv_layer: str) -> set[int]:
    """Return the session uids of UV sources (see `uv_source`) that several objects or instances share.

    The charts of a shared source are packed into a square of their own. Each object or instance gets a tile
    for that square in an atlas.
    """
    objects = [obj for obj in bpy.data.objects if obj.type == "MESH"]
    sources = {obj.session_uid: {obj.data.session_uid, uv_source(obj, uv_layer)} for obj in objects}
    users = Counter(source for used in sources.values() for source in used)
    several = {source for source, count in users.items() if count > 1}
    return several.union(*(sources[uid] for uid in instanced_objects() if uid in sources))


def instanced_objects() -> set[int]:
    """Return session uids of objects of instanced collections, and of objects that are in no scene."""
    shown = {obj.session_uid for scene in bpy.data.scenes for obj in scene.objects}
    collections = {obj.instance_collection for obj in bpy.data.objects if obj.instance_collection}
    members = {obj.session_uid for collection in collections for obj in collection.all_objects}
    return members | {obj.session_uid for obj in bpy.data.objects if obj.session_uid not in shown}
