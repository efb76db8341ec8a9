"""Substitute patches: valid neighbours whose reflected light replaces the light of invalid patches.

Part of an invalid patch's texel may be visible; rays that hit it need plausible light. Iterations, final
gathers and probes take it from the same substitutes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..array_ops import nonzero_entries, order_of, run_numbers, run_starts, taken
from ..device.buffers import download, download_bytes, lasting_buffer, upload, upload_once, words_of
from ..device.cl_device import ComputeDevice
from ..device.device_rows import device_rows
from ..device.opencl import cl
from ..patches.patch_scene import PatchScene
from ..patches.texels_around import beside_any, entries_around
from ..scene.color import channel_sum
from .thresholds import SENDERS

#: Texels that are processed at once.
_TEXELS = 1 << 18

#: Patches for each invalid one from which the invalid ones count as few (chosen).
_FEW = 16

#: Minimum cosine between the normals of a patch and its substitute, and maximum distance between their
#: planes, texels; ALIKE and NEAR of kernels/validity/substitutes.cl.
_ALIKE, _NEAR = 0.9, 0.5

#: Fraction of the brightest light below which light counts as that bright in harmonic means.
_FAINTEST = 1e-4

#: Pairs of an invalid patch and a valid neighbour, two (p,) int64 arrays.
PatchPairs = tuple[np.ndarray, np.ndarray]


def find_substitutes(
    patch_scene: PatchScene, invalid: np.ndarray, compute: ComputeDevice | None = None
) -> PatchPairs:
    """Return pairs of invalid patches and valid ones in neighbouring texels on the same plane.

    invalid:  (n,) bool, invalid patches; at least one. Must not change, since its upload is cached
    compute:  OpenCL device; None to use NumPy
    """
    if compute is not None:
        return _find_on_device(compute, patch_scene, invalid)
    texels = _invalid_texels(patch_scene, invalid)
    pairs = [
        _valid_neighbours(patch_scene, invalid, texels[first : first + _TEXELS])
        for first in range(0, max(len(texels), 1), _TEXELS)
    ]
    patch, neighbour = (np.concatenate(numbers) for numbers in zip(*pairs, strict=True))
    return patch, neighbour


def _find_on_device(compute: ComputeDevice, patch_scene: PatchScene, invalid: np.ndarray) -> PatchPairs:
    """Return the result of `find_substitutes`, computed on the OpenCL device."""
    entries, geometry = patch_scene.entries, patch_scene.geometry
    count, list_all = compute.kernels(SENDERS, "count_candidates", "list_candidates")
    triangle, barycentric = geometry.on_device(compute)
    inputs = (
        device_rows(compute, entries),
        upload_once(compute, invalid),
        triangle,
        barycentric,
        upload_once(compute, geometry.triangles.positions),
        *(lasting_buffer(compute, array) for array in (geometry.steps.geometric, geometry.steps.longer)),
    )

    # Count the candidates of each texel, then list those of the few texels that have any.
    counts = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(entries.size))
    compute.run_texels(count, entries.shape, *inputs, counts)
    number = download_bytes(compute, counts, entries.size)
    texels = np.flatnonzero(number > 0)
    ends = np.cumsum(number[texels], dtype=np.uint32)
    if not len(texels):
        return texels, texels
    pairs = int(ends[-1])
    where = upload(compute, texels.astype(np.uint32)), upload(compute, ends - number[texels])
    listed = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 8 * pairs)
    side = np.int32(entries.shape[-1])
    compute.run(list_all, len(texels), *inputs, side, *where, np.uint32(pairs), listed, np.int32(len(texels)))
    patch, neighbour = download(compute, listed, (2, pairs)).view(np.uint32).astype(np.int64)
    return patch, neighbour


def _invalid_texels(patch_scene: PatchScene, invalid: np.ndarray) -> np.ndarray:
    """Return texels of invalid patches, (k,) int64, ascending; may omit those without valid neighbours."""
    shown = patch_scene.texel_to_patch
    if np.count_nonzero(shown) == len(invalid) > _FEW * np.count_nonzero(invalid):
        # Each patch has one texel, and so few are invalid that all their neighbours are looked up.
        return patch_scene.patches.key[invalid]
    invalid_texels = taken(np.concatenate([[False], invalid]), shown.ravel()).reshape(shown.shape)
    texels: np.ndarray = np.flatnonzero(invalid_texels & beside_any((shown > 0) & ~invalid_texels))
    return texels


def substitute_patches(
    patch_scene: PatchScene,
    invalid: np.ndarray,
    light_of: Callable[[np.ndarray], np.ndarray],
    find_pairs: Callable[[PatchScene, np.ndarray], PatchPairs] = find_substitutes,
) -> np.ndarray | None:
    """Return the substitute of each patch, (n,) uint32, valid patches themselves; None if all are valid.

    The substitute is the brightest candidate that is not brighter than the harmonic mean of all candidates.
    Under a thin wall with light on one side that mean is dark, so the dark side takes no light of the lit
    side. Elsewhere it has less bias than the darkest candidate, and a brighter one would add energy. A patch
    without candidates is its own substitute.

    patch_scene:  patches of the scene, or patch groups
    invalid:      (n,) bool, invalid patches
    light_of:     returns E/pi, (k, 3), of some patches, (k,) int64
    find_pairs:   `find_substitutes`, or a version that caches its last results
    """
    if not invalid.any():
        return None
    patch, neighbour = find_pairs(patch_scene, invalid)
    order = order_of(patch)
    patch, neighbour = patch[order], neighbour[order]

    # Lights too bright for float32 can give NaN, which counts as the brightest.
    light = channel_sum(light_of(neighbour)).astype(np.float64)
    light[np.isnan(light)] = np.inf
    starts = run_starts(patch)
    first = _closest_below_means(light, starts)
    result = np.arange(len(invalid), dtype=np.uint32)
    result[patch[starts]] = neighbour[first]
    return result


def _closest_below_means(light: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return a candidate of each patch, (k,) int64: closest to the harmonic mean and not brighter.

    light:   (p,) float64, light of the candidates
    starts:  (k,) int64, first candidate of each patch
    """
    number = run_numbers(starts, len(light))
    above = light - _harmonic_means(light, number)

    # Rounding can put all candidates of a patch above their mean.
    distance = np.where(above > 0, np.inf, -above)
    nearest = np.minimum.reduceat(distance, starts) if len(starts) else starts
    rounded = np.isinf(nearest)
    if rounded.any():
        distance = np.where(rounded[number], above, distance)
        nearest = np.minimum.reduceat(distance, starts)
    closest = np.flatnonzero(distance == nearest[number])
    first: np.ndarray = closest[run_starts(number[closest])]
    return first


def _harmonic_means(light: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Return the harmonic mean of the light of all candidates of the same patch, (p,) float64, by candidate.

    light:   (p,) float64, light of the candidates
    number:  (p,) int64, number of each candidate's patch, without gaps
    """
    faintest = max(_FAINTEST * float(light.max(initial=0)), 1e-30)
    inverse = np.bincount(number, 1 / np.maximum(light, faintest))
    mean: np.ndarray = np.bincount(number) / np.maximum(inverse, 1e-30)
    return mean[number]


def _valid_neighbours(patch_scene: PatchScene, invalid: np.ndarray, texels: np.ndarray) -> PatchPairs:
    """Return pairs of invalid patches in the given texels and valid neighbours on the same plane.

    patch_scene:  patches of the scene
    invalid:      (n,) bool, invalid patches
    texels:       (k,) int64, texels of invalid patches, see `PatchList.key`
    """
    entries = entries_around(patch_scene.texel_to_patch, texels)
    place, step = nonzero_entries(np.concatenate([[False], ~invalid])[entries])
    patch, neighbour = entries[place, 4] - 1, entries[place, step] - 1
    here, there = patch_scene.geometry.subset(patch), patch_scene.geometry.subset(neighbour)
    alike = np.einsum("pd,pd->p", here.geometric, there.geometric) > _ALIKE
    off = np.abs(np.einsum("pd,pd->p", there.center - here.center, here.geometric))
    alike &= off < _NEAR * patch_scene.geometry.steps.longer[here.triangle]
    return patch[alike], neighbour[alike]
