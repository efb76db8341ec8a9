"""Content hashes of geometry and materials; equal hashes mean that nothing changed."""

from __future__ import annotations

import hashlib
import os
import weakref
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields, is_dataclass
from functools import cache

import numpy as np

from .cutouts import transmission_maps, transmittances
from .model import Material, Mesh, Scene
from .texture import Texture

#: Arrays of a mesh that determine its patches and their visibility.
_GEOMETRY = ("positions", "normals", "uvs", "face", "subface", "material")

#: Arrays of a mesh of back faces; its other arrays follow from the mesh of its front faces.
_OF_BACKS = ("uvs", "material")

#: Bytes of a short hash, used in file names, and of other hashes.
_SHORT, _LONG = 20, 64

#: Bytes that a thread hashes at once, and maximum number of threads.
_PIECE, _MAX_THREADS = 1 << 20, 4

#: Fields of a texture that determine how it is mapped and looked up, without its pixels.
_MAPPING = ("uv_map", "extension", "smooth")


class ArrayDigests:
    """Cache of the hashes of long, immutable arrays, by identity."""

    def __init__(self) -> None:
        self._known: dict[int, bytes] = {}
        self._begun: dict[int, tuple[np.ndarray, list[Future[bytes]]]] = {}

    def begin(self, scene: Scene) -> None:
        """Start to hash long arrays of meshes in threads; drop hashes begun for an earlier scene."""
        self._begun.clear()
        meshes = [mesh for mesh in scene.meshes if mesh.positions.nbytes > _PIECE]
        for array in (array for mesh in meshes for array in _geometry_of(mesh)):
            known = id(array) in self._known or id(array) in self._begun
            if array.nbytes > _PIECE and not known:
                self._begun[id(array)] = array, _hashes(array)

    def of(self, array: np.ndarray) -> bytes:
        """Return the hash of an array's values."""
        key = id(array)
        if key not in self._known:
            _, begun = self._begun.pop(key, (array, None))
            self._known[key] = _tree_digest(array) if begun is None else _root(begun)
            weakref.finalize(array, self._known.pop, key, None).atexit = False
        return self._known[key]


class _Digest:
    """Incremental content hash (BLAKE2b).

    known:  cached hashes of long arrays; None to read all of them
    size:   bytes
    """

    def __init__(self, known: ArrayDigests | None = None, size: int = _LONG) -> None:
        self._digest = hashlib.blake2b(digest_size=size)
        self._of_long = _tree_digest if known is None else known.of

    def feed(self, values: Iterable[object]) -> None:
        """Add arrays, numbers and strings."""
        for value in values:
            if isinstance(value, np.ndarray):
                self._digest.update(repr((value.shape, value.dtype.str)).encode())
                self._digest.update(_bytes_of(value) if value.nbytes <= _PIECE else self._of_long(value))
            else:
                self._digest.update(repr(value).encode())

    def feed_mesh(self, mesh: Mesh) -> None:
        """Add what a geometry digest covers of a mesh, in few calls: scenes may have many small meshes."""
        arrays = _geometry_of(mesh)
        if mesh.front is not None:
            arrays.append(mesh.front)
        types = [(array.shape, array.dtype.str) for array in arrays]
        parts = [array.tobytes() if array.nbytes <= _PIECE else self._of_long(array) for array in arrays]
        head = repr((mesh.name, mesh.atlas, mesh.front is None, types)).encode()
        self._digest.update(b"".join([head, *parts]))

    def feed_uvs(self, mesh: Mesh, textures: Iterable[Texture | None]) -> None:
        """Add the UV maps of a mesh that the textures use."""
        needed = {texture.uv_map for texture in textures if texture is not None}
        for name in sorted(needed & mesh.texture_uvs.keys()):
            self.feed([name, mesh.texture_uvs[name]])

    def feed_texture(self, texture: Texture) -> None:
        """Add the pixels and the mapping of a texture."""
        mapping = [getattr(texture, name) for name in _MAPPING]
        self.feed([*mapping, texture.srgb, texture.transform, texture.pixels])

    def value(self) -> bytes:
        """Return the hash of everything added."""
        return self._digest.digest()


def geometry_digest(scene: Scene, known: ArrayDigests | None = None) -> bytes:
    """Return a hash of everything that determines the patches and their visibility.

    It covers shapes, lightmap UVs, transmittance, and object names, which appear in warnings.

    known:  cached hashes of long arrays, for successive scenes; None to read all of them
    """
    digest = _Digest(known)
    digest.feed([len(scene.atlases), len(scene.meshes), len(scene.materials)])
    maps = [texture for material in scene.materials for texture in transmission_maps(material)]
    for mesh in scene.meshes:
        digest.feed_mesh(mesh)
        if maps and mesh.front is None:
            digest.feed_uvs(mesh, maps)
    for material in scene.materials:
        entries = transmittances(material.transmission)
        factors = np.array([(entry.offset, entry.scale) for entry in entries])
        others = [(entry.threshold, entry.fresnel, entry.texture is None) for entry in entries]
        digest.feed([factors.tobytes(), others])
        for entry in entries:
            if entry.texture is not None:
                digest.feed_texture(entry.texture)
    return digest.value()


def surfaces_digest(scene: Scene, known: ArrayDigests | None = None) -> bytes:
    """Return a hash of everything that determines reflectance and emission of the patches.

    known:  cached hashes, see `geometry_digest`
    """
    digest = _Digest(known)
    maps = [texture for material in scene.materials for texture in _maps(material)]
    for mesh in scene.meshes:
        if mesh.front is None:
            digest.feed_uvs(mesh, maps)
    sides = [side for material in scene.materials for side in (material, material.back) if side is not None]
    colors = [color for side in sides for color in (side.reflectance, side.emission)]
    colors += [material.translucency for material in scene.materials]
    digest.feed([np.array(colors).tobytes(), [material.back is None for material in scene.materials]])

    # Few materials of large scenes have textures.
    for place, texture in enumerate(maps):
        if texture is not None:
            digest.feed([place])
            digest.feed_texture(texture)
    return digest.value()


def same_values(one: object, other: object) -> bool:
    """Return True if two arrays, records or builtins are equal, compared recursively."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same_values, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same_values(one[key], other[key]) for key in one)
    if is_dataclass(one):
        return all(same_values(getattr(one, entry.name), getattr(other, entry.name)) for entry in fields(one))
    return one == other


def digest_of(values: Iterable[object]) -> str:
    """Return a hexadecimal hash of arrays, numbers and strings."""
    digest = _Digest(size=_SHORT)
    digest.feed(values)
    return digest.value().hex()


def _geometry_of(mesh: Mesh) -> list[np.ndarray]:
    """Return the arrays of a mesh that its geometry digest covers."""
    return [getattr(mesh, name) for name in (_GEOMETRY if mesh.front is None else _OF_BACKS)]


def _maps(material: Material) -> tuple[Texture | None, ...]:
    maps = material.reflectance_map, material.emission_map, material.translucency_map
    back = material.back
    return maps if back is None else (*maps, back.reflectance_map, back.emission_map)


def _bytes_of(array: np.ndarray) -> memoryview:
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _tree_digest(array: np.ndarray) -> bytes:
    """Return the hash of a large array: its pieces are hashed in threads, then their hashes (Merkle 1980)."""
    return _root(_hashes(array))


def _hashes(array: np.ndarray) -> list[Future[bytes]]:
    """Start to hash the pieces of an array."""
    values = _bytes_of(array)
    return [_pool().submit(_hash, values[first : first + _PIECE]) for first in range(0, len(values), _PIECE)]


def _root(hashes: list[Future[bytes]]) -> bytes:
    return _hash(b"".join(piece.result() for piece in hashes))


def _hash(values: memoryview | bytes) -> bytes:
    return hashlib.blake2b(values).digest()


@cache
def _pool() -> ThreadPoolExecutor:
    """Return threads for hashes, which the threads of `map_slabs` do not wait for."""
    return ThreadPoolExecutor(min(_MAX_THREADS, os.cpu_count() or 1), "hashes")
