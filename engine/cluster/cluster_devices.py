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
from ..portable import portable_bytes
from ..scene.color import colors_of
from ..settings import Settings
from . import block, final_tasks, shadow_tasks
from .blocks import Span, cut
from .shipped import Shipped
from .squares import Squares
from .sweep_memories import SweepMemories
from .tasks import EARLY, Tasks

#: Columns of light without directions.
_COLORS = 3

#: Points of texels in a task, at least: fewer take as long.
_FEWEST_POINTS = 2048


class ClusterDevices:
    """See `RemoteDevices`: the workers that are there, or join, work for the patches of a scene.

    A worker that is lost takes its blocks along; Dask has others find these anew, with the same bits.
    """

    def __init__(self, tasks: Tasks, shipped: Shipped, settings: Settings, folder: str, count: int) -> None:
        """Take the number of patches, and a folder in the memory of all workers; empty if there is none."""
        self._tasks, self._shipped, self._folder = tasks, shipped, folder
        self._memories = SweepMemories(folder)
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
        yield 0.0
        light = yield from self._tasks.rows(tasks)
        if light.shape[1] == _COLORS:
            return light, np.zeros((0, 3, 3), np.float32)
        return colors_of(light), light[:, _COLORS:].reshape(-1, 3, 3)

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return how much of a lamp patches see; see `Casting.shadow_mask`."""
        return (yield from self._of_patches(shadow_tasks.shadow_mask, lamp))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return how open patches are; see `Casting.ambient_occlusion`."""
        return (yield from self._of_patches(shadow_tasks.ambient_occlusion))

    def views(self, count: int) -> Generator[float, None, np.ndarray]:
        """Return how much patches see of patches and backs; see `RemoteGather.views`."""
        self._find_once(count)
        return (yield from self._of_blocks(block.views))

    def gather(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather once; see `RemoteGather.gather`. The rows are overwritten by the next time but one."""
        self._find_once(len(light.parts))
        memory = self._memories.next(len(light.parts), self._tasks.workers())
        if memory is None:
            return (yield from self._of_blocks(block.gather, self._light_sent(light)))
        mapped, blocks = portable_bytes(memory.put(light)), self._blocks.values()
        yield from self._tasks.finish(
            self._tasks.begin(block.gather_to, [(found, mapped, memory.path) for found in blocks])
        )
        return memory.rows

    def gather_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `RemoteGather.gather_l1`."""
        return (yield from self._of_blocks(block.gather_l1, self._light_sent(light)))

    def of_groups(self, leader: np.ndarray, width: int) -> None:
        """Let the workers solve groups of patches; see `RemoteGather.of_groups`."""
        self._squares = self._tasks.sent(Squares.of(leader, width, self._folder), "squares")
        self._find(int(np.count_nonzero(leader == np.arange(len(leader), dtype=leader.dtype))))

    def final(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather for every patch; see `RemoteGather.final`."""
        self._blocks = {}
        return (yield from self._of_patches(final_tasks.final, self._squares, self._light_sent(light)))

    def final_l1(self, light: HalfLight) -> Generator[float, None, np.ndarray]:
        """Gather L1 for every patch; see `RemoteGather.final_l1`."""
        return (yield from self._of_patches(final_tasks.final_l1, self._squares, self._light_sent(light)))

    def light_at(
        self, samples: DisplaySamples, light: HalfLight, choice: Choice, settings: Settings
    ) -> Generator[float, None, list[LitSamples]]:
        """Return the light at points of texels; see `RemoteDevices.light_at`."""
        self._blocks = {}
        scene, spans = self._shipped.shipment, cut(len(samples), _FEWEST_POINTS)
        how, seen = self._tasks.sent((choice, settings), "how"), (self._squares, self._light_sent(light))
        parts = [self._tasks.sent(samples.part(slice(*span)), "samples") for span in spans]
        tasks = [(scene, part, *seen, how) for part in parts]
        begun = self._tasks.begin(final_tasks.light_at_samples, tasks)
        lit: dict[Span, LitSamples] = {}
        yield from self._tasks.take(dict(zip(begun, spans, strict=True)), lit.__setitem__)
        return [lit[span] for span in spans]

    def _light_sent(self, light: HalfLight) -> Future:
        """Return light as the result of a task."""
        return self._tasks.sent(light, "light")

    def _find_once(self, count: int) -> None:
        """Have what patches, or groups of them, see found unless that has begun."""
        if not self._blocks:
            self._find(count)

    def _find(self, count: int) -> None:
        """Have what `count` patches, or groups of them, see found, by tasks that any worker can do again."""
        scene, squares, spans = self._shipped.shipment, self._squares, cut(count)
        found = self._tasks.begin(block.find, [(scene, *span, squares) for span in spans], EARLY)
        self._blocks = dict(zip(spans, found, strict=True))

    def _of_patches(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block of patches, on any worker; return the rows of all patches."""
        return (yield from self._tasks.rows(self._tasks_of_patches(function, *arguments)))

    def _tasks_of_patches(self, function: Callable, *arguments: object) -> dict[Future, Span]:
        """Begin a task for each block of patches, on any worker."""
        scene = self._shipped.shipment
        begun = self._tasks.begin(function, [(scene, *span, *arguments) for span in self._patches])
        return dict(zip(begun, self._patches, strict=True))

    def _of_blocks(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Do a task for each block whose views are found, where it is; return the rows of all."""
        begun = self._tasks.begin(function, [(found, *arguments) for found in self._blocks.values()])
        return (yield from self._tasks.rows(dict(zip(begun, self._blocks, strict=True))))
