"""Test for invalid points: patches inside geometry or covered by a face."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..device.buffers import download_bytes, words_of
from ..device.opencl import cl
from ..visibility.rays.ray_scene import RayScene
from .thresholds import (
    DOUBTFUL,
    INVALID,
    KERNEL_OPTIONS,
    MAX_BACKS_INTERPOLATED,
    MAX_BACKS_OPEN,
    PROBES,
    SOURCE,
)


class Contacts(Protocol):
    """Contacts of points, (n,) bool each; see `direct.contact.Contacts`."""

    @property
    def covered(self) -> np.ndarray:
        """Points that a face covers."""
        ...

    @property
    def backlit(self) -> np.ndarray:
        """Points that an emissive back face lights."""
        ...


def is_invalid(validity: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Return a mask of invalid points, (n,) bool: covered by a face, or inside geometry.

    validity:  (n,) float32, fraction of the hemisphere without back faces
    contacts:  contacts of the points
    """
    # "Greater" of flags is "and not", without an array for "not".
    invalid: np.ndarray = validity < 1 - INVALID
    np.greater(invalid, contacts.backlit, out=invalid)
    invalid |= contacts.covered
    return invalid


def is_doubtful(validity: np.ndarray) -> np.ndarray:
    """Return a mask of points that may be invalid, (n,) bool, for which probe rays decide.

    validity:  (n,) float32
    """
    doubtful: np.ndarray = validity < 1 - DOUBTFUL
    return doubtful


def patches_inside(scene: RayScene, count: int) -> np.ndarray:
    """Return a mask of the patches inside geometry, (n,) bool: most of their probe rays hit back faces."""
    return _back_facing(scene, count, MAX_BACKS_OPEN)


def patches_near_backs(scene: RayScene, count: int) -> np.ndarray:
    """Return a mask of the patches next to back faces, (n,) bool: light is not interpolated to them."""
    return _back_facing(scene, count, int(MAX_BACKS_INTERPOLATED * PROBES))


def _back_facing(scene: RayScene, count: int, most: int) -> np.ndarray:
    """Return a mask of the patches with more than `most` probe rays that hit back faces, (n,) bool."""
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels(SOURCE, "hits_many_backfaces", options=KERNEL_OPTIONS)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    rays.run(kernel, count, scene.receivers, np.int32(most), output, np.int32(count))
    return download_bytes(compute, output, count).view(bool)
