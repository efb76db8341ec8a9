"""What travels to workers once a bake: the scene and the settings, compressed."""

from __future__ import annotations

import hashlib
import pickle
import zlib
from dataclasses import dataclass

from ..scene.model import Scene
from ..settings import Settings

#: Fast compression: coordinates and textures shrink little more at higher levels.
_LEVEL = 1


@dataclass(frozen=True)
class Shipment:
    """A scene and settings as bytes.

    data    compressed
    digest  of the data, hexadecimal: names the scene in tasks, and on workers
    """

    data: bytes
    digest: str

    @classmethod
    def of(cls, scene: Scene, settings: Settings) -> Shipment:
        """Pack a scene that occluders have their places in."""
        data = zlib.compress(pickle.dumps((scene, settings), protocol=5), _LEVEL)
        return cls(data, hashlib.sha256(data).hexdigest())

    def unpacked(self) -> tuple[Scene, Settings]:
        """Return the scene and the settings."""
        scene, settings = pickle.loads(zlib.decompress(self.data))
        return scene, settings
