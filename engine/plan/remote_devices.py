"""Protocol of devices in other processes: all work for each patch or texel sample."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Protocol

import numpy as np

from ..direct.shadow_rays import ShadowCaster
from ..gather.half_radiance import HalfRadiance
from ..gather.remote_gather import RemoteGather
from ..numpy_pickle import NumpyPickle
from ..postprocess.texel_samples import TexelSamples
from ..settings import Settings
from .gathered_samples import GatheredSamples
from .solver_choice import SolverChoice

#: Values of consecutive probes, `probes.probe_blocks.ProbePart`.
ProbeValues = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class RemoteDevices(ShadowCaster, RemoteGather, Protocol):
    """Devices of other processes, such as `cluster.cluster_devices.ClusterDevices`."""

    def describe(self) -> str:
        """Return a report sentence that describes the devices."""

    def gather_at(
        self, samples: TexelSamples, light: HalfRadiance, choice: SolverChoice, settings: Settings
    ) -> Generator[float, None, list[GatheredSamples]]:
        """Gather light at texel samples on devices of other processes, from the light of all patches."""
        ...

    def probes(
        self,
        light: NumpyPickle,
        volume: int,
        count: int,
        choice: SolverChoice,
        find: Callable[[int, int], ProbeValues | None],
        add: Callable[[int, int, ProbeValues], None],
    ) -> Generator[float, None, list[ProbeValues]]:
        """Gather light at the probes of a volume; return the values of consecutive probes in order.

        light:   light of all patches, `probes.sent_light.SentRadiance`
        volume:  index into `Scene.probe_volumes`
        count:   number of its probes
        find:    returns the values of a block that is not gathered, from its first probe and its end, or None
        add:     called with first probe, end, and values of each finished block
        """
        ...
