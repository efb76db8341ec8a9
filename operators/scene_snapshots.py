"""Scenes as bakes have seen them, while Blender runs: what their light is now is compared with them."""

from __future__ import annotations

import uuid

from ..engine.scene.model import Scene
from .scene import ReadScene

#: Scenes that are remembered, so that one is still known when a bake is undone, and the bytes of all.
_MOST, _LIMIT = 3, 1 << 29


class SceneSnapshots:
    """The last few scenes whose light was baked, by names that scenes of Blender hold."""

    def __init__(self) -> None:
        self._scenes: dict[str, tuple[Scene, int]] = {}

    def keep(self, read: ReadScene) -> str:
        """Remember a scene in place of the oldest ones; return its name, empty if it is too large."""
        size = read.bytes
        while self._scenes and (len(self._scenes) >= _MOST or self._bytes + size > _LIMIT):
            del self._scenes[next(iter(self._scenes))]
        if size > _LIMIT:
            return ""
        name = uuid.uuid4().hex
        self._scenes[name] = read.scene, size
        return name

    def find(self, name: str) -> Scene | None:
        """Return the scene of a name; None if it is not remembered."""
        scene, _ = self._scenes.get(name, (None, 0))
        return scene

    def clear(self) -> None:
        """Forget all of them."""
        self._scenes.clear()

    @property
    def _bytes(self) -> int:
        return sum(size for _, size in self._scenes.values())


#: One for the whole add-on.
baked_scenes = SceneSnapshots()
