"""Choice of bakes that several GPUs of one machine share."""

from __future__ import annotations

from collections.abc import Sequence

from ..device.cl_device import ComputeDevice
from ..settings import Settings
from ..visibility.sample_counts import ray_count

#: Minimum number of rays from all patches: the other devices need about 0.2 s to prepare, in which an H100
#: traces this number (measured).
_FEWEST_RAYS = 1 << 31


def sharing_devices(
    peers: Sequence[ComputeDevice], settings: Settings, patches: int
) -> tuple[Sequence[ComputeDevice], tuple[str, ...]]:
    """Return the other devices that share a bake, none for a small one, and a sentence for the report.

    peers:  other devices that the settings allow
    """
    if not peers or settings.warm_start:
        return (), ()
    rays = patches * ray_count(settings)
    if rays < _FEWEST_RAYS:
        return (), (
            f"One device baked: {rays:,} rays are too few to share; the minimum is {_FEWEST_RAYS:,}.",
        )
    return peers, (f"{1 + len(peers)} devices traced rays and gathered light.",)
