"""Sweeps by devices of other processes: radiance leaves this one's device, and light comes back to it."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np
import pyopencl as cl

from ..device.buffers import download, upload, zeros
from ..device.compute import Compute
from ..visibility.identity import identity_options
from .sweep import Light


class RemoteGather(Protocol):
    """Devices of other processes that hold what n patches see.

    All arrays are float32 in host memory; generators yield the fraction done.
    """

    def views(self, count: int) -> Generator[float, None, np.ndarray]:
        """Return the fractions of each patch's view that no back takes, and that patches take, (count, 2).

        The patches are all, or the groups that `of_groups` names.
        """
        ...

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return E/pi of all that patches see of radiance (n, 3) of the patches, (n, 3)."""
        ...

    def gather_l1(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return the L1 of the same light, (n, 3, 3); see `Sweep.gather_l1`."""
        ...

    def of_groups(self, leader: np.ndarray, width: int) -> None:
        """Let the devices solve groups of the patches; see `solve.patch_groups.PatchGroups`."""
        ...

    def final(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return what every patch gathers once from radiance (m, 3) of groups, (n, 4).

        That is E/pi, and the fraction of the view that no back takes.
        """
        ...

    def final_l1(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return the L1 of the same light, (n, 3, 3)."""
        ...


class RemoteSweep:
    """Gathers on remote devices for light that this device holds; see `sweep.Sweep`."""

    def __init__(self, compute: Compute, remote: RemoteGather, count: int) -> None:
        self._compute, self._remote, self._count = compute, remote, count
        files = ("hemicube.cl", "tilt.cl", "identity.cl", "gather.cl")
        (self._take,) = compute.kernels(files, "take", options=identity_options(4))
        self._gathered: np.ndarray | None = None
        self._patches_seen = zeros(compute, 4 * count)

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`. The first time waits for what patches see to be found."""
        if self._gathered is None:
            self._gathered = yield from self._begin()
        table = download(self._compute, light.radiance, (self._count + 2, 4))
        self._radiance = np.ascontiguousarray(table[1:-1, :3])
        self._gathered[:, :3] = yield from self._remote.gather(self._radiance)
        cl.enqueue_copy(self._compute.queue, light.patches_seen, self._patches_seen)
        gathered = upload(self._compute, self._gathered)
        self._compute.run(self._take, light.count, gathered, *light.outputs(column))

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `sweep.Sweep.gather_l1`."""
        return (yield from self._remote.gather_l1(self._radiance))

    def _begin(self) -> Generator[float, None, np.ndarray]:
        """Find what patches see; return (n, 4) float32: nothing, and the fraction that is no back."""
        views = yield from self._remote.views(self._count)
        self._patches_seen = upload(self._compute, views[:, 1])
        gathered = np.zeros((self._count, 4), np.float32)
        gathered[:, 3] = views[:, 0]
        return gathered


class RemoteFinal:
    """One more gather by every patch, from groups of them; see `final_gather.LightGather`."""

    def __init__(self, remote: RemoteGather, sampled_light: np.ndarray) -> None:
        self._remote, self._sampled_light = remote, sampled_light

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather; see `LightGather.gather`."""
        self._radiance = radiance
        gathered = yield from self._remote.final(radiance)
        gathered[:, :3] += self._sampled_light
        return gathered

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `LightGather.gather_l1`."""
        return (yield from self._remote.final_l1(self._radiance))
