"""A scene and settings on their way to workers: once a bake, compressed, or in a file within a machine."""

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

#: Fast compression: coordinates and textures shrink little more at higher levels. Within a machine there is
#: none, which takes longer than the way.
_LEVEL, _NONE = 1, 0


@dataclass(frozen=True)
class ScenePayload:
    """A scene and settings as bytes.

    data    compressed, see zlib; empty if they are in a file
    path    of a file in the memory of the client's machine; empty without one
    digest  of the bytes, hexadecimal: names the scene on workers
    """

    data: bytes
    path: str
    digest: str

    @classmethod
    def of(cls, scene: Scene, settings: Settings, local: bool, folder: str = "") -> ScenePayload:
        """Pack a scene that occluders have their places in, without what patches alone are made of.

        local   whether it does not leave this machine
        folder  in the memory of all workers; empty if there is none
        """
        data = portable_bytes((_for_rays(scene), settings_for_tints(scene, settings, True)[0]))
        digest = hashlib.sha256(data).hexdigest()
        path = file_with(folder, data)
        return cls(b"" if path else zlib.compress(data, _NONE if local else _LEVEL), path, digest)

    def unpacked(self) -> tuple[Scene, Settings]:
        """Return the scene and the settings."""
        data = file_bytes(self.path) if self.path else zlib.decompress(self.data)
        scene, settings = pickle.loads(data)
        return scene, settings


def _for_rays(scene: Scene) -> Scene:
    """Return a scene without textures but those that light passes through."""
    materials = tuple(
        replace(material, reflectance_map=None, emission_map=None, back=None) for material in scene.materials
    )
    needed = {texture.uv_map for material in materials for texture in transmission_maps(material)}
    meshes = tuple(
        replace(mesh, texture_uvs={name: uvs for name, uvs in mesh.texture_uvs.items() if name in needed})
        for mesh in scene.meshes
    )
    return replace(scene, meshes=meshes, materials=materials)
