"""Invalid points: which patches lie inside geometry."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..device.buffers import download_bytes, words_of
from ..device.opencl import cl
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER
from .thresholds import DOUBTFUL, INVALID, KERNEL_OPTIONS


class Contacts(Protocol):
    """What touching faces do to points, (n,) bool each; see `direct.contact.Contacts`."""

    @property
    def hide(self) -> np.ndarray:
        """Points that a face covers."""
        ...

    @property
    def shine(self) -> np.ndarray:
        """Points that an emissive back face lights."""
        ...


def is_invalid(front: np.ndarray, near: Contacts) -> np.ndarray:
    """Return which points are invalid, (n,) bool: covered by a face, or inside geometry.

    front: (n,) float32, fraction of each point's view that is no back face
    """
    hidden: np.ndarray = near.hide | ((front < 1 - INVALID) & ~near.shine)
    return hidden


def is_doubtful(front: np.ndarray) -> np.ndarray:
    """Return which patches may be invalid, (n,) bool, so that probes decide; front as of `is_invalid`."""
    doubtful: np.ndarray = front < 1 - DOUBTFUL
    return doubtful


def patches_inside(scene: RayScene, count: int) -> np.ndarray:
    """Return which patches are inside of something, (n,) bool: most of their probes meet back faces."""
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels((RECEIVER, "inside_test.cl"), "is_inside", options=KERNEL_OPTIONS)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    rays.run(kernel, count, scene.receivers, output, np.int32(count))
    return download_bytes(compute, output, count).view(bool)
