"""Fingerprints: digests of an object's data in a bake, compared to detect changes since its last bake."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from ...engine.scene.model import Light, Material, emits
from .scene_objects import ReadObject
from .slice_timer import Slices, row_slices
from .uv_transform import UvTransform

#: Decimals of a light's position that count, m; moving it to the scene's origin and back rounds the rest.
_DIGITS = 6

_SIZE = 16


def find_fingerprints(
    readings: Sequence[ReadObject],
    places: Sequence[UvTransform | None],
    materials: Sequence[Material],
    surroundings: Sequence[object],
) -> Slices[list[str | None]]:
    """Return two concatenated digests of each object or instance; None for occluders.

    The first digest covers its faces, its place in the world and the atlas, its materials, and whether its
    light is stored in vertices. The second covers all light sources.

    surroundings:  lights in world space, the world's light, light groups, and a working space other than
                   Rec.709
    """
    looks: list[bytes] = []
    for material in materials:
        looks += [(yield from _digest_of(material))]
    own, shining = [], [(yield from _digest_of(tuple(surroundings)))]
    emitting = [emits(material) for material in materials]
    shapes: dict[int, tuple[bytes, list[int]]] = {}
    for reading, place in zip(readings, places, strict=True):
        shape = reading.mesh
        if id(shape) not in shapes:
            digest = yield from _digest_of((shape.corners, shape.slots))
            shapes[id(shape)] = digest, np.unique(shape.slots).tolist()
        digest, used = shapes[id(shape)]
        on_vertices = ("vertices",) if reading.on_vertices else ()
        parts = (digest, *(looks[index] for index in used), reading.matrix, place, *on_vertices)
        own.append((yield from _digest_of(parts)))
        if any(emitting[index] for index in used):
            shining.append(own[-1] + reading.light_group.encode())
    light = _digest(b"".join(shining))
    return [
        None if place is None else digest.hex() + light for digest, place in zip(own, places, strict=True)
    ]


def in_the_world(lights: Sequence[Light], origin: np.ndarray) -> tuple[Light, ...]:
    """Return lights with positions in world space, which do not depend on the scene's origin."""
    return tuple(
        replace(light, position=np.round(light.position + origin, _DIGITS) + 0.0) for light in lights
    )


def combined(fingerprints: Sequence[str]) -> str:
    """Combine the fingerprints of an object's instances, in any order, to the fingerprint of the object."""
    light = fingerprints[0][2 * _SIZE :]
    return _digest("".join(sorted(map(own_part, fingerprints))).encode()) + light


def own_part(fingerprint: str) -> str:
    """Return the part of a fingerprint that covers the object alone, without the light sources."""
    return fingerprint[: 2 * _SIZE]


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=_SIZE).hexdigest()


def _digest_of(value: object) -> Slices[bytes]:
    """Return the BLAKE2b digest of arrays, records and built-in values, with all that they contain."""
    digest = hashlib.blake2b(digest_size=_SIZE)
    yield from _feed(digest, value)
    return digest.digest()


def _feed(digest: Any, value: object) -> Slices[None]:
    """Add a value to a digest."""
    if isinstance(value, np.ndarray):
        yield from _feed_array(digest, value)
    elif is_dataclass(value):
        for field in fields(value):
            yield from _feed(digest, getattr(value, field.name))
    elif isinstance(value, dict):
        yield from _feed(digest, tuple(value.items()))
    elif isinstance(value, tuple):
        for item in value:
            yield from _feed(digest, item)
    else:
        digest.update(repr(value).encode())


def _feed_array(digest: Any, array: np.ndarray) -> Slices[None]:
    """Add an array to a digest, in slices of rows."""
    digest.update(repr((array.shape, array.dtype.str)).encode())
    rows_of = np.atleast_1d(array)
    for rows in row_slices(len(rows_of), rows_of[:1].size):
        digest.update(np.ascontiguousarray(rows_of[rows]))
        yield None
