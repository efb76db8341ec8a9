"""A block of patches on a worker: what they see is found once and stays in the memory of its device."""

from __future__ import annotations

import pickle
import time
from functools import cached_property

import numpy as np
from dask.config import get
from dask.utils import parse_bytes
from distributed.config import config

from ..gather.half_radiance import HalfRadiance
from .block_visibility import BlockVisibility
from .patch_rows import SentRows
from .patch_table import PatchTable
from .radiance_exchange import MappedRadiance
from .scene_payload import ScenePayload

#: Bytes that Dask expects to travel in a second.
_BANDWIDTH = parse_bytes(get("distributed.scheduler.bandwidth", config=config))

#: Blocks that a worker still has to find for which Dask shall not move another block of it.
_WAITING = 8


#: What is told of a block of which nothing is found yet, bytes.
_LEAST = 1 << 10


class Block:
    """Some patches of a scene, or groups of them, and what they see.

    Sent to another worker, this is found anew by the first task that needs it there: it is on the device and
    does not travel, and tasks alone read files of another machine.
    """

    def __init__(self, shipment: ScenePayload, table: PatchTable, rows: SentRows) -> None:
        self._made_of, self._bytes = (shipment, table, rows), _LEAST

    @cached_property
    def found(self) -> BlockVisibility:
        """What the patches see; found when it is first asked for."""
        began, found = time.perf_counter(), BlockVisibility(*self._made_of)

        # Dask weighs sending bytes against waiting for who has them. Here sending is finding anew elsewhere,
        # and waiting is better.
        self._bytes = max(found.bytes, int(_WAITING * _BANDWIDTH * (time.perf_counter() - began)))
        return found

    def __reduce__(self) -> tuple:
        return Block, self._made_of

    def __sizeof__(self) -> int:
        return self._bytes


def find(shipment: ScenePayload, table: PatchTable, rows: SentRows) -> Block:
    """Find what a block of patches sees: the task that those of sweeps depend on."""
    block = Block(shipment, table, rows)
    _ = block.found
    return block


def views(block: Block) -> np.ndarray:
    """Return how much a block's patches see of patches and backs."""
    return block.found.views


def gather(block: Block, light: HalfRadiance | MappedRadiance) -> np.ndarray:
    """Gather for a block: a task of a sweep, which runs where the block is."""
    return block.found.gather(light)


def gather_to(block: Block, light: bytes, path: str) -> None:
    """Gather for a block to the file of a `RadianceExchange`, as a task of a sweep within a machine.

    light: a MappedRadiance's `portable_bytes`, which come with the task: another one for it would take longer
    """
    block.found.gather_to(pickle.loads(light), path)


def gather_l1(block: Block, light: HalfRadiance | MappedRadiance) -> np.ndarray:
    """Gather the L1 of light for a block."""
    return block.found.gather_l1(light)
