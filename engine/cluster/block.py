"""Block of patches on a worker, with its visibility samples in device memory."""

from __future__ import annotations

import pickle
import time
from functools import cached_property

import numpy as np
from dask.config import get
from dask.utils import parse_bytes
from distributed.config import config

from ..device.buffers import download
from ..device.device_array import rows_of
from ..device.opencl import cl
from ..gather.gather_pass import GatherPass
from ..gather.half_radiance import HalfRadiance
from ..plan.choose_gather import caching_gather
from ..plan.visibility_trial import make_sampler, untried_visibility
from ..progress import finished
from ..scene.color import colors_of
from .patch_rows import SentRows, unpacked
from .patch_table import PatchTable
from .prepared_scene import prepared
from .radiance_exchange import MappedRadiance, write_rows
from .scene_payload import ScenePayload

#: Bandwidth in bytes per second that Dask assumes when it estimates the time to move data.
_BANDWIDTH = parse_bytes(get("distributed.scheduler.bandwidth", config=config))

#: Number of pending blocks of a worker up to which Dask should not move another of its blocks.
_WAITING = 8


#: Size reported for a block without samples, bytes.
_LEAST = 1 << 10


class Block:
    """Patches or patch groups of a scene, with their visibility samples.

    The samples stay on the device and are not transferred. On another worker they are computed again by the
    first task that needs them, because only tasks can read files of another machine.
    """

    def __init__(self, shipment: ScenePayload, table: PatchTable, rows: SentRows) -> None:
        self._made_of, self._bytes = (shipment, table, rows), _LEAST

    @cached_property
    def found(self) -> BlockVisibility:
        """Visibility samples of the patches, computed on first access."""
        began, found = time.perf_counter(), BlockVisibility(*self._made_of)

        # Dask moves a block if the transfer takes less time than waiting for its worker. A transfer means
        # computing the samples again, so the block reports a size that makes waiting cheaper.
        self._bytes = max(found.bytes, int(_WAITING * _BANDWIDTH * (time.perf_counter() - began)))
        return found

    def __reduce__(self) -> tuple:
        return Block, self._made_of

    def __sizeof__(self) -> int:
        return self._bytes


def find(shipment: ScenePayload, table: PatchTable, rows: SentRows) -> Block:
    """Create a block and compute its visibility; gather tasks depend on this task."""
    block = Block(shipment, table, rows)
    _ = block.found
    return block


def views(block: Block) -> np.ndarray:
    """Return fractions of each patch's hemisphere, (m, 2): without back faces, and covered by patches."""
    return block.found.views


def gather(block: Block, light: HalfRadiance | MappedRadiance) -> np.ndarray:
    """Gather for a block from the radiance `light`; return E/pi, (m, 3) float32."""
    return block.found.gather(light)


def gather_to(block: Block, light: bytes, path: str) -> None:
    """Gather for a block into the file of a `RadianceExchange`, within one machine.

    light: `portable_bytes` of a MappedRadiance, passed with the task, which is faster than a task of its own
    """
    block.found.gather_to(pickle.loads(light), path)


def gather_l1(block: Block, light: HalfRadiance | MappedRadiance) -> np.ndarray:
    """Return the irradiance gradients (L1) of a block, (m, 3, 3) float32."""
    return block.found.gather_l1(light)


class BlockVisibility:
    """Patches or patch groups of a block, which gather from all sources.

    views:  (m, 2) float32, see `RemoteDevices.views`
    bytes:  device memory of the samples
    """

    def __init__(self, shipment: ScenePayload, table: PatchTable, rows: SentRows) -> None:
        self._first, self._sources = unpacked(rows).first, prepared(shipment).sources(table)
        with self._sources.working():
            receivers_job = self._sources.part(rows)
            sampler = make_sampler(receivers_job, untried_visibility(receivers_job.settings))
            self.bytes = sampler.row_bytes * receivers_job.count
            sweep, compute = caching_gather(receivers_job, sampler), receivers_job.opencl
            self._gather = GatherPass(compute, sweep, np.zeros((receivers_job.count, 3), np.float32))

            # The block owns the samples, so they are removed from the job's session cache.
            receivers_job.kept.clear()

            # The first gather computes the visibility.
            gathered = self._gathered(self._sources.darkness)
            seen = download(compute, self._gather.patches_seen, (receivers_job.count,))
            self.views = np.stack([gathered[:, 3], seen], axis=1)

    def gather(self, light: HalfRadiance | MappedRadiance) -> np.ndarray:
        """Gather from the radiance of all sources; return E/pi, (m, 3) float32."""
        with self._sources.working():
            return colors_of(self._gathered(self._sources.table(light)))

    def gather_to(self, light: MappedRadiance, path: str) -> None:
        """Gather from the radiance of all sources and write E/pi into the file of a `RadianceExchange`."""
        write_rows(path, self._first, self.gather(light), light.count)

    def gather_l1(self, light: HalfRadiance | MappedRadiance) -> np.ndarray:
        """Return the irradiance gradients (L1) for the same radiance, (m, 3, 3) float32."""
        with self._sources.working():
            self._gathered(self._sources.table(light))
            return np.asarray(finished(self._gather.gather_l1()))

    def _gathered(self, radiance: cl.Buffer) -> np.ndarray:
        return rows_of(finished(self._gather.gather_from(radiance)))
