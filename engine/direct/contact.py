"""Finds patches that a face touches and hides, as a floor does the underside of a pillar on it."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receivers import RECEIVER_SOURCE

#: How far above and below its surface a patch looks for the other face, in heights of its eye.
ABOVE, BELOW = 2.0, 1.0


def patches_in_contact(scene: RayScene, count: int) -> np.ndarray:
    """Return which patches, (n,) bool, lie in the plane of another face that shows them its back.

    Nobody sees such a patch, but its hemicube starts beyond the other face and sees what is there.
    """
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels((*RECEIVER_SOURCE, "contact.cl"), "in_contact")
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, count)
    limits = (np.float32(ABOVE), np.float32(BELOW))
    rays.run(kernel, count, scene.receivers, *limits, output, np.int32(count))
    in_contact = np.empty(count, np.uint8)
    cl.enqueue_copy(compute.queue, in_contact, output)
    return in_contact.astype(bool)
