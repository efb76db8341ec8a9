"""Finds patches that a face touches and hides, as a floor a pillar's foot, that a back lights, or inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download_bytes, upload, words_of
from ..device.opencl import cl
from ..validity.thresholds import KERNEL_OPTIONS
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER

#: How far above and below its surface a patch looks for the other face, in heights of its eye.
ABOVE, BELOW = 2.0, 1.0

#: Planes of triangles that shine, of which a patch is asked whether it is behind one, at most.
_PLANES = 64

#: How far in front of a triangle a point is surely not behind it, as a fraction of the largest coordinate.
_BEFORE = 1e-4


@dataclass(frozen=True)
class Contacts:
    """What faces nearby do to patches, (n,) bool each.

    hide          a face that touches the patch hides it
    back_to_back  a face lies on the patch and looks apart, as the wall of another room that shares its plane
    shine         the patch sees the back of a surface that shines, as a ceiling that of a panel hung below
                  it: it sees little else, but is lit
    """

    hide: np.ndarray
    back_to_back: np.ndarray
    shine: np.ndarray

    def part(self, chosen: np.ndarray) -> Contacts:
        """Return what they do to some patches, by a mask or their numbers."""
        return Contacts(self.hide[chosen], self.back_to_back[chosen], self.shine[chosen])


def find_contacts(scene: RayScene, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return which patches lie in the plane of another face that shows them its back, (n,) bool twice.

    The first are hidden: nobody sees such a patch, but its hemicube starts beyond the other face and sees
    what is there. The second are seen: both faces look into the open, apart from each other.
    """
    rays, compute = scene.rays, scene.compute
    codes = tuple(f"-D{name}={code}" for code, name in enumerate(("NONE", "HIDDEN", "BACK_TO_BACK")))
    (kernel,) = rays.kernels((RECEIVER, "contacts.cl"), "in_contact", options=(*KERNEL_OPTIONS, *codes))
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    limits = (np.float32(ABOVE), np.float32(BELOW))
    rays.run(kernel, count, scene.receivers, *limits, output, np.int32(count))
    found = download_bytes(compute, output, count)
    return found == 1, found == 2


def patches_lit_by_backs(
    scene: RayScene, count: int, shines: np.ndarray, positions: np.ndarray
) -> np.ndarray:
    """Return which of the patches that see little but backs see that of a triangle that shines, (n,) bool.

    shines     (t,) bool, of every triangle
    positions  (t, 3, 3) float, of their corners, metres, relative to `Triangles.origin`
    """
    rays, compute = scene.rays, scene.compute
    (kernel,) = rays.kernels((RECEIVER, "lit_by_backs.cl"), "lit_by_backfaces", options=KERNEL_OPTIONS)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, words_of(count))
    shining, planes = upload(compute, shines.astype(np.uint8)), _planes_in_front(positions[shines])
    planes_buffer = upload(compute, planes if len(planes) else np.zeros((1, 4), np.float32))
    rays.run(
        kernel, count, scene.receivers, shining, planes_buffer, np.int32(len(planes)), output, np.int32(count)
    )
    return download_bytes(compute, output, count).view(bool)


def _planes_in_front(corners: np.ndarray) -> np.ndarray:
    """Return planes a little before those of triangles, (k, 4) float32; none, if these are many.

    A unit normal and the distance from the origin each, metres. A point that is in front of all planes sees
    no back of the triangles, corners (k, 3, 3) float, metres.
    """
    if len(corners) > _PLANES:
        return np.zeros((0, 4), np.float32)
    first, second, third = corners.astype(np.float64).transpose(1, 0, 2)
    normal = np.cross(second - first, third - first)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    before = _BEFORE * np.abs(corners).max(initial=0.0)
    distance = np.einsum("kd,kd->k", normal, first) + before
    return np.concatenate([normal, distance[:, None]], axis=1).astype(np.float32)
