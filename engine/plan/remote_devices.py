"""What devices of other processes do in a bake: all that is done for each patch, or point of a texel."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

from ..direct.shadow_rays import Casting
from ..gather.half_radiance import HalfLight
from ..gather.remote_gather import RemoteGather
from ..postprocess.texel_samples import DisplaySamples
from ..settings import Settings
from .gathered_samples import LitSamples
from .solver_choice import Choice


class RemoteDevices(Casting, RemoteGather, Protocol):
    """Devices of other processes, such as `cluster.cluster_devices.ClusterDevices`."""

    def describe(self) -> str:
        """Return a sentence for the report: who works."""

    def light_at(
        self, samples: DisplaySamples, light: HalfLight, choice: Choice, settings: Settings
    ) -> Generator[float, None, list[LitSamples]]:
        """Return what points of texels gather from the light of all; see `texel_sample_gather.light_at`."""
        ...
