"""Solution of each light group, from the visibility samples of the solution of all light."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..device.buffers import upload_float4
from ..device.device_array import colors_on_host
from ..gather.light_group_gather import TOGETHER, LightGroupGather
from ..gather.visibility_cache import VisibilityCache
from ..plan.choose_gather import static_light
from ..plan.choose_solver import solver_like
from ..plan.receivers import Receivers
from ..plan.session_cache import SessionCache
from ..plan.solve_job import SolveJob
from ..plan.solver_choice import SolverChoice
from ..progress import run_as_fraction
from ..scene.color import add_colors
from ..solve.device_radiosity import DeviceRadiosity
from ..solve.grouped_solution import GroupedSolution
from ..solve.interpolated_gather import InterpolatedGather
from ..solve.radiosity_state import IterationSums, SolvedSurfaces, StartLight
from ..solve.solution import Solution
from ..solve.solver import Solver
from .light_group_final_gather import gather_light_groups, of_all_light

#: Minimum light that is scaled up; below it the factor exceeds float32.
_DARKEST = 1e-30


@dataclass(frozen=True)
class GroupEmission:
    """Light that one group emits, in the form that `SolveJob` needs.

    emission:       (n, 3) float32, radiance of front faces
    sky:            (h, w, 3) float32, radiance of the unsampled sky
    sampled_light:  (n, 3) float32, E/pi from shadow rays
    backs:          (n, 3) float32, radiance of back faces; None if equal to the front
    """

    emission: np.ndarray
    sky: np.ndarray
    sampled_light: np.ndarray
    backs: np.ndarray | None = None


@dataclass(frozen=True)
class LightGroupSolution:
    """Solution of one light group.

    irradiance:         (n, 3) float32, E/pi of all patches
    source_irradiance:  (m, 3) float32, E/pi of the senders: the patches, or patch groups
    solved:             job that was solved
    """

    irradiance: np.ndarray
    source_irradiance: np.ndarray
    solved: SolveJob


def solve_light_groups(
    job: SolveJob, solved: SolveJob, choice: SolverChoice, solution: Solution, groups: Sequence[GroupEmission]
) -> Generator[float, None, list[LightGroupSolution]]:
    """Solve for each light group; yield the fraction done.

    job:       all patches, with the light of all groups
    solved:    the job that the solver solved: `job` itself, or the job of its patch groups
    choice:    choice of the gather for all light
    solution:  solution of all light
    groups:    emission of each light group
    """
    job, solved = (replace(one, settings=of_all_light(one.settings)) for one in (job, solved))
    parts = [_part_of(job, solved, solution, sources) for sources in groups]
    gathered = yield from run_as_fraction(0.0, 0.5, _gathered(solved, choice, parts, solution.substitute))
    source_irradiance = [light[:, :3] for light in gathered]
    of_patches: Sequence[np.ndarray] | np.ndarray = source_irradiance
    if isinstance(solution, GroupedSolution):
        sampled = np.stack([sources.sampled_light for sources in groups])
        gathering = _of_patches(job, parts, choice, solution, gathered, sampled)
        of_patches = yield from run_as_fraction(0.5, 1.0, gathering)
    return [LightGroupSolution(*each) for each in zip(of_patches, source_irradiance, parts, strict=True)]


def _part_of(job: SolveJob, solved: SolveJob, solution: Solution, sources: GroupEmission) -> SolveJob:
    """Return the solver's job for one light group."""
    if not isinstance(solution, GroupedSolution):
        return replace(job, **vars(sources), part_of=job, indirect=None, direct=None, validity=None)
    mean = solution.groups.mean
    return replace(
        solved,
        emission=mean(sources.emission),
        backs=None if sources.backs is None else mean(sources.backs),
        sky=sources.sky,
        sampled_light=mean(sources.sampled_light),
        part_of=solved,
        indirect=None,
        direct=None,
        validity=None,
    )


def _of_patches(
    job: SolveJob,
    parts: Sequence[SolveJob],
    choice: SolverChoice,
    solution: GroupedSolution,
    gathered: Sequence[np.ndarray],
    sampled: np.ndarray,
) -> Generator[float, None, np.ndarray]:
    """Return E/pi of light groups at all patches, (g, n, 3) float32, from the patch groups' light.

    gathered:  (m, 4) float32 for each light group, at patch groups
    sampled:   (g, n, 3) float32, E/pi from shadow rays
    """
    source_irradiance = [light[:, :3] for light in gathered]

    def gather(patches: np.ndarray | slice) -> Generator[float, None, np.ndarray]:
        patch_scene = job.patch_scene if isinstance(patches, slice) else job.patch_scene.subset(patches)
        rays = job.rays if isinstance(patches, slice) else job.rays.of(patch_scene)
        receivers = Receivers(patch_scene, rays, job.sampled_light[patches])
        lit = np.ascontiguousarray(sampled[:, patches])
        light = gather_light_groups(
            parts, source_irradiance, choice, receivers, lit, job.settings, solution.substitute
        )
        return (yield from light)

    if not isinstance(solution.last, InterpolatedGather):
        return (yield from gather(slice(None)))
    layers = []
    for part, light in zip(parts, gathered, strict=True):
        layers.append(light.copy())
        add_colors(layers[-1], part.sampled_light, -1)
        layers[-1][:, 3] = solution.of_patch_groups[:, 3]
    return (yield from solution.last.gather_groups(layers, sampled, gather))


def _gathered(
    solved: SolveJob, choice: SolverChoice, parts: Sequence[SolveJob], substitute: np.ndarray | None
) -> Generator[float, None, list[np.ndarray]]:
    """Iterate each light group to convergence; return gathered light, (m, 4) float32 each.

    substitute:  (m,) uint32, substitute patches, see `reflected_light`
    """
    gathered = [np.zeros((solved.count, 4), np.float32) for _ in parts]
    lit = [number for number, part in enumerate(parts) if part.lit]
    kept = _common_samples(solved)
    width = 1 if kept is None else TOGETHER
    runs = [lit[first : first + width] for first in range(0, len(lit), width)]
    for count, run in enumerate(runs):
        some = [parts[number] for number in run]
        if kept is None:
            solving = _solved_alone(some[0], choice, substitute)
        else:
            solving = _solved_together(kept, some, substitute)
        found = yield from run_as_fraction(count / len(runs), (count + 1) / len(runs), solving)
        for number, light in zip(run, found, strict=True):
            gathered[number] = light
    return gathered


def _common_samples(solved: SolveJob) -> VisibilityCache | None:
    """Return the visibility cache if all groups can share it, else None.

    No visible back face may emit light, and this device must hold the samples of all patches.
    """
    kept = solved.kept.samples
    if kept is None or not kept.complete or kept.others or kept.has_light_of_backs:
        return None
    return kept


def _solved_alone(
    part: SolveJob, choice: SolverChoice, substitute: np.ndarray | None
) -> Generator[float, None, list[np.ndarray]]:
    """Solve one light group with visibility samples of its own; return its gathered light."""
    solver = solver_like(replace(part, kept=SessionCache()), choice, substitute)
    yield from _converge(solver)
    return [solver.gathered]


def _solved_together(
    kept: VisibilityCache, parts: Sequence[SolveJob], substitute: np.ndarray | None
) -> Generator[float, None, list[np.ndarray]]:
    """Solve several light groups over shared visibility samples; return the gathered light of each.

    All parts are scaled to similar brightness, so that the tolerance has the same meaning for each.
    """
    job, scales = parts[0], [_scale(part) for part in parts]
    bright = [
        replace(
            part,
            emission=part.emission * scale,
            sky=part.sky * scale,
            sampled_light=part.sampled_light * scale,
        )
        for part, scale in zip(parts, scales, strict=True)
    ]
    sweep = LightGroupGather(job.opencl, kept, [static_light(part, kept.sampling) for part in bright])
    sides = job.patch_scene.sides
    surfaces = SolvedSurfaces(
        np.repeat(colors_on_host(job.patch_scene.surfaces.reflectance), len(parts), axis=0),
        np.repeat(job.area, len(parts)),
        sides and sides.repeated(len(parts)),
    )
    emission = upload_float4(job.opencl, _interleaved(part.emission for part in bright), first=1)
    start = StartLight(_interleaved(part.sampled_light for part in bright), job.gathers_direct)
    radiosity = _Radiosity(job.opencl, sweep, surfaces, emission, start, job.columns)
    interleaved = None if substitute is None else _interleaved_indices(substitute, len(parts))
    solver = Solver(radiosity, start, job.settings, lambda _: interleaved)
    yield from _converge(solver)
    light = solver.gathered.reshape(job.count, len(parts), 4)
    return [
        np.concatenate([light[:, number, :3] / scale, light[:, number, 3:]], axis=1)
        for number, scale in enumerate(scales)
    ]


class _Radiosity(DeviceRadiosity):
    """Radiosity state of light groups; acceleration must not mix their light in a common ambient term."""

    def sums(self, newest: int, least: float) -> IterationSums:
        """Return the sums after an iteration, without the reflected part that drives the ambient term."""
        sums = super().sums(newest, least)
        return replace(sums, reflected=np.zeros_like(sums.reflected))


def _converge(solver: Solver) -> Generator[float, None, None]:
    """Iterate until convergence; yield the estimated fraction done."""
    while not solver.done:
        for _ in solver.iteration():
            yield solver.iterations / (solver.iterations + 1)


def _scale(part: SolveJob) -> np.float32:
    """Return the factor that scales the mean light of a group to 1."""
    sources = part.emission, part.sky, part.sampled_light
    return np.float32(1 / max(sum(float(values.mean(dtype=np.float64)) for values in sources), _DARKEST))


def _interleaved_indices(substitute: np.ndarray, groups: int) -> np.ndarray:
    """Return the substitutes for interleaved groups, (m g,) int64: the groups of a patch are adjacent."""
    numbers: np.ndarray = groups * substitute[:, None] + np.arange(groups)
    return numbers.ravel()


def _interleaved(values: Iterable[np.ndarray]) -> np.ndarray:
    """Interleave values of groups, (m, 3) each, to (m g, 3): the groups of a patch are adjacent."""
    return np.stack(list(values), axis=1).reshape(-1, 3)
