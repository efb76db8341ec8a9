"""Lit back faces: those that send out light are no sign of the inside of something."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..patches.patch_scene import PatchScene
from ..scene.color import luminance
from .thresholds import DARK_BACK

#: Patches whose mean radiance stands for that of the scene, at most.
_SAMPLED = 1 << 16


def lit_backs(
    compute: ComputeDevice, sources: PatchScene, radiance: cl.Buffer, count: int
) -> cl.Buffer | None:
    """Return which triangles have a back face that sends out light, uint8 of each on the device.

    None if no triangle has a back face with patches.

    sources   patches, or groups of them, that send out light
    radiance  float4 of each of them + 1, on the device
    count     of them
    """
    triangles = sources.triangles
    if triangles.backs is None:
        return None
    mean = _mean_luminance(compute, radiance, count)
    (kernel,) = compute.kernels("lit_backs.cl", "luminance_of_backs")
    arrays = triangles.uvs, triangles.atlas, sources.texel_to_patch
    lookups = (upload_once(compute, array) for array in arrays)
    found = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * triangles.solid)
    compute.run(
        kernel, triangles.solid, *lookups, np.int32(sources.patches.resolution),
        upload_once(compute, triangles.backs), radiance, found, np.int32(triangles.solid),
    )  # fmt: skip
    sent = download(compute, found, (triangles.solid,))
    return upload(compute, ((sent > 0) & (sent >= DARK_BACK * mean)).astype(np.uint8))


def _mean_luminance(compute: ComputeDevice, radiance: cl.Buffer, count: int) -> float:
    """Return the mean luminance of what patches send out; of some at even distances where they are many."""
    (kernel,) = compute.kernels("lit_backs.cl", "sample_radiance")
    stride = max(1, -(-count // _SAMPLED))
    some = -(-count // stride)
    sampled = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 16 * some)
    compute.run(kernel, some, radiance, np.int32(stride), sampled, np.int32(some))
    colors = download(compute, sampled, (some, 4))[:, :3]
    return float(luminance(colors).mean(dtype=np.float64))
