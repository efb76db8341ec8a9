"""Finds patches that a face touches and hides, as a floor a pillar's underside, or that a back lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from ..device.buffers import upload
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receivers import RECEIVER_SOURCE

#: How far above and below its surface a patch looks for the other face, in heights of its eye.
ABOVE, BELOW = 2.0, 1.0


@dataclass(frozen=True)
class NearFaces:
    """What faces nearby do to patches, (n,) bool each.

    hide   a face that touches the patch hides it
    shine  the patch sees the back of a surface that shines, as a ceiling that of a panel hung below it: it
           sees little else, but is lit
    """

    hide: np.ndarray
    shine: np.ndarray


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


def patches_lit_by_backs(scene: RayScene, count: int, shines: np.ndarray) -> np.ndarray:
    """Return which of the patches that see little but backs see that of a triangle that shines, (n,) bool.

    shines: (t,) bool, of every triangle.
    """
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels((*RECEIVER_SOURCE, "looks.cl", "lit_by_backs.cl"), "lit_by_backs")
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, count)
    shining = upload(compute, shines.astype(np.uint8))
    rays.run(kernel, count, scene.receivers, shining, output, np.int32(count))
    lit = np.empty(count, np.uint8)
    cl.enqueue_copy(compute.queue, lit, output)
    return lit.astype(bool)
