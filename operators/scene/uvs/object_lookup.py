"""Finds objects by session uid between slices of work, when the user may have deleted or edited them."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable

import bpy

#: Longest time that meshes are read before control returns to Blender's window, s.
_SLICE = 0.015


class MeshChangedError(Exception):
    """Raised if an object was deleted, or its faces changed, since its mesh was read."""


class ObjectLookup:
    """Finds objects by session uid; renews references each time Blender's window has had control."""

    def __init__(self) -> None:
        self.look_up()

    def look_up(self) -> None:
        """Renew the references to all objects of the file."""
        self._objects = {obj.session_uid: obj for obj in bpy.data.objects}
        self._began = time.perf_counter()

    def pause(self) -> Generator[None, None, None]:
        """Yield to Blender's window if _SLICE has passed since the last yield, then renew the references."""
        if time.perf_counter() - self._began > _SLICE:
            yield None
            self.look_up()

    def __getitem__(self, uid: int) -> bpy.types.Object:
        """Return the object of a session uid; raises MeshChangedError if it was deleted."""
        if uid not in self._objects:
            raise MeshChangedError
        return self._objects[uid]

    def of(self, uids: Iterable[int]) -> list[bpy.types.Object]:
        """Return the objects of session uids in their order; raises MeshChangedError if one was deleted."""
        return [self[uid] for uid in uids]

    def present(self, uids: Iterable[int]) -> list[bpy.types.Object]:
        """Return the objects of session uids that still exist."""
        return [self._objects[uid] for uid in uids if uid in self._objects]
