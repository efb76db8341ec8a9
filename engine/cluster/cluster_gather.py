"""Gathers with the workers of a Dask scheduler: a task for each block and sweep, where the block is."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager

import dask
import numpy as np
from distributed import Client, Future, wait
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from ..errors import DeviceError
from .block import find, gather
from .blocks import cut
from .shipment import Shipment

#: Seconds after which a bake that waits may be cancelled, and those that it waits while there are no workers.
_PAUSE, _PATIENCE = 0.2, 20.0


#: Dask warns of tasks with large arguments; here the scheduler shall keep them, to repeat the tasks.
_LARGE_GRAPH = "distributed.admin.large-graph-warning-threshold"


class ClusterGather:
    """See `hemicube_gather.Gather`: all patches of a shipment's scene gather from radiance in host memory.

    A worker that is lost takes its blocks along; Dask has others find these anew, with the same bits.
    """

    def __init__(self, client: Client, shipment: Shipment) -> None:
        self._client, self._digest = client, shipment.digest
        self._address: str = client.scheduler_info()["address"]

        # The shipment is the argument of a task, so that the scheduler can give it to a worker again.
        self._shipment = client.submit(_given, shipment, key=f"shipment-{shipment.digest}")
        self._blocks: dict[tuple[int, int], Future] = {}

    def describe(self) -> str:
        """Return a sentence for the report: how many workers there are, and where to watch them."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        return (
            f"Blocks of patches are found and gathered for by {len(workers)} Dask workers; "
            f"dashboard: {self._client.dashboard_link}."
        )

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `Gather.iteration`. The first iteration also waits for what blocks see."""
        count, done = len(radiance), 0
        gathered = np.empty((count, 4), np.float32)
        with _losses_told(self._address):
            self._blocks = self._blocks or {span: self._block(*span) for span in cut(count)}
            with dask.config.set({_LARGE_GRAPH: "1 PiB"}):
                table = self._client.submit(_given, radiance, pure=False)
            tasks = {
                self._client.submit(gather, block, table, pure=False): span
                for span, block in self._blocks.items()
            }
            for task in self._as_they_end(set(tasks)):
                if task is not None:
                    first, last = tasks[task]
                    gathered[first:last] = task.result()
                    done += last - first
                yield done / count
        return gathered

    def _as_they_end(self, tasks: set[Future]) -> Iterator[Future | None]:
        """Yield each task that has ended, and None while none does; raises DeviceError without workers."""
        lost = 0.0
        while tasks:
            try:
                ended, tasks = wait(tasks, timeout=_PAUSE, return_when="FIRST_COMPLETED")
                yield from ended
            except TimeoutError:
                lost = 0.0 if self._client.scheduler_info(n_workers=1)["workers"] else lost + _PAUSE
                if lost > _PATIENCE:
                    raise DeviceError(
                        f"The scheduler at {self._address} has had no workers for {_PATIENCE:.0f} s. "
                        "Start some with tools/worker.py, then bake again."
                    ) from None
                yield None

    def _block(self, first: int, last: int) -> Future:
        """Have what a block of patches sees found, by a task that any worker can do again."""
        key = f"block-{self._digest}-{first}-{last}"
        return self._client.submit(find, self._shipment, first, last, key=key)


def _given(value: object) -> object:
    """Return what is given: a task whose result workers fetch from each other."""
    return value


@contextmanager
def _losses_told(address: str) -> Iterator[None]:
    """Turn into a DeviceError that the scheduler is gone, or that a block ends every worker that takes it."""
    try:
        yield
    except KilledWorker as error:
        raise DeviceError(
            f"Workers died again and again while they found what a block of patches sees ({error}). "
            "Their logs tell why; less memory is needed with Patch Groups or fewer samples."
        ) from error
    except (CommClosedError, TimeoutError, OSError) as error:
        raise DeviceError(
            f"The Dask scheduler at {address} cannot be reached any more ({error}). Start it again, "
            "then bake again."
        ) from error
