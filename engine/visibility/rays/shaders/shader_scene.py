"""Triangles and patches of a bake for rays of compute shaders."""

from __future__ import annotations

from functools import cached_property

import moderngl

from ....device.gl_context import GraphicsContext
from ....patches.patch_scene import PatchScene
from ..receiver_records import RECEIVER
from .host_bvh import HostBvh
from .host_receivers import receivers_on_host
from .shader_tables import storage_buffer
from .shader_tracer import RECORDS, ShaderTracer


class ShaderScene:
    """Triangles and patches of a bake on the OpenGL device; the counterpart of `RayScene`."""

    def __init__(
        self, graphics: GraphicsContext, patch_scene: PatchScene, bvh: HostBvh | None = None
    ) -> None:
        """Upload triangles and patches; bvh: BVH of the triangles, None to build it."""
        self.graphics, self._patch_scene, self._bvh = graphics, patch_scene, bvh

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self._patch_scene.patches)

    def of(self, patch_scene: PatchScene) -> ShaderScene:
        """Return a scene of the same triangles with other patches."""
        other = ShaderScene(self.graphics, patch_scene)
        other.tracer = self.tracer
        return other

    @cached_property
    def tracer(self) -> ShaderTracer:
        """The triangles and their BVH."""
        return ShaderTracer(self.graphics, self._patch_scene.triangles, self._patch_scene.cutouts, self._bvh)

    @cached_property
    def receivers(self) -> moderngl.Buffer:
        """Receiver records of all patches, with ray origins on this side of all other faces."""
        records = receivers_on_host(self._patch_scene.patches, self._patch_scene.geometry)
        buffer = storage_buffer(self.graphics, records)
        run = self.tracer.run("ray_offsets", self.count, {RECORDS: buffer}, {}, records=(RECEIVER,))
        for _ in run:
            pass
        return buffer
