"""Digests of where a scene's patches are and what they are made of: equal ones mean that nothing changed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, is_dataclass

import numpy as np

from .model import Material, Mesh, Scene, Texture

#: Arrays of a mesh that decide where its patches are and what they see.
_GEOMETRY = ("positions", "normals", "uvs", "face", "subface", "material")

#: Bytes of a digest that names something.
_SHORT = 20

#: Bytes of long arrays that a thread digests at a time.
_PIECE = 1 << 20

#: What both kinds of maps share: how pixels lie on the surface.
_MAPPING = ("uv_map", "extension", "smooth")


def geometry_digest(scene: Scene) -> bytes:
    """Return a digest of all that decides which patches there are and what they see of each other.

    That is shapes, lightmap UVs, the objects' names in warnings, and what light passes through.
    """
    digest = hashlib.blake2b()
    _feed(digest, [len(scene.atlases), len(scene.meshes), len(scene.materials)])
    alpha_maps = [material.alpha_map for material in scene.materials]
    for mesh in scene.meshes:
        _feed(digest, [mesh.name, mesh.atlas, *(getattr(mesh, name) for name in _GEOMETRY)])
        _feed_uvs(digest, mesh, alpha_maps)
    for material in scene.materials:
        _feed(digest, [material.alpha, material.alpha_threshold, material.culled])
        _feed_texture(digest, material.alpha_map)
    return digest.digest()


def surfaces_digest(scene: Scene) -> bytes:
    """Return a digest of all that decides what the patches of a geometry reflect and emit."""
    digest = hashlib.blake2b()
    maps = [texture for material in scene.materials for texture in _maps(material)]
    for mesh in scene.meshes:
        _feed_uvs(digest, mesh, maps)
    for material in scene.materials:
        _feed(digest, [material.reflectance, material.emission])
        for texture in _maps(material):
            _feed_texture(digest, texture)
    return digest.digest()


def same_values(one: object, other: object) -> bool:
    """Return whether arrays, records and builtins, and what these hold, are the same."""
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
    """Return a digest of arrays, numbers and names, hexadecimal."""
    digest = hashlib.blake2b(digest_size=_SHORT)
    _feed(digest, values)
    return digest.hexdigest()


def _maps(material: Material) -> tuple[Texture | None, Texture | None]:
    return material.reflectance_map, material.emission_map


def _feed_uvs(digest: hashlib.blake2b, mesh: Mesh, textures: Iterable[Texture | None]) -> None:
    """Feed the UV maps of a mesh that textures need."""
    needed = {texture.uv_map for texture in textures if texture is not None}
    for name in sorted(needed & mesh.texture_uvs.keys()):
        _feed(digest, [name, mesh.texture_uvs[name]])


def _feed_texture(digest: hashlib.blake2b, texture: Texture | None) -> None:
    """Feed the pixels of a texture, and how they lie on a surface; or that there is none."""
    if texture is None:
        _feed(digest, [None])
        return
    mapping = [getattr(texture, name) for name in _MAPPING]
    _feed(digest, [*mapping, texture.srgb, texture.transform, texture.pixels])


def _feed(digest: hashlib.blake2b, values: Iterable[object]) -> None:
    """Feed arrays, numbers and names."""
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.shape, value.dtype.str)).encode())
            _feed_bytes(digest, np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
        else:
            digest.update(repr(value).encode())


def _feed_bytes(digest: hashlib.blake2b, values: memoryview) -> None:
    """Feed bytes; of many the digests of pieces, which threads make (a hash tree, Merkle 1980)."""
    if len(values) <= _PIECE:
        digest.update(values)
        return
    pieces = [values[first : first + _PIECE] for first in range(0, len(values), _PIECE)]
    with ThreadPoolExecutor() as threads:
        for piece in threads.map(lambda piece: hashlib.blake2b(piece).digest(), pieces):
            digest.update(piece)
