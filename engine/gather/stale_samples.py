"""Stale visibility samples: detects cached samples that moved geometry may have changed."""

from __future__ import annotations

import numpy as np

from ..device.buffers import zeros
from ..device.opencl import cl
from ..patches.moved_triangles import ball_around, moved_triangles
from ..patches.patch_scene import PatchScene
from ..visibility.rays.ray_sampler import MovedBuffers
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER

#: Number of moved triangles beyond the scene's own at which recomputing all visibility is faster (chosen).
_MORE = 1 << 13

#: Degenerate triangle that no ray hits, because a BVH needs at least one triangle.
_NOTHING = np.zeros((1, 3, 3), np.float32)


class StaleSamples:
    """Difference between the patches for which samples were cached and the current patches.

    patch_scene, rays:  current patches and rays
    triangles:          (k, 3, 3) float32, m from `Triangles.origin`: moved triangles at old and new positions
    buffers:            the same on the device
    begun:              True once some samples are updated; from then on the cache matches neither state
    """

    def __init__(
        self,
        patch_scene: PatchScene,
        rays: RayScene,
        triangles: np.ndarray,
        buffers: MovedBuffers,
        begun: bool,
    ) -> None:
        self.patch_scene, self.rays, self.triangles, self.buffers = patch_scene, rays, triangles, buffers
        self.begun = begun

    @classmethod
    def between(
        cls,
        before: tuple[PatchScene, cl.Buffer],
        patch_scene: PatchScene,
        rays: RayScene,
        begun: StaleSamples | None,
    ) -> StaleSamples | None:
        """Compare two versions of a scene; return the stale samples, or None if most would be stale.

        before:  patches for which samples were cached, and their receivers
        begun:   an earlier difference, for which some samples are updated already
        """
        triangles = moved_triangles(before[0], patch_scene)
        if triangles is None:
            return None
        if begun is not None:
            triangles = np.concatenate([triangles, begun.triangles])
        if len(triangles) > len(patch_scene.triangles.mesh) + _MORE:
            return None
        if not len(triangles):
            triangles = _NOTHING
        hierarchy = rays.rays.hierarchy_of(triangles)
        if hierarchy is None:
            return None
        views = _moved_views(rays, before[1], None if begun is None else begun.buffers.views)
        return cls(
            patch_scene,
            rays,
            triangles,
            MovedBuffers(*hierarchy, cl.cltypes.make_float4(*ball_around(triangles)), views),
            begun is not None,
        )


def _moved_views(rays: RayScene, before: cl.Buffer, marked: cl.Buffer | None) -> cl.Buffer:
    """Return marks of patches whose receiver records changed, added to earlier marks."""
    compute, count = rays.compute, rays.count
    views = zeros(compute, -(-count // 4) * 4)
    if marked is not None:
        cl.enqueue_copy(compute.queue, views, marked)
    (mark,) = compute.kernels((RECEIVER, "stale_viewpoints.cl"), "mark_stale_views")
    compute.run(mark, count, before, rays.receivers, views, np.int32(count))
    return views
