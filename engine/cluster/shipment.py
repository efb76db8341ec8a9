"""What travels to workers once a bake: the scene and the settings, compressed; groups of patches."""

from __future__ import annotations

import hashlib
import pickle
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..portable import Portable, portable_bytes
from ..scene.model import Scene
from ..settings import Settings
from .memory_folder import new_file

#: Fast compression: coordinates and textures shrink little more at higher levels. Within a machine there is
#: none, which takes longer than the way.
_LEVEL, _NONE = 1, 0


@dataclass(frozen=True)
class Shipment:
    """A scene and settings as bytes.

    data    compressed, see zlib; empty if they are in a file
    path    of a file in the memory of all workers; empty without one
    digest  of the bytes, hexadecimal: names the scene on workers
    """

    data: bytes
    path: str
    digest: str

    @classmethod
    def of(cls, scene: Scene, settings: Settings, local: bool, folder: str = "") -> Shipment:
        """Pack a scene that occluders have their places in.

        local   whether it does not leave this machine
        folder  in the memory of all workers; empty if there is none
        """
        data = portable_bytes((scene, settings))
        digest = hashlib.sha256(data).hexdigest()
        if folder:
            with suppress(OSError):
                path = new_file(folder, len(data))
                Path(path).write_bytes(data)
                return cls(b"", path, digest)
        return cls(zlib.compress(data, _NONE if local else _LEVEL), "", digest)

    def unpacked(self) -> tuple[Scene, Settings]:
        """Return the scene and the settings."""
        data = Path(self.path).read_bytes() if self.path else zlib.decompress(self.data)
        scene, settings = pickle.loads(data)
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
