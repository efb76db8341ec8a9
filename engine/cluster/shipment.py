"""What travels to workers once a bake: the scene and the settings, compressed; groups of patches."""

from __future__ import annotations

import hashlib
import pickle
import zlib
from dataclasses import dataclass

import numpy as np

from ..portable import Portable, portable_bytes
from ..scene.model import Scene
from ..settings import Settings

#: Fast compression: coordinates and textures shrink little more at higher levels. Within a machine there is
#: none, which takes longer than the way.
_LEVEL, _NONE = 1, 0


@dataclass(frozen=True)
class Shipment:
    """A scene and settings as bytes.

    data    compressed, see zlib
    digest  of the data, hexadecimal: names the scene in tasks, and on workers
    """

    data: bytes
    digest: str

    @classmethod
    def of(cls, scene: Scene, settings: Settings, local: bool) -> Shipment:
        """Pack a scene that occluders have their places in; `local` if it does not leave this machine."""
        data = zlib.compress(portable_bytes((scene, settings)), _NONE if local else _LEVEL)
        return cls(data, hashlib.sha256(data).hexdigest())

    def unpacked(self) -> tuple[Scene, Settings]:
        """Return the scene and the settings."""
        scene, settings = pickle.loads(zlib.decompress(self.data))
        return scene, settings


@dataclass(frozen=True)
class Squares(Portable):
    """Groups of the patches of a scene; see `solve.patch_groups.PatchGroups`.

    leader  (n,) uint32, the patch that each patch follows
    width   of a square, texels
    digest  hexadecimal: names the groups on workers
    """

    leader: np.ndarray
    width: int
    digest: str

    @classmethod
    def of(cls, leader: np.ndarray, width: int) -> Squares:
        """Name groups."""
        return cls(leader, width, hashlib.sha256(np.ascontiguousarray(leader).data).hexdigest())
