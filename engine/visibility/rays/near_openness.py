"""Short-range openness of patches, which stops interpolation next to nearby geometry."""

from __future__ import annotations

import numpy as np

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
