"""Lit back faces: back faces that send out light do not indicate the inside of geometry."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, lasting_buffer, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.device_rows import device_rows
from ..device.opencl import cl
from ..patches.patch_scene import PatchScene
from ..scene.color import luminance
from .thresholds import DARK_BACK, SENDERS

#: Maximum number of patches in the mean radiance of the scene.
_SAMPLED = 1 << 16

#: Points of a triangle in the mean of its back face: POINTS of kernels/validity/lit_backs.cl.
_POINTS = 64


def lit_backs(
    compute: ComputeDevice, sources: PatchScene, radiance: cl.Buffer, count: int
) -> cl.Buffer | None:
    """Return flags of triangles whose back face sends out light, uint8 buffer on the device.

    Returns None if no triangle has a back face with patches.

    sources:   patches or patch groups that send out light
    radiance:  float4 for each of them, at index + 1, on the device
    count:     number of them
    """
    triangles = sources.triangles
    if triangles.backs is None:
        return None
    mean = mean_luminance(compute, radiance, count)
    (kernel,) = compute.kernels(SENDERS, "luminance_of_backs")
    arrays = triangles.atlas, sources.entries
    lookups = lasting_buffer(compute, triangles.uvs), *(device_rows(compute, rows) for rows in arrays)
    found = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * triangles.solid)
    compute.run(
        kernel, triangles.solid, *lookups, np.int32(sources.patches.resolution),
        upload_once(compute, triangles.backs), radiance, found, np.int32(triangles.solid),
    )  # fmt: skip
    sent = download(compute, found, (triangles.solid,))
    return upload(compute, ((sent > 0) & (sent >= DARK_BACK * mean)).astype(np.uint8))


def mean_luminance(compute: ComputeDevice, radiance: cl.Buffer, count: int) -> float:
    """Return the mean luminance of exitant radiance, from evenly spaced patches if there are many."""
    (kernel,) = compute.kernels(SENDERS, "sample_radiance")
    stride = max(1, -(-count // _SAMPLED))
    some = -(-count // stride)
    sampled = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 16 * some)
    compute.run(kernel, some, radiance, np.int32(stride), sampled, np.int32(some))
    colors = download(compute, sampled, (some, 4))[:, :3]
    return float(luminance(colors).mean(dtype=np.float64))


def lit_backs_on_host(sources: PatchScene, radiance: np.ndarray) -> np.ndarray | None:
    """Return flags of triangles as `lit_backs`, (t,) bool, computed in NumPy.

    sources:   patches that send out light
    radiance:  (m, 3) float32, of each of them
    """
    triangles, resolution = sources.triangles, sources.patches.resolution
    if triangles.backs is None:
        return None
    entries = np.concatenate([np.zeros(1, np.float32), luminance(radiance)])
    flags = np.zeros(triangles.solid, bool)
    chosen = np.flatnonzero(triangles.backs >= 0)
    back = triangles.backs[chosen]
    weights = _points_of_triangles()
    sent = np.zeros(len(chosen), np.float64)
    for weight in np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1):
        uv = np.einsum("k,nkd->nd", weight.astype(np.float32), triangles.uvs[back])
        column, row = (uv * resolution).astype(np.int64).clip(0, resolution - 1).T
        sent += entries[sources.texel_to_patch[triangles.atlas[back], row, column]]
    mean = float(luminance(radiance).mean(dtype=np.float64)) if len(radiance) else 0.0
    flags[chosen] = (sent > 0) & (sent >= DARK_BACK * mean * len(weights))
    return flags


def _points_of_triangles() -> np.ndarray:
    """Return points of a triangle as barycentrics of two corners, (POINTS, 2), see lit_backs.cl."""
    index = np.arange(_POINTS, dtype=np.uint64)[:, None]
    bits = (index * np.array([3242174889, 2447445414], np.uint64)) & np.uint64(0xFFFFFFFF)
    weights = (bits >> np.uint64(8)).astype(np.float64) / 2**24
    folded: np.ndarray = np.where(weights.sum(axis=1, keepdims=True) > 1, 1 - weights, weights)
    return folded
