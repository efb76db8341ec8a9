"""Devices of Dask workers: one task per block of patches, on the worker that holds the block."""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np
from distributed import Future

from ..direct.contact import find_contacts
from ..direct.emitters import SampledTriangles
from ..gather.half_radiance import HalfRadiance
from ..numpy_pickle import NumpyPickle, portable_bytes
from ..patches.patch_list import PatchList
from ..patches.patch_scene import PatchScene
from ..plan.gathered_samples import GatheredSamples
from ..plan.memory import shared_width
from ..plan.solver_choice import SolverChoice
from ..plan.visibility_trial import untried_visibility
from ..postprocess.texel_samples import TexelSamples
from ..probes.probe_blocks import ProbePart
from ..scene.color import colors_of
from ..settings import ALL_DEVICES, Settings
from ..visibility.rays.ray_scene import RayScene
from . import block, final_tasks, probe_tasks, shadow_tasks
from .blocks import Span, cut
from .distributed_scene import DistributedScene
from .patch_rows import PatchRows
from .patch_table import PatchTable, SceneTable, SparseRadiance
from .radiance_exchange import RadianceExchangePair
from .tasks import EARLY, Tasks

#: Columns of light without L1.
_COLORS = 3

#: Minimum number of texel samples per task; a task with fewer takes the same time.
_FEWEST_POINTS = 2048

#: Minimum number of light probes per task, each with hundreds of rays (chosen).
_FEWEST_PROBES = 64


class ClusterDevices:
    """`RemoteDevices` of Dask workers, including workers that join during the bake.

    If a worker is lost, Dask computes its blocks again on other workers, with the same bits.
    """

    def __init__(
        self,
        tasks: Tasks,
        shipped: DistributedScene,
        settings: Settings,
        folder: str,
        patch_scene: PatchScene,
        rays: RayScene,
        bright: SampledTriangles,
    ) -> None:
        """Send the patches of a scene to the workers.

        folder:  folder in the shared memory of all workers; empty if there is none
        rays:    rays from the patches
        bright:  sampled emissive triangles
        """
        self._tasks, self._shipped, self._folder = tasks, shipped, folder
        self._memories = RadianceExchangePair(folder)
        self._settings, self._patch_scene = settings, patch_scene
        self._back_to_back = _lies_back_to_back(rays, settings)
        table = SceneTable.of_scene(patch_scene, bright, self._back_to_back, folder)
        self._patches = self._solved = ShippedPatches(tasks, patch_scene.patches, table, folder)
        self._blocks: dict[Span, Future] = {}
        self._probe_light: tuple[NumpyPickle, Future] | None = None

    def describe(self) -> str:
        """Return a sentence for the report: number of workers, and the scheduler's dashboard.

        The scheduler of this machine's own workers ends with the bake, so it has no dashboard.
        """
        count = len(self._tasks.workers())
        who = (
            "1 Dask worker computes visibility and gathers"
            if count == 1
            else f"{count} Dask workers compute visibility and gather"
        )
        watched = "" if self._settings.scheduler == ALL_DEVICES else f"; dashboard: {self._tasks.dashboard}"
        return f"{who} for them{watched}."

    def sampled(self) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return E/pi of light from shadow rays, (n, 3) float32, and its L1; yield progress 0..1."""
        tasks = self._tasks_of_patches(shadow_tasks.sampled)

        # Workers that finish early start on visibility. With patch groups they wait, since the groups depend
        # on this light.
        if shared_width(self._settings, self._patches.count) == 1:
            self._find()
        yield 0.0
        light = yield from self._tasks.rows(tasks)
        if light.shape[1] == _COLORS:
            return light, np.zeros((0, 3, 3), np.float32)
        return colors_of(light), light[:, _COLORS:].reshape(-1, 3, 3)

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return the visible fraction of a light for each patch, (n,) float32; yield progress 0..1."""
        return (yield from self._of_patches(shadow_tasks.shadow_mask, lamp))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the unoccluded fraction of each patch's hemisphere, (n,) float32; yield progress 0..1."""
        return (yield from self._of_patches(shadow_tasks.ambient_occlusion))

    def views(self) -> Generator[float, None, np.ndarray]:
        """Return fractions of each patch's hemisphere, (n, 2): without back faces, and covered by patches."""
        self._find_once()
        return (yield from self._of_blocks(block.views))

    def gather(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Gather from the radiance `light`; return E/pi, (n, 3). The call after the next overwrites it."""
        self._find_once()
        memory = self._memories.next(len(light.parts), self._tasks.workers())
        if memory is None:
            return (yield from self._of_blocks(block.gather, self._light_sent(light)))
        mapped, blocks = portable_bytes(memory.put(light)), self._blocks.values()
        yield from self._tasks.finish(
            self._tasks.begin(block.gather_to, [(found, mapped, memory.path) for found in blocks])
        )
        return memory.rows

    def gather_l1(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) for radiance `light`, (n, 3, 3)."""
        return (yield from self._of_blocks(block.gather_l1, self._light_sent(light)))

    def of_groups(self, representative: np.ndarray, texel_to_group: np.ndarray, emission: np.ndarray) -> None:
        """Switch the workers to patch groups and start to compute the groups' visibility."""
        table = PatchTable.of(texel_to_group, SparseRadiance.of(emission), self._back_to_back, self._folder)
        self._solved = ShippedPatches(
            self._tasks, self._patch_scene.patches.subset(representative), table, self._folder
        )
        self._find()

        # Both tables are combined to one value, because Dask schedules tasks slowly if they depend on many
        # values.
        tables = self._patches.table, self._solved.table
        (self._both,) = self._tasks.begin(final_tasks.both, [tables])

    def final(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the final gather of every patch from the radiance of groups, (n, 4)."""
        self._blocks = {}
        return (yield from self._final(final_tasks.final, light))

    def final_l1(self, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1) of the final gather, (n, 3, 3)."""
        return (yield from self._final(final_tasks.final_l1, light))

    def gather_at(
        self, samples: TexelSamples, light: HalfRadiance, choice: SolverChoice, settings: Settings
    ) -> Generator[float, None, list[GatheredSamples]]:
        """Gather light at texel samples by tasks of the workers; yield progress 0..1."""
        self._blocks = {}
        spans, scene = cut(len(samples), _FEWEST_POINTS), (self._shipped.shipment, self._patches.table)
        how, seen = self._tasks.sent((choice, settings), "how"), (self._solved.table, self._light_sent(light))
        parts = [self._tasks.sent(samples.subset(slice(*span)), "samples") for span in spans]
        tasks = [(*scene, part, *seen, how) for part in parts]
        begun = self._tasks.begin(final_tasks.light_at_samples, tasks)
        lit: dict[Span, GatheredSamples] = {}
        yield from self._tasks.take(dict(zip(begun, spans, strict=True)), lit.__setitem__)
        return [lit[span] for span in spans]

    def probes(
        self,
        light: NumpyPickle,
        volume: int,
        count: int,
        choice: SolverChoice,
        find: Callable[[int, int], ProbePart | None],
        add: Callable[[int, int, ProbePart], None],
    ) -> Generator[float, None, list[ProbePart]]:
        """Gather light at the probes of a volume by tasks of the workers; yield progress 0..1."""
        self._blocks = {}
        all_spans, scene = cut(count, _FEWEST_PROBES), (self._shipped.shipment, self._patches.table)
        lit = {span: part for span in all_spans if (part := find(*span)) is not None}
        spans = [span for span in all_spans if span not in lit]
        if not spans:
            return list(lit.values())
        if self._probe_light is None or self._probe_light[0] is not light:
            self._probe_light = light, self._tasks.sent(light, "probe_light")
        how = self._tasks.sent(choice, "how")
        tasks = [(*scene, self._probe_light[1], how, volume, span) for span in spans]
        begun = self._tasks.begin(probe_tasks.light_at_probes, tasks)

        def put(span: Span, part: ProbePart) -> None:
            lit[span] = part
            add(*span, part)

        yield from self._tasks.take(dict(zip(begun, spans, strict=True)), put)
        return [lit[span] for span in all_spans]

    def _light_sent(self, light: HalfRadiance) -> Future:
        """Send radiance to the workers; return the task whose result it is."""
        return self._tasks.sent(light, "light")

    def _find_once(self) -> None:
        """Start to compute visibility unless a call before has started it."""
        if not self._blocks:
            self._find()

    def _find(self) -> None:
        """Start to compute the visibility of patches or groups, by tasks that any worker can repeat."""
        solved, scene = self._solved, self._shipped.shipment
        spans = cut(solved.count)
        tasks = [(scene, solved.table, solved.rows(span)) for span in spans]
        self._blocks = dict(zip(spans, self._tasks.begin(block.find, tasks, EARLY), strict=True))

    def _final(self, function: Callable, light: HalfRadiance) -> Generator[float, None, np.ndarray]:
        """Gather for each block of patches from the radiance of groups, on any worker; return all rows."""
        spans, sent = cut(self._patches.count), self._light_sent(light)
        rows = map(self._patches.rows, spans)
        tasks = [(self._shipped.shipment, self._both, row, sent) for row in rows]
        begun = self._tasks.begin(function, tasks)
        return (yield from self._tasks.rows(dict(zip(begun, spans, strict=True))))

    def _of_patches(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Run a task for each block of patches, on any worker; return the rows of all patches."""
        return (yield from self._tasks.rows(self._tasks_of_patches(function, *arguments)))

    def _tasks_of_patches(self, function: Callable, *arguments: object) -> dict[Future, Span]:
        """Start a task for each block of patches, on any worker."""
        patches, scene = self._patches, self._shipped.shipment
        spans = cut(patches.count)
        tasks = [(scene, patches.table, patches.rows(span), *arguments) for span in spans]
        return dict(zip(self._tasks.begin(function, tasks), spans, strict=True))

    def _of_blocks(self, function: Callable, *arguments: object) -> Generator[float, None, np.ndarray]:
        """Run a task for each block on the worker that holds its samples; return the rows of all blocks."""
        begun = self._tasks.begin(function, [(found, *arguments) for found in self._blocks.values()])
        return (yield from self._tasks.rows(dict(zip(begun, self._blocks, strict=True))))


def _lies_back_to_back(rays: RayScene, settings: Settings) -> bool:
    """Return True if the scene has back-to-back faces and visibility is rasterised.

    Ray tracing needs no flag.
    """
    return untried_visibility(settings) == "raster" and bool(find_contacts(rays, rays.count)[1].any())


class ShippedPatches:
    """Patches or patch groups on workers.

    table:  task that returns the `PatchTable`, which workers fetch from each other
    count:  number of patches
    """

    def __init__(self, tasks: Tasks, patches: PatchList, table: PatchTable, folder: str) -> None:
        """Send the table of all patches to the workers. Each task brings the rows of its own block.

        folder: in the shared memory of all workers; empty if there is none
        """
        self._tasks, self.count = tasks, len(patches)
        self.table = tasks.sent(table, "patches" if isinstance(table, SceneTable) else "groups")
        self._all = PatchRows.of(patches, folder)
        self._sent: dict[Span, Future] = {}

    def rows(self, span: Span) -> Future | bytes:
        """Return the rows of a span as a task argument."""
        if self._all.in_files:
            return portable_bytes(self._all.part(*span))
        if span not in self._sent:
            self._sent[span] = self._tasks.sent(self._all.part(*span), "rows")
        return self._sent[span]
