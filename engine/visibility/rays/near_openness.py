"""Short-range openness and fraction of back faces per patch; both limit interpolation of light."""

from __future__ import annotations

import numpy as np

from ...device.buffers import download
from ...device.opencl import cl
from .ray_scene import RayScene
from .receiver_records import RECEIVER


def openness(rays: RayScene, reach: float) -> cl.Buffer:
    """Return the cosine-weighted unoccluded fraction of each patch's hemisphere, float32 on the device.

    reach: distance of occluders that count, texels
    """
    compute, count = rays.compute, rays.count
    (kernel,) = rays.rays.kernels((RECEIVER, "near_openness.cl"), "near_openness")
    found = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * count)
    rays.rays.run(kernel, count, rays.receivers, np.float32(reach), found, np.int32(count))
    return found


def backs_met(rays: RayScene) -> np.ndarray:
    """Return the cosine-weighted fraction of each patch's probe rays that hit back faces, (n,) float32."""
    compute, count = rays.compute, rays.count
    (kernel,) = rays.rays.kernels((RECEIVER, "near_openness.cl"), "backs_met")
    found = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * count)
    rays.rays.run(kernel, count, rays.receivers, found, np.int32(count))
    return download(compute, found, (count,))
