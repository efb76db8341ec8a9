"""The devices of a Dask scheduler's workers: a task for each block of patches, where the block is."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import dask
import numpy as np
from distributed import Client, Future, wait
from distributed.client import ClosedClientError
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from ..errors import DeviceError
from ..finish.display_samples import DisplaySamples
from ..gather.half_light import HalfLight
from ..plan.choice import Choice
from ..plan.lit_samples import LitSamples
from ..plan.memory import shared_width
from ..settings import Settings
from . import block, final_tasks, shadow_tasks
from .blocks import cut
from .prepared_scene import prepare
from .shipment import Shipment, Squares
from .sweep_memory import SweepMemory

#: A bake that waits for workers can be cancelled this often, s.
_PAUSE = 0.2

#: It ends with an error once there have been none for this time, s.
_PATIENCE = 20.0

#: Points of texels in a task, at least: fewer take as long.
_FEWEST_POINTS = 2048

#: Dask warns of tasks with large arguments; here the scheduler shall keep them, to repeat the tasks.
_LARGE_GRAPH = "distributed.admin.large-graph-warning-threshold"

Span = tuple[int, int]


@dataclass(frozen=True)
class Shipped:
    """A scene on its way to workers.

    shipment  a task whose result workers fetch from each other
    ready     of each worker a task that makes the patches
    """

    shipment: Future
    ready: list[Future]


def ship(client: Client, shipment: Shipment) -> Shipped:
    """Send a scene to all workers, which make its patches.

    The shipment is the argument of a task, so that the scheduler can give it to a worker again.
    """
    sent = _submit(client, _given, shipment)
    workers = client.scheduler_info(n_workers=-1)["workers"]
    ready = [
        client.submit(prepare, sent, workers=[address], allow_other_workers=True, pure=False)
        for address in workers
    ]
    return Shipped(sent, ready)


class ClusterDevices:
    """See `RemoteDevices`: the workers that are there, or join, work for the patches of a scene.

    A worker that is lost takes its blocks along; Dask has others find these anew, with the same bits.
    """

    def __init__(self, client: Client, shipped: Shipped, settings: Settings, folder: str, count: int) -> None:
        """Take the number of patches, and a folder in the memory of all workers; empty if there is none."""
        self._client, self._shipped, self._folder = client, shipped, folder
        self._settings, self._count, self._patches = settings, count, cut(count)
        self._memories: list[SweepMemory] = []
        self._workers = set[str]()
        self._address: str = client.scheduler_info()["address"]
        self._squares: Future | None = None
        self._blocks: dict[Span, Future] = {}

    def describe(self) -> str:
        """Return a sentence for the report: how many workers there are, and where to watch them."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        return (
            f"{len(workers)} Dask workers find what patches see and gather for them; "
            f"dashboard: {self._client.dashboard_link}."
        )

    def sampled(self) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return the light that shadow rays sample, and its L1; see `Casting.sampled`."""
        tasks = self._tasks_of_patches(shadow_tasks.sampled)

        # Those that are done find what patches see meanwhile. Squares are made of the light first.
        if shared_width(self._settings, self._count) == 1:
            self._find(self._count)
        light = yield from self._rows(tasks)
        return np.ascontiguousarray(light[:, :3]), light[:, 3:].reshape(-1, 3, 3)

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return how much of a lamp patches see; see `Casting.shadow_mask`."""
        return (yield from self._of_patches(shadow_tasks.shadow_mask, lamp))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return how open patches are; see `Casting.ambient_occlusion`."""
        return (yield from self._of_patches(shadow_tasks.ambient_occlusion))

    def views(self, count: int) -> Generator[float, None, np.ndarray]:
        """Return how much patches see of patches and backs; see `RemoteGather.views`."""
        if not self._blocks:
            self._find(count)
        return (yield from self._of_blocks(block.views))

    def gather(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather once; see `RemoteGather.gather`. The rows are overwritten by the next time but one."""
        memory = self._sweep_memory(len(light.parts))
        if memory is None:
            return (yield from self._of_blocks(block.gather, self._sent(light)))
        sent = self._sent(memory.put(light))
        tasks = {
            self._task(block.gather_to, found, sent, memory.path): span
            for span, found in self._blocks.items()
        }
        yield from self._take(tasks, lambda *_: None)
        return memory.rows

    def gather_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `RemoteGather.gather_l1`."""
        return (yield from self._of_blocks(block.gather_l1, self._sent(light)))

    def of_groups(self, leader: np.ndarray, width: int) -> None:
        """Let the workers solve groups of patches; see `RemoteGather.of_groups`."""
        self._squares = self._sent(Squares.of(leader, width))
        self._find(int(np.count_nonzero(leader == np.arange(len(leader), dtype=leader.dtype))))

    def final(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather for every patch; see `RemoteGather.final`."""
        self._blocks = {}
        return (yield from self._of_patches(final_tasks.final, self._squares, self._sent(light)))

    def final_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1 for every patch; see `RemoteGather.final_l1`."""
        return (yield from self._of_patches(final_tasks.final_l1, self._squares, self._sent(light)))

    def light_at(
        self, samples: DisplaySamples, light: HalfLight, choice: Choice, settings: Settings
    ) -> Generator[float, None, list[LitSamples]]:
        """Return the light at points of texels; see `RemoteDevices.light_at`."""
        self._blocks = {}
        seen, tasks = (self._squares, self._sent(light)), {}
        for first, last in cut(len(samples), _FEWEST_POINTS):
            part = samples.part(slice(first, last))
            task = self._task(
                final_tasks.light_at_samples, self._shipped.shipment, part, *seen, choice, settings
            )
            tasks[task] = first, last
        lit: dict[Span, LitSamples] = {}
        yield from self._take(tasks, lit.__setitem__)
        return [lit[span] for span in tasks.values()]

    def _sweep_memory(self, count: int) -> SweepMemory | None:
        """Return the memory for a sweep of `count` patches; None where light travels through Dask.

        Sweeps take turns with two of them: once a worker is lost, others may repeat tasks of the last sweep.
        It may itself still write: those that are left get other memory.
        """
        if not self._folder:
            return None
        with _losses_told(self._address):
            workers = set(self._client.scheduler_info(n_workers=-1)["workers"])
        if not self._memories or workers != self._workers:
            for memory in self._memories:
                memory.close()
            try:
                self._memories = [SweepMemory(self._folder, count) for _ in range(2)]
            except OSError:
                self._memories, self._folder = [], ""
                return None
            self._workers = workers
        self._memories.reverse()
        return self._memories[0]

    def _find(self, count: int) -> None:
        """Have what `count` patches, or groups of them, see found, by tasks that any worker can do again."""
        shipment, squares = self._shipped.shipment, self._squares
        self._blocks = {span: self._task(block.find, shipment, *span, squares) for span in cut(count)}

    def _sent(self, value: object) -> Future:
        """Return a value as the result of a task, which workers fetch from each other."""
        return self._task(_given, value)

    def _task(self, function: Callable, *arguments: object) -> Future:
        with _losses_told(self._address):
            return _submit(self._client, function, *arguments)

    def _of_patches(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block of patches, on any worker; return the rows of all patches."""
        return (yield from self._rows(self._tasks_of_patches(function, *arguments)))

    def _tasks_of_patches(self, function: Callable, *arguments: object) -> dict[Future, Span]:
        """Begin a task for each block of patches, on any worker."""
        shipment = self._shipped.shipment
        return {self._task(function, shipment, *span, *arguments): span for span in self._patches}

    def _of_blocks(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block whose views are found, where it is; return the rows of all."""
        blocks = self._blocks.items()
        return (
            yield from self._rows({self._task(function, found, *arguments): span for span, found in blocks})
        )

    def _rows(self, tasks: dict[Future, Span]) -> Generator[float, None, np.ndarray]:
        """Return the rows that tasks make, one after another; yield the fraction done."""
        count = max(last for _, last in tasks.values())
        rows: list[np.ndarray] = []

        def put(span: Span, part: np.ndarray) -> None:
            if not rows:
                rows.append(np.empty((count, *part.shape[1:]), part.dtype))
            rows[0][slice(*span)] = part

        yield from self._take(tasks, put)
        return rows[0]

    def _take(
        self, tasks: dict[Future, Span], put: Callable[[Span, Any], None]
    ) -> Generator[float, None, None]:
        """Put away the result of each task as it ends, with its span; yield the fraction done.

        Raises DeviceError without workers.
        """
        left, lost = set(tasks), 0.0
        while left:
            with _losses_told(self._address):
                ended, left = self._ended(left)
                results = self._client.gather(ended, direct=True)
                lost = 0.0 if ended or self._has_workers() else lost + _PAUSE
            if lost > _PATIENCE:
                raise DeviceError(
                    f"The scheduler at {self._address} has had no workers for {_PATIENCE:.0f} s. "
                    "Start some with tools/worker.py, then bake again."
                )
            for task, result in zip(ended, results, strict=True):
                put(tasks[task], result)
            yield 1 - len(left) / len(tasks)

    def _ended(self, tasks: set[Future]) -> tuple[list[Future], set[Future]]:
        """Wait a moment for any task to end; return those that have, and the others."""
        try:
            ended, left = wait(tasks, timeout=_PAUSE, return_when="FIRST_COMPLETED")
        except TimeoutError:
            return [], tasks
        return list(ended), left

    def _has_workers(self) -> bool:
        """Return whether any worker is there; raises OSError if the scheduler is gone."""
        if self._client.status == "connecting":
            return False
        if self._client.status != "running":
            raise OSError("the connection is lost")
        return bool(self._client.scheduler_info(n_workers=1)["workers"])


def _submit(client: Client, function: Callable, *arguments: object) -> Future:
    """Have a worker do a task; the same one submitted again is another task."""
    with dask.config.set({_LARGE_GRAPH: "1 PiB"}):
        return client.submit(function, *arguments, pure=False)


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
    except (ClosedClientError, CommClosedError, CancelledError, TimeoutError, OSError) as error:
        why = "the connection was lost" if isinstance(error, CancelledError) else error
        raise DeviceError(
            f"The Dask scheduler at {address} cannot be reached any more ({why}). Start it again, "
            "then bake again."
        ) from error
