"""Ray tracing setup of a bake: triangles and receivers of patches, created on first use."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from functools import cached_property, partial

import numpy as np

from ...device.cl_device import ComputeDevice
from ...device.gl_context import GraphicsContext
from ...device.opencl import cl
from ...errors import DeviceError
from ...patches.patch_scene import PatchScene
from ...scene.cutouts import Cutouts
from ...scene.triangles import Triangles
from .bvh import Bvh
from .early_hits import EarlyHits
from .ray_tracer import SOURCE, RayTracer
from .receiver_records import RECEIVER, pack_receivers
from .shaders.shader_scene import ShaderScene
from .shaders.shader_tracer import ShaderTracer
from .upper_levels import UpperLevels


def make_tracer(
    graphics: GraphicsContext, compute: ComputeDevice | None, triangles: Triangles, cutouts: Cutouts
) -> RayTracer | ShaderTracer:
    """Return the ray tracer of triangles by OpenCL, or by compute shaders without it."""
    if compute is None:
        return ShaderTracer(graphics, triangles, cutouts)
    return RayTracer(compute, triangles, cutouts)


class RayScene:
    """Triangles and patches of a bake on the OpenCL device.

    peers:   other devices that share the work of the patches; empty for one device
    shared:  True once `peers` have received work
    early:   hits of the samples of patches that `peers` trace ahead; None for none
    """

    peers: Sequence[ComputeDevice] = ()
    shared: bool = False
    early: EarlyHits | None = None

    def __init__(
        self,
        compute: ComputeDevice | None,
        patch_scene: PatchScene,
        before: UpperLevels | None = None,
        shaders: ShaderScene | None = None,
        bvh: Bvh | None = None,
    ) -> None:
        """Store triangles and patches.

        before: `Bvh.top` of the same triangles at earlier positions; shaders: the same triangles and patches
        for compute shaders, where there is no OpenCL; bvh: of the triangles, if it exists
        """
        self._compute, self._patch_scene, self._before, self.shaders = compute, patch_scene, before, shaders
        self._bvh = bvh
        self._twins: dict[ComputeDevice, Future[RayScene]] = {}
        self._whole: RayScene | None = None

    @property
    def compute(self) -> ComputeDevice:
        """The OpenCL device; raises DeviceError if there is none."""
        if self._compute is None:
            raise DeviceError("Rays need OpenCL.")
        return self._compute

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self._patch_scene.patches)

    @property
    def on_backs(self) -> np.ndarray:
        """Patches of back faces, (n,) bool."""
        on_backs: np.ndarray = self._patch_scene.geometry.triangle >= self._patch_scene.triangles.solid
        return on_backs

    @property
    def possible(self) -> bool:
        """True if there is an OpenCL device, so that rays can be traced."""
        return self._compute is not None

    def share_with(self, peers: Sequence[ComputeDevice]) -> None:
        """Set the other devices of a bake, which have no work yet; threads prepare their scenes."""
        self.peers, self.shared = peers, False
        for peer in peers:
            self._prepare(peer)

    def on(self, peer: ComputeDevice) -> RayScene:
        """Return `twin` for work of the bake."""
        self.shared = bool(self.peers)
        return self.twin(peer)

    def twin(self, peer: ComputeDevice) -> RayScene:
        """Return a scene of the same triangles and patches on another device, created on first use."""
        return self._prepare(peer).result()

    def _prepare(self, peer: ComputeDevice) -> Future[RayScene]:
        """Let the thread of another device create its scene, unless it exists."""
        if peer not in self._twins:
            self._twins[peer] = peer.thread.submit(partial(self._make_twin, peer))
        return self._twins[peer]

    def _make_twin(self, peer: ComputeDevice) -> RayScene:
        """Return a scene of the same triangles and patches on another device, with its receivers."""
        whole = self._whole and self._whole.twin(peer)
        twin = whole.of(self._patch_scene) if whole else RayScene(peer, self._patch_scene)
        twin.receivers  # noqa: B018 - the device needs BVH and receivers first
        return twin

    def of(self, patch_scene: PatchScene) -> RayScene:
        """Return a scene of the same triangles with other patches, for one device."""
        if self.shaders is not None:
            return RayScene(None, patch_scene, shaders=self.shaders.of(patch_scene))
        other = RayScene(self._compute, patch_scene)
        other.rays = self.rays
        return other

    def shared_by(self, patch_scene: PatchScene) -> RayScene:
        """Return a scene of the same triangles with other patches, which the same devices share."""
        other = self.of(patch_scene)
        other._whole = self
        other.share_with(self.peers)
        return other

    @property
    def caster(self) -> RayTracer | ShaderTracer:
        """Tracer of single rays, on either device."""
        return self.rays if self.shaders is None else self.shaders.tracer

    @cached_property
    def rays(self) -> RayTracer:
        """The triangles and their BVH."""
        return RayTracer(
            self.compute, self._patch_scene.triangles, self._patch_scene.cutouts, self._before, self._bvh
        )

    @property
    def top(self) -> UpperLevels | None:
        """Upper levels of the BVH if it was built, else None; see `RayTracer`."""
        return self.rays.bvh.top if "rays" in vars(self) else None

    @cached_property
    def receivers(self) -> cl.Buffer:
        """Records of all patches on the device, see `receiver_records.pack_receivers`.

        Ray offsets are limited, so that no origin lies beyond another face.
        """
        pack, place = self.rays.kernels(SOURCE, "pack_receivers", "find_ray_offsets")
        records = pack_receivers(self.compute, pack, self._patch_scene.patches, self._patch_scene.geometry)
        self.rays.run(place, self.count, records, np.int32(self.count))
        return records


def openness(rays: RayScene, reach: float) -> cl.Buffer:
    """Return the cosine-weighted unoccluded fraction of each patch's hemisphere, float32 on the device.

    reach: distance of occluders that count, texels
    """
    compute, count = rays.compute, rays.count
    (kernel,) = rays.rays.kernels((RECEIVER, "near_openness.cl"), "near_openness")
    found = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * count)
    rays.rays.run(kernel, count, rays.receivers, np.float32(reach), found, np.int32(count))
    return found
