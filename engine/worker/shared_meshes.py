"""Meshes in shared memory: one copy of a large scene for the parent and its worker."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..scene.model import Mesh
from .shared_arrays import SharedArrays

#: Shape of a triangle's values and their type, for each array of a mesh.
_ARRAYS: dict[str, tuple[tuple[int, ...], type]] = {
    "positions": ((3, 3), np.float32),
    "normals": ((3, 3), np.float32),
    "uvs": ((3, 2), np.float32),
    "face": ((), np.int32),
    "subface": ((), np.int32),
    "material": ((), np.int32),
}

#: Bytes of these arrays and of one texture's UVs, for each triangle.
_TRIANGLE, _TEXTURE_UVS = 108, 24

#: Least size of the meshes in shared memory, bytes: others are copied faster than a block is made (chosen).
_LEAST = 1 << 24


class SharedMeshes:
    """Block of shared memory for the meshes of a scene; arrays of one kind are adjacent."""

    def __init__(self, triangles: int, texture_uvs: int, maps: int) -> None:
        """Create the block; raise WorkerError if memory is short.

        triangles:    number of triangles of all meshes
        texture_uvs:  number of triangles of all UV maps for textures
        maps:         number of these UV maps
        """
        size = _TRIANGLE * triangles + _TEXTURE_UVS * texture_uvs
        self._block, self._used = SharedArrays(size, len(_ARRAYS) + maps), 0
        self._arrays = {
            name: self._block.empty((triangles, *shape), dtype) for name, (shape, dtype) in _ARRAYS.items()
        }

    @staticmethod
    def pay_off(triangles: int) -> bool:
        """Return True if meshes with this number of triangles belong in shared memory."""
        return _TRIANGLE * triangles >= _LEAST

    def moved(self, mesh: Mesh) -> Mesh:
        """Return a mesh whose arrays lie in the block, after those of the mesh before."""
        rows = slice(self._used, self._used + len(mesh.positions))
        self._used = rows.stop
        arrays = {name: array[rows] for name, array in self._arrays.items()}
        for name, array in arrays.items():
            array[...] = getattr(mesh, name)
        texture_uvs = {
            name: self._block.empty(uvs.shape, uvs.dtype) for name, uvs in mesh.texture_uvs.items()
        }
        for name, uvs in texture_uvs.items():
            uvs[...] = mesh.texture_uvs[name]
        return replace(mesh, texture_uvs=texture_uvs, **arrays)  # type: ignore[arg-type]
