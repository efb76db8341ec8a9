"""What has moved since it was found what patches see: which samples may meet something else."""

from __future__ import annotations

import numpy as np

from ..device.buffers import zeros
from ..device.opencl import cl
from ..patches.moved_triangles import ball_around, moved_triangles
from ..patches.patch_scene import PatchScene
from ..visibility.rays.ray_sampler import MovedBuffers
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER

#: More triangles than a scene has, by this number, and looking anew is quicker.
_MORE = 1 << 13

#: A triangle that no ray meets: a hierarchy has at least one.
_NOTHING = np.zeros((1, 3, 3), np.float32)


class StaleSamples:
    """The difference between patches as they were when samples were found, and as they are.

    parts, rays  as they are
    triangles    (k, 3, 3) float32, metres from `Triangles.origin`: what has moved, as it was and as it is
    buffers      the same for kernels
    begun        True once some samples were found again: from then on they are of neither state
    """

    def __init__(
        self, parts: PatchScene, rays: RayScene, triangles: np.ndarray, buffers: MovedBuffers, begun: bool
    ) -> None:
        self.parts, self.rays, self.triangles, self.buffers = parts, rays, triangles, buffers
        self.begun = begun

    @classmethod
    def between(
        cls,
        before: tuple[PatchScene, cl.Buffer],
        parts: PatchScene,
        rays: RayScene,
        begun: StaleSamples | None,
    ) -> StaleSamples | None:
        """Return what has moved; None if looking anew is better.

        before  the patches when samples were found, and their receivers
        begun   a difference to others, for which some samples were found again meanwhile
        """
        triangles = moved_triangles(before[0], parts)
        if triangles is None:
            return None
        if begun is not None:
            triangles = np.concatenate([triangles, begun.triangles])
        if len(triangles) > len(parts.triangles.mesh) + _MORE:
            return None
        if not len(triangles):
            triangles = _NOTHING
        hierarchy = rays.rays.hierarchy_of(triangles)
        if hierarchy is None:
            return None
        views = _moved_views(rays, before[1], None if begun is None else begun.buffers.views)
        return cls(
            parts,
            rays,
            triangles,
            MovedBuffers(*hierarchy, cl.cltypes.make_float4(*ball_around(triangles)), views),
            begun is not None,
        )


def _moved_views(rays: RayScene, before: cl.Buffer, marked: cl.Buffer | None) -> cl.Buffer:
    """Return marks of patches whose receivers are others than before, and of those that are marked."""
    compute, count = rays.compute, rays.count
    views = zeros(compute, -(-count // 4) * 4)
    if marked is not None:
        cl.enqueue_copy(compute.queue, views, marked)
    (mark,) = compute.kernels((RECEIVER, "stale_viewpoints.cl"), "mark_stale_views")
    compute.run(mark, count, before, rays.receivers, views, np.int32(count))
    return views
