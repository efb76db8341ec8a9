"""A block of patches on a worker: what they see is found once and stays in the memory of its device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..gather.final_gather import FinalGather
from ..plan.choose import keeping_sweep
from ..plan.kept import Kept
from ..plan.trial import make_identity
from ..progress import finished
from .prepared_scene import prepared
from .shipment import Shipment


class Block:
    """The patches first ... last of a scene, which gather from all of them.

    Sent to another worker it is found anew there: what patches see is on the device and does not travel.
    """

    def __init__(self, shipment: Shipment, first: int, last: int) -> None:
        self._made_of = shipment, first, last
        scene = prepared(shipment)
        scene.devices.graphics.use()
        job, part = scene.job, slice(first, last)
        parts = replace(
            job.parts, patches=job.parts.patches.part(part), geometry=job.parts.geometry.part(part)
        )
        lookers = replace(job, parts=parts, rays=job.rays.of(parts), kept=Kept())
        visibility = "raster" if job.settings.visibility == "raster" else "rays"
        identity = make_identity(lookers, visibility)
        self._scene, self._bytes = scene, identity.row_bytes * (last - first)
        sweep = keeping_sweep(lookers, identity)
        self._gather = FinalGather(job.opencl, sweep, np.zeros((last - first, 3), np.float32))

        # The first gather finds what is seen.
        self.gather(np.zeros((job.count, 3), np.float32))

    def gather(self, radiance: np.ndarray) -> np.ndarray:
        """Gather from radiance of all patches, (n, 3) float32; return (last - first, 4), see `Gather`."""
        with self._scene.devices.failures_told():
            return finished(self._gather.gather_from(self._scene.table(radiance)))

    def __reduce__(self) -> tuple:
        return find, self._made_of

    def __sizeof__(self) -> int:
        return self._bytes


def find(shipment: Shipment, first: int, last: int) -> Block:
    """Find what a block of patches sees: the task that a sweep's tasks depend on."""
    return Block(shipment, first, last)


def gather(block: Block, radiance: np.ndarray) -> np.ndarray:
    """Gather for a block: a task of a sweep, which runs where the block is."""
    return block.gather(radiance)
