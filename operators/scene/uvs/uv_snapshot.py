"""Where the objects of a bake have had their lightmap UVs from: an undo meanwhile may take some away."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from .uv_modifier import has_uvs, uv_source


class UvSnapshot:
    """Knows the sources of the lightmap UVs of objects, see `uv_source`, as they are when it is made."""

    def __init__(self, objects: Iterable[bpy.types.Object], uv_layer: str) -> None:
        self._uv_layer = uv_layer
        self._known = {
            obj.session_uid: (obj.name, uv_source(obj, uv_layer)) for obj in objects if has_uvs(obj, uv_layer)
        }

    def names(self, uids: Iterable[int]) -> list[str]:
        """Return the names that objects had, by their session uids; none for those without such UVs."""
        return [self._known[uid][0] for uid in uids if uid in self._known]

    def lost(self) -> dict[int, str]:
        """Return session uid and name of the objects that have no such UVs any more, or other ones."""
        return {
            obj.session_uid: self._known[obj.session_uid][0]
            for obj in bpy.data.objects
            if obj.session_uid in self._known and self._has_lost(obj)
        }

    def _has_lost(self, obj: bpy.types.Object) -> bool:
        _, source = self._known[obj.session_uid]
        return not has_uvs(obj, self._uv_layer) or uv_source(obj, self._uv_layer) != source
