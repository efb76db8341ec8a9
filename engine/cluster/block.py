"""A block of patches on a worker: what they see is found once and stays in the memory of its device."""

from __future__ import annotations

import pickle
import time

import numpy as np
import pyopencl as cl
from dask.config import get
from dask.utils import parse_bytes
from distributed.config import config

from ..device.buffers import download
from ..gather.final_gather import FinalGather
from ..gather.half_light import HalfLight
from ..plan.choose_sweep import keeping_sweep
from ..plan.trial import make_identity, untried_visibility
from ..progress import finished
from ..scene.color import colors_of
from .prepared_scene import prepared
from .shipment import Shipment
from .squares import Squares
from .sweep_memory import MappedLight, write_rows

#: Bytes that Dask expects to travel in a second.
_BANDWIDTH = parse_bytes(get("distributed.scheduler.bandwidth", config=config))

#: Blocks that a worker still has to find for which Dask shall not move another block of it.
_WAITING = 8


class Block:
    """The patches first ... last of a scene, or groups of them, which gather from all of them.

    Sent to another worker it is found anew there: what patches see is on the device and does not travel.

    views  (last - first, 2) float32, see `RemoteDevices.views`
    """

    def __init__(self, shipment: Shipment, first: int, last: int, squares: Squares | None) -> None:
        self._made_of, self._first = (shipment, first, last, squares), first
        self._sources = prepared(shipment).sources(squares)
        began = time.perf_counter()
        with self._sources.working():
            lookers = self._sources.part(first, last)
            identity = make_identity(lookers, untried_visibility(lookers.settings))
            kept = identity.row_bytes * lookers.count
            sweep, compute = keeping_sweep(lookers, identity), lookers.opencl
            self._gather = FinalGather(compute, sweep, np.zeros((lookers.count, 3), np.float32))

            # The samples go with the block, not with the job that they were found for.
            lookers.kept.clear()

            # The first gather finds what is seen.
            gathered = self._gathered(self._sources.darkness)
            seen = download(compute, self._gather.patches_seen, (lookers.count,))
            self.views = np.stack([gathered[:, 3], seen], axis=1)

        # Dask weighs sending bytes against waiting for who has them. Here sending is finding anew elsewhere,
        # and waiting is better.
        self._bytes = max(kept, int(_WAITING * _BANDWIDTH * (time.perf_counter() - began)))

    def gather(self, light: HalfLight | MappedLight) -> np.ndarray:
        """Gather from the light of all patches; return E/pi, (last - first, 3) float32."""
        with self._sources.working():
            return colors_of(self._gathered(self._sources.table(light)))

    def gather_to(self, light: MappedLight, path: str) -> None:
        """Gather as `gather` does, to the file of a `SweepMemory`."""
        write_rows(path, self._first, self.gather(light), light.count)

    def gather_l1(self, light: HalfLight | MappedLight) -> np.ndarray:
        """Return the L1 of the same light, (last - first, 3, 3) float32."""
        with self._sources.working():
            self._gathered(self._sources.table(light))
            return np.asarray(finished(self._gather.gather_l1()))

    def _gathered(self, radiance: cl.Buffer) -> np.ndarray:
        return finished(self._gather.gather_from(radiance))

    def __reduce__(self) -> tuple:
        return find, self._made_of

    def __sizeof__(self) -> int:
        return self._bytes


def find(shipment: Shipment, first: int, last: int, squares: Squares | None) -> Block:
    """Find what a block of patches sees: the task that those of sweeps depend on."""
    return Block(shipment, first, last, squares)


def views(block: Block) -> np.ndarray:
    """Return how much a block's patches see of patches and backs."""
    return block.views


def gather(block: Block, light: HalfLight | MappedLight) -> np.ndarray:
    """Gather for a block: a task of a sweep, which runs where the block is."""
    return block.gather(light)


def gather_to(block: Block, light: bytes, path: str) -> None:
    """Gather for a block to the file of a `SweepMemory`, as a task of a sweep within a machine.

    light: a MappedLight's `portable_bytes`, which come with the task: another one for it would take longer
    """
    block.gather_to(pickle.loads(light), path)


def gather_l1(block: Block, light: HalfLight | MappedLight) -> np.ndarray:
    """Gather the L1 of light for a block."""
    return block.gather_l1(light)
