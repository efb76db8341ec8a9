"""Worlds that Blender has rendered in earlier bakes: those that have not changed are not rendered again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....engine.scene.model import Light

#: Worlds that are kept: those that a person changes back and forth between.
_WORLDS = 2


@dataclass(frozen=True)
class ReadWorld:
    """The surroundings.

    radiance  (3,) float32, or equirectangular (h, w, 3) float32 as engine.Scene.world
    suns      sun discs that the radiance lacks; position and light group are not set
    notes     sentences for the user
    """

    radiance: np.ndarray
    suns: tuple[Light, ...] = ()
    notes: tuple[str, ...] = ()


class KeptWorlds:
    """Worlds by the digest of their nodes; those used longest ago are dropped first."""

    def __init__(self) -> None:
        self._worlds: dict[bytes, ReadWorld] = {}

    def get(self, digest: bytes | None) -> ReadWorld | None:
        """Return the world of a digest, whose arrays must not be changed; None if there is none."""
        if digest is None or digest not in self._worlds:
            return None
        self._worlds[digest] = self._worlds.pop(digest)
        return self._worlds[digest]

    def keep(self, digest: bytes | None, world: ReadWorld) -> None:
        """Keep a world; without a digest it could not be found."""
        if digest is None:
            return
        world.radiance.flags.writeable = False
        self._worlds[digest] = world
        while len(self._worlds) > _WORLDS:
            del self._worlds[next(iter(self._worlds))]

    def clear(self) -> None:
        """Drop all of them."""
        self._worlds.clear()


#: Those of this Blender, until another file is opened.
kept_worlds = KeptWorlds()
