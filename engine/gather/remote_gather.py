"""Gathers on devices of other processes: sends radiance from this device and receives irradiance."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..device.buffers import upload, upload_float4
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..scene.color import add_colors
from ..visibility.sampler import identity_options
from .half_radiance import HalfRadiance
from .interface import GatherBuffers


class RemoteGather(Protocol):
    """Devices of other processes that hold the visibility samples of n patches.

    All arrays are float32 in host memory; generators yield progress 0..1.
    """

    def views(self) -> Generator[float, None, np.ndarray]:
        """Return fractions of each patch's hemisphere, (n, 2): without back faces, and covered by patches.

        The rows are patches, or the patch groups of `of_groups`.
        """
        ...

    def gather(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Gather from the radiance `light`; return E/pi, (n, 3), valid until the next call."""
        ...

    def gather_l1(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) for radiance `light`, (n, 3, 3)."""
        ...

    def of_groups(self, representative: np.ndarray, texel_to_group: np.ndarray, emission: np.ndarray) -> None:
        """Switch the devices to patch groups, and start to compute the visibility of the groups.

        representative:  (m,) int64, the representative patch of each group
        texel_to_group:  (atlases, r, r) uint32, group + 1 of each texel's patch, or 0
        emission:        (m, 3) float32, emitted radiance of each group
        """
        ...

    def final(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the final gather of every patch from the radiance of groups, (n, 4).

        rgb is E/pi; a is the fraction of the hemisphere without back faces.
        """
        ...

    def final_l1(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) of the final gather, (n, 3, 3)."""
        ...


class RemoteIteration:
    """Iteration on remote devices for a solver on this device."""

    def __init__(self, compute: ComputeDevice, remote: RemoteGather, count: int) -> None:
        self._compute, self._remote, self._count = compute, remote, count
        options = (*identity_options(4), "-DLIGHT_GROUPS=1")
        (self._take,) = compute.kernels("gather.cl", "store_gathered", options=options)
        (self._join,) = compute.kernels("half_radiance.cl", "join_half")
        self._gathered = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count)
        self._views: list[cl.Buffer] = []

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance into a column of the ring of iterates; yield progress 0..1.

        The first call waits until the remote devices have computed visibility.
        """
        self._light = HalfRadiance.of(self._compute, light.radiance, self._count)
        work = self._remote.gather(self._light)
        if not self._views:
            # Start the gather first: a device whose visibility is complete gathers while others still trace.
            next(work)
            views = yield from self._remote.views()
            self._views = [upload(self._compute, fraction) for fraction in views.T]
        front, patches_seen = self._views
        gathered = upload(self._compute, (yield from work))
        self._compute.run(self._join, self._count, gathered, front, self._gathered, np.int32(self._count))
        self._compute.run(self._take, self._count, self._gathered, *light.outputs(column))
        cl.enqueue_copy(self._compute.queue, light.patches_seen, patches_seen)

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        return (yield from self._remote.gather_l1(self._light))


class RemoteGatherPass:
    """Final gather by remote devices, from the radiance of patch groups."""

    def __init__(
        self, compute: ComputeDevice, remote: RemoteGather, sampled_light: np.ndarray, groups: int
    ) -> None:
        self._compute, self._remote, self._groups = compute, remote, groups
        self._sampled_light = sampled_light

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance in host memory, (m, 3) float32; return E/pi and validity, (n, 4) float32."""
        return (yield from self.gather_from(upload_float4(self._compute, radiance, first=1, last=1)))

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, np.ndarray]:
        """Gather from radiance on this device, float4 by source + 1; return E/pi and validity, (n, 4)."""
        self._light = HalfRadiance.of(self._compute, radiance, self._groups)
        gathered = yield from self._remote.final(self._light)
        add_colors(gathered, self._sampled_light)
        return gathered

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) of the last gather, (n, 3, 3) float32."""
        return (yield from self._remote.final_l1(self._light))
