"""Snapshot of the sources of lightmap UVs when a bake begins, because an undo may remove UVs."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from .uv_modifier import has_uvs, uv_source


class UvSnapshot:
    """UV source (see `uv_source`) of each object with lightmap UVs at the time of construction."""

    def __init__(self, objects: Iterable[bpy.types.Object], uv_layer: str) -> None:
        self._uv_layer = uv_layer
        self._known = {
            obj.session_uid: (obj.name, uv_source(obj, uv_layer)) for obj in objects if has_uvs(obj, uv_layer)
        }

    def names(self, uids: Iterable[int]) -> list[str]:
        """Return the recorded names of objects by session uid; objects without lightmap UVs are left out."""
        return [self._known[uid][0] for uid in uids if uid in self._known]

    def lost(self) -> dict[int, str]:
        """Return session uid and recorded name of objects whose lightmap UVs are gone or changed source."""
        return {
            obj.session_uid: self._known[obj.session_uid][0]
            for obj in bpy.data.objects
            if obj.session_uid in self._known and self._has_lost(obj)
        }

    def _has_lost(self, obj: bpy.types.Object) -> bool:
        _, source = self._known[obj.session_uid]
        return not has_uvs(obj, self._uv_layer) or uv_source(obj, self._uv_layer) != source
