"""Scene and settings, packed for transfer to workers: once per bake, compressed or in a shared file."""

from __future__ import annotations

import hashlib
import pickle
import zlib
from dataclasses import dataclass, replace

from ..numpy_pickle import portable_bytes
from ..plan.tinted import settings_for_tints
from ..scene.cutouts import transmission_maps
from ..scene.model import Scene
from ..settings import Settings
from .machine_files import file_bytes
from .memory_folder import file_with

#: zlib levels: fast for a network, since coordinates and textures hardly shrink further; none within a
#: machine.
_LEVEL, _NONE = 1, 0


@dataclass(frozen=True)
class ScenePayload:
    """Scene and settings as bytes.

    data:    zlib-compressed bytes; empty if they are in a file
    path:    path of a file in the client's shared memory; empty without one
    digest:  SHA-256 of the bytes, hexadecimal; identifies the scene on workers
    """

    data: bytes
    path: str
    digest: str

    @classmethod
    def of(cls, scene: Scene, settings: Settings, local: bool, folder: str = "") -> ScenePayload:
        """Pack a scene that includes objects without lightmap; data that only patches need is removed.

        local:   True if the data does not leave this machine
        folder:  in the shared memory of all workers; empty if there is none
        """
        data = portable_bytes((_for_rays(scene), settings_for_tints(scene, settings)[0]))
        digest = hashlib.sha256(data).hexdigest()
        path = file_with(folder, data)
        return cls(b"" if path else zlib.compress(data, _NONE if local else _LEVEL), path, digest)

    def unpacked(self) -> tuple[Scene, Settings]:
        """Return the scene and the settings."""
        data = file_bytes(self.path) if self.path else zlib.decompress(self.data)
        scene, settings = pickle.loads(data)
        return scene, settings


def _for_rays(scene: Scene) -> Scene:
    """Return a scene without textures, except textures of transparency."""
    materials = tuple(
        replace(material, reflectance_map=None, emission_map=None, back=None) for material in scene.materials
    )
    needed = {texture.uv_map for material in materials for texture in transmission_maps(material)}
    meshes = tuple(
        replace(mesh, texture_uvs={name: uvs for name, uvs in mesh.texture_uvs.items() if name in needed})
        for mesh in scene.meshes
    )
    return replace(scene, meshes=meshes, materials=materials)
