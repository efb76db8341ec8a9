"""Scenes of the last bakes, stored in memory so that later bakes can detect changed light."""

from __future__ import annotations

import uuid

from ..engine.scene.model import Scene
from .scene import ReadScene
from .working_space import working_space

#: Maximum number of scenes, and of bytes of all scenes. With three, one remains after a bake was undone.
_MOST, _LIMIT = 3, 1 << 29


class SceneSnapshots:
    """Last baked scenes by name; `hemibake.baked_scene` of a Blender scene stores the name."""

    def __init__(self) -> None:
        self._scenes: dict[str, tuple[Scene, int, str]] = {}

    def keep(self, read: ReadScene) -> str:
        """Store a scene, remove the oldest ones if necessary, and return its name; "" if it is too large."""
        size = read.bytes
        while self._scenes and (len(self._scenes) >= _MOST or self._bytes + size > _LIMIT):
            del self._scenes[next(iter(self._scenes))]
        if size > _LIMIT:
            return ""
        name = uuid.uuid4().hex
        self._scenes[name] = read.scene, size, working_space()
        return name

    def find(self, name: str) -> Scene | None:
        """Return the scene with a name; None if it is not stored or was read in another working space."""
        scene, _, space = self._scenes.get(name, (None, 0, ""))
        return scene if space == working_space() else None

    def clear(self) -> None:
        """Remove all scenes."""
        self._scenes.clear()

    @property
    def _bytes(self) -> int:
        return sum(size for _, size, _ in self._scenes.values())


#: The only instance.
baked_scenes = SceneSnapshots()
