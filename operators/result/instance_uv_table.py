"""Table of the lightmap UV transforms of an object's instances, for shaders.

All instances share the object's materials and differ by a random number from the Object Info node. A
two-level perfect hash finds an instance by this number r (Fredman, Komlós and Szemerédi 1984). Of B buckets,
r is in bucket floor(r B). Of the bucket's m slots, r is in slot floor(frac(r B) m). B and all m are powers of
two, so the arithmetic is exact in float32. One image holds

    B texels   (first slot, m) of each bucket
    then       slots: (offset u, offset v, scale, index of the lightmap); zero for empty slots
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..scene.bake_records import bake_record
from ..scene.objects.items import name_hash

#: Width of a table, texels, and maximum slots of a bucket; numbers have 24 bits.
_WIDTH = 256
_MOST_SLOTS = 1 << 16


@dataclass(frozen=True)
class InstanceUvTransform:
    """UV transform of an instance: lightmap UV = UV of the mesh * scale + offset.

    bits:   random number of the instance times (2^32 - 1)
    image:  lightmap of the instance
    """

    bits: int
    image: bpy.types.Image
    scale: float
    offset: tuple[float, float]


@dataclass(frozen=True)
class PlaceTable:
    """Table of UV transforms of an object's instances: (rows, _WIDTH, 4) float32, and bucket count."""

    texels: np.ndarray
    buckets: int


def baked_instances(scene: bpy.types.Scene) -> dict[tuple[bpy.types.Object, str, tuple[int, ...]], dict]:
    """Return the recorded data of baked instances, by instancer, object name and persistent id."""
    return {
        (obj, entry["object"], tuple(entry["persistent_id"])): entry
        for obj in scene.objects
        if (known := bake_record(obj, scene).instances)
        for entry in json.loads(known)
    }


def instance_places(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph
) -> dict[bpy.types.Object, list[InstanceUvTransform]]:
    """Return the UV transforms of the baked instances of each object, and of the object itself."""
    baked = baked_instances(scene)
    places: dict[bpy.types.Object, list[InstanceUvTransform]] = {}
    for instance in depsgraph.object_instances if baked else ():
        if not instance.is_instance:
            continue
        source = instance.object.original
        entry = baked.get((instance.parent.original, source.name, tuple(instance.persistent_id)))
        image = None if entry is None else instance_image(scene, entry)
        if entry is not None and image is not None:
            bits = instance.random_id & 0xFFFFFFFF
            place = InstanceUvTransform(bits, image, entry["scale"], tuple(entry["offset"]))
            places.setdefault(source, []).append(place)
    for source, others in places.items():
        own = bake_record(source, scene)
        if own.image is not None:
            place = InstanceUvTransform(name_hash(source.name), own.image, own.uv_scale, tuple(own.uv_offset))
            others.append(place)
    return places


def instance_image(scene: bpy.types.Scene, entry: dict) -> bpy.types.Image | None:
    """Return the lightmap of an instance: by its name in the list of lightmaps, else by the image's name."""
    lightmap = scene.hemibake.lightmaps.get(entry["atlas"])
    return lightmap.image if lightmap and lightmap.image else bpy.data.images.get(entry["image"])


def place_table(places: Sequence[InstanceUvTransform], images: Sequence[bpy.types.Image]) -> PlaceTable:
    """Return the table of UV transforms, one for each random number."""
    numbers = shader_numbers([place.bits for place in places])
    buckets = 1 << max(len(places) - 1, 0).bit_length()
    bucket, rest = _split(numbers, buckets)
    heads, slots, first = np.zeros((buckets, 4), np.float32), [], buckets
    for index in range(buckets):
        members = np.flatnonzero(bucket == index)
        count = _slot_count(rest[members])
        block = np.zeros((count, 4), np.float32)
        for member in members:
            place = places[member]
            slot = min(int(rest[member] * count), count - 1)
            block[slot] = (*place.offset, place.scale, images.index(place.image))
        heads[index, :2] = first, count
        slots.append(block)
        first += count
    texels = np.concatenate([heads, *slots])
    rows = -(-len(texels) // _WIDTH)
    padded = np.zeros((rows * _WIDTH, 4), np.float32)
    padded[: len(texels)] = texels
    return PlaceTable(padded.reshape(rows, _WIDTH, 4), buckets)


def shader_numbers(bits: Sequence[int]) -> np.ndarray:
    """Return random numbers as shaders receive them, float32 in [0, 1); 1 becomes the next smaller number."""
    numbers = np.array(bits, np.uint32).astype(np.float32) * np.float32(1 / 0xFFFFFFFF)
    return np.minimum(numbers, np.float32(1 - 2**-24))


def _split(numbers: np.ndarray, buckets: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bucket of each number, and its position in the bucket, in [0, 1)."""
    scaled = numbers * np.float32(buckets)
    bucket = np.floor(scaled)
    return bucket.astype(int), scaled - bucket


def _slot_count(rest: np.ndarray) -> int:
    """Return the smallest power of two of slots that separates the numbers; equal numbers share a slot."""
    rest = np.unique(rest)
    count = 1
    while count < _MOST_SLOTS and len(np.unique(np.floor(rest * count))) < len(rest):
        count *= 2
    return count
