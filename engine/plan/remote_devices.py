"""What devices of other processes do in a bake: all that is done for each patch, or point of a texel."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

from ..direct.shadow_rays import ShadowCaster
from ..gather.half_radiance import HalfRadiance
from ..gather.remote_gather import RemoteGather
from ..postprocess.texel_samples import TexelSamples
from ..settings import Settings
from .gathered_samples import GatheredSamples
from .solver_choice import SolverChoice


class RemoteDevices(ShadowCaster, RemoteGather, Protocol):
    """Devices of other processes, such as `cluster.cluster_devices.ClusterDevices`."""

    def describe(self) -> str:
        """Return a sentence for the report: who works."""

    def gather_at(
        self, samples: TexelSamples, light: HalfRadiance, choice: SolverChoice, settings: Settings
    ) -> Generator[float, None, list[GatheredSamples]]:
        """Return what points of texels gather from the light of all; see `texel_sample_gather.gather_at`."""
        ...
