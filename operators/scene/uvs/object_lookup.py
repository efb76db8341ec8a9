"""The objects of a file by session uid, for work between whose slices somebody may delete or edit them."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable

import bpy

#: Longest time that meshes are read before a window has its turn, s.
_SLICE = 0.015


class MeshChangedError(Exception):
    """An object is gone, or its faces are others, since its mesh was read."""


class ObjectLookup:
    """Finds objects by their session uids; they are looked up anew after each time a window had its turn."""

    def __init__(self) -> None:
        self.look_up()

    def look_up(self) -> None:
        """Find all objects anew."""
        self._objects = {obj.session_uid: obj for obj in bpy.data.objects}
        self._began = time.perf_counter()

    def pause(self) -> Generator[None, None, None]:
        """Give a window its turn if the last one is long ago."""
        if time.perf_counter() - self._began > _SLICE:
            yield None
            self.look_up()

    def __getitem__(self, uid: int) -> bpy.types.Object:
        """Return an object; raises MeshChangedError if it is gone."""
        if uid not in self._objects:
            raise MeshChangedError
        return self._objects[uid]

    def of(self, uids: Iterable[int]) -> list[bpy.types.Object]:
        """Return objects, in the order of their uids; raises MeshChangedError if one of them is gone."""
        return [self[uid] for uid in uids]

    def present(self, uids: Iterable[int]) -> list[bpy.types.Object]:
        """Return those of the objects that are still there."""
        return [self._objects[uid] for uid in uids if uid in self._objects]
