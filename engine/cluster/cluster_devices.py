"""The devices of a Dask scheduler's workers: a task for each block of patches, where the block is."""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np
from distributed import Future

from ..finish.display_samples import DisplaySamples
from ..gather.half_light import HalfLight
from ..plan.choice import Choice
from ..plan.lit_samples import LitSamples
from ..plan.memory import shared_width
from ..settings import Settings
from . import block, final_tasks, shadow_tasks
from .blocks import Span, cut
from .shipment import Squares
from .shipped import Shipped
from .sweep_memories import SweepMemories
from .tasks import Tasks

#: Points of texels in a task, at least: fewer take as long.
_FEWEST_POINTS = 2048


class ClusterDevices:
    """See `RemoteDevices`: the workers that are there, or join, work for the patches of a scene.

    A worker that is lost takes its blocks along; Dask has others find these anew, with the same bits.
    """

    def __init__(self, tasks: Tasks, shipped: Shipped, settings: Settings, folder: str, count: int) -> None:
        """Take the number of patches, and a folder in the memory of all workers; empty if there is none."""
        self._tasks, self._shipped, self._memories = tasks, shipped, SweepMemories(folder)
        self._settings, self._count, self._patches = settings, count, cut(count)
        self._squares: Future | None = None
        self._blocks: dict[Span, Future] = {}

    def describe(self) -> str:
        """Return a sentence for the report: how many workers there are, and where to watch them."""
        return (
            f"{len(self._tasks.workers())} Dask workers find what patches see and gather for them; "
            f"dashboard: {self._tasks.dashboard}."
        )

    def sampled(self) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return the light that shadow rays sample, and its L1; see `Casting.sampled`."""
        tasks = self._tasks_of_patches(shadow_tasks.sampled)

        # Those that are done find what patches see meanwhile. Squares are made of the light first.
        if shared_width(self._settings, self._count) == 1:
            self._find(self._count)
        light = yield from self._tasks.rows(tasks)
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
        memory = self._memories.next(len(light.parts), self._tasks.workers())
        if memory is None:
            return (yield from self._of_blocks(block.gather, self._tasks.sent(light)))
        sent = self._tasks.sent(memory.put(light))
        tasks = {
            self._tasks.begin(block.gather_to, found, sent, memory.path): span
            for span, found in self._blocks.items()
        }
        yield from self._tasks.take(tasks, lambda *_: None)
        return memory.rows

    def gather_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `RemoteGather.gather_l1`."""
        return (yield from self._of_blocks(block.gather_l1, self._tasks.sent(light)))

    def of_groups(self, leader: np.ndarray, width: int) -> None:
        """Let the workers solve groups of patches; see `RemoteGather.of_groups`."""
        self._squares = self._tasks.sent(Squares.of(leader, width))
        self._find(int(np.count_nonzero(leader == np.arange(len(leader), dtype=leader.dtype))))

    def final(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather for every patch; see `RemoteGather.final`."""
        self._blocks = {}
        return (yield from self._of_patches(final_tasks.final, self._squares, self._tasks.sent(light)))

    def final_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1 for every patch; see `RemoteGather.final_l1`."""
        return (yield from self._of_patches(final_tasks.final_l1, self._squares, self._tasks.sent(light)))

    def light_at(
        self, samples: DisplaySamples, light: HalfLight, choice: Choice, settings: Settings
    ) -> Generator[float, None, list[LitSamples]]:
        """Return the light at points of texels; see `RemoteDevices.light_at`."""
        self._blocks = {}
        seen, tasks = (self._squares, self._tasks.sent(light)), {}
        for first, last in cut(len(samples), _FEWEST_POINTS):
            part = samples.part(slice(first, last))
            task = self._tasks.begin(
                final_tasks.light_at_samples, self._shipped.shipment, part, *seen, choice, settings
            )
            tasks[task] = first, last
        lit: dict[Span, LitSamples] = {}
        yield from self._tasks.take(tasks, lit.__setitem__)
        return [lit[span] for span in tasks.values()]

    def _find(self, count: int) -> None:
        """Have what `count` patches, or groups of them, see found, by tasks that any worker can do again."""
        scene, squares = self._shipped.shipment, self._squares
        self._blocks = {span: self._tasks.begin(block.find, scene, *span, squares) for span in cut(count)}

    def _of_patches(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block of patches, on any worker; return the rows of all patches."""
        return (yield from self._tasks.rows(self._tasks_of_patches(function, *arguments)))

    def _tasks_of_patches(self, function: Callable, *arguments: object) -> dict[Future, Span]:
        """Begin a task for each block of patches, on any worker."""
        scene = self._shipped.shipment
        return {self._tasks.begin(function, scene, *span, *arguments): span for span in self._patches}

    def _of_blocks(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block whose views are found, where it is; return the rows of all."""
        tasks = {self._tasks.begin(function, found, *arguments): span for span, found in self._blocks.items()}
        return (yield from self._tasks.rows(tasks))
