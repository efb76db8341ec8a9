"""Cache of rendered worlds, so that later bakes do not render an unchanged world again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....engine.scene.model import Light

#: Maximum number of cached worlds; with two, switching between two worlds renders neither again.
_WORLDS = 2


@dataclass(frozen=True)
class ReadWorld:
    """Radiance and suns of a world.

    radiance:  (3,) float32 for a constant colour, or equirectangular (h, w, 3) float32, as engine.Scene.world
    suns:      sun discs that are not in the radiance; position and light group are not set
    notes:     sentences for the user
    """

    radiance: np.ndarray
    suns: tuple[Light, ...] = ()
    notes: tuple[str, ...] = ()


class KeptWorlds:
    """Least-recently-used cache of rendered worlds by the digest of their nodes."""

    def __init__(self) -> None:
        self._worlds: dict[bytes, ReadWorld] = {}

    def get(self, digest: bytes | None) -> ReadWorld | None:
        """Return the world of a digest, None if it is not cached; its arrays are read-only."""
        if digest is None or digest not in self._worlds:
            return None
        self._worlds[digest] = self._worlds.pop(digest)
        return self._worlds[digest]

    def keep(self, digest: bytes | None, world: ReadWorld) -> None:
        """Store a world; without a digest it is not stored."""
        if digest is None:
            return
        world.radiance.flags.writeable = False
        self._worlds[digest] = world
        while len(self._worlds) > _WORLDS:
            del self._worlds[next(iter(self._worlds))]

    def clear(self) -> None:
        """Remove all worlds."""
        self._worlds.clear()


#: The worlds rendered in this Blender session, until another file is opened.
kept_worlds = KeptWorlds()
