"""Contacts: patches covered by a touching face, back-to-back faces, and patches lit by back faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download_bytes, upload, words_of
from ..device.opencl import cl
from ..validity.shader_probes import contact_codes, lit_by_back_faces
from ..validity.thresholds import KERNEL_OPTIONS, SOURCE
from ..visibility.rays.ray_scene import RayScene

#: Ends of the test ray above and below the surface, as multiples of the height of ray origins.
ABOVE, BELOW = 2.0, 1.0

#: Maximum number of emissive triangles for the early exit of the kernel: no back face of an emissive triangle
#: is visible from a patch in front of the planes of all of them.
_PLANES = 64

#: Distance by which the planes lie in front of their triangles, as a fraction of the largest coordinate.
_BEFORE = 1e-4


@dataclass(frozen=True)
class Contacts:
    """Effects of nearby faces on patches, (n,) bool each.

    covered:       True if a touching face covers the patch
    back_to_back:  True if a coincident face points the other way and both are open, as walls of adjacent
                   rooms
    backlit:       True if rays of the patch hit the back of an emissive surface, as on a ceiling above a
                   hanging panel: most rays hit back faces, but the patch is lit
    """

    covered: np.ndarray
    back_to_back: np.ndarray
    backlit: np.ndarray

    def subset(self, chosen: np.ndarray) -> Contacts:
        """Return the contacts of some patches, by mask or indices."""
        return Contacts(self.covered[chosen], self.back_to_back[chosen], self.backlit[chosen])


def find_contacts(scene: RayScene, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of patches covered by a touching face, and of patches back to back, (n,) bool each.

    A covered patch is not visible, and its rays would start beyond the other face. Back-to-back patches are
    visible, since both faces are open to their side.
    """
    if scene.shaders is not None:
        found = contact_codes(scene.shaders, ABOVE, BELOW)
        return found == 1, found == 2
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels(SOURCE, "in_contact", options=KERNEL_OPTIONS)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    limits = (np.float32(ABOVE), np.float32(BELOW))
    rays.run(kernel, count, scene.receivers, *limits, output, np.int32(count))
    found = download_bytes(compute, output, count)
    return found == 1, found == 2


def patches_lit_by_backs(
    scene: RayScene, count: int, shines: np.ndarray, positions: np.ndarray
) -> np.ndarray:
    """Find patches whose rays hit mostly back faces, one of them emissive; return a mask, (n,) bool.

    shines:     (t,) bool, True for emissive triangles
    positions:  (t, 3, 3) float, corners of the triangles, metres, relative to `Triangles.origin`
    """
    if scene.shaders is not None:
        return lit_by_back_faces(scene.shaders, shines, _planes_in_front(positions[shines]))
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels(SOURCE, "lit_by_backfaces", options=KERNEL_OPTIONS)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    shining, planes = upload(compute, shines.astype(np.uint8)), _planes_in_front(positions[shines])
    planes_buffer = upload(compute, planes if len(planes) else np.zeros((1, 4), np.float32))
    rays.run(
        kernel, count, scene.receivers, shining, planes_buffer, np.int32(len(planes)), output, np.int32(count)
    )
    return download_bytes(compute, output, count).view(bool)


def _planes_in_front(corners: np.ndarray) -> np.ndarray:
    """Return planes slightly in front of triangles, (k, 4) float32, or none for more than _PLANES triangles.

    Each plane is a unit normal and a distance from the origin, metres. From a point in front of all planes,
    no back face of the triangles is visible. corners: (k, 3, 3) float, metres.
    """
    if len(corners) > _PLANES:
        return np.zeros((0, 4), np.float32)
    first, second, third = corners.astype(np.float64).transpose(1, 0, 2)
    normal = np.cross(second - first, third - first)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    before = _BEFORE * np.abs(corners).max(initial=0.0)
    distance = np.einsum("kd,kd->k", normal, first) + before
    return np.concatenate([normal, distance[:, None]], axis=1).astype(np.float32)
