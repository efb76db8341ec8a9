"""Light at display samples: gathered once more where a texel shows more than its centre."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pyopencl as cl

from ..device.buffers import upload_float4
from ..direct.contact import NearFaces
from ..direct.lighting import DirectLighting
from ..finish.display_samples import (
    DisplaySamples,
    display_samples,
    joined_samples,
    no_samples,
    on_lightmap,
)
from ..finish.light_edges import PatchLight
from ..finish.made_outputs import Outputs
from ..finish.push_out import WaysOut, joined_ways, pushed_barycentrics, ways_out
from ..finish.store import is_hidden
from ..finish.texel_means import TexelMeans
from ..finish.thin_walls import in_thin_walls, note_thin_walls
from ..finish.wall_fit import WallFit
from ..gather.half_light import HalfLight
from ..patches.geometry import PatchGeometry, TexelSteps
from ..patches.patch_list import PatchList
from ..patches.subdivision import Subdivision
from ..progress import part_of
from ..scene.color import channel_sum
from ..scene.model import Scene
from ..segment_sums import segment_sums
from ..settings import Settings
from ..solve.solver import Solution
from ..visibility.samples import ray_count
from .choice import Choice
from .light_group_gather import gather_light_groups, of_all_light
from .light_group_solver import SettledGroup
from .lit_samples import LitSamples
from .receivers import Receivers, last_gather
from .solve_job import SolveJob

#: What a point that was pushed out of something weighs: it counts where no other point of its texel is seen.
_PUSHED = 1e-3

#: Least rays of a sample, and to each light.
_LEAST_RAYS, _LEAST_LIGHT_RAYS = 16, 4

#: Points that gather together: what they take of the device's memory, about 0.5 KiB each, is bounded.
_BATCH = 1 << 18

#: Patches that see more than this fraction of backs are looked at closer: they may be inside of something.
_MANY_BACKS = 0.4

#: Texels from hidden ones that what is seen beside them is filled from, and the least part of the brightest
#: light that counts there.
_FILLED, _FAINTEST = 2, 1e-4


@dataclass(frozen=True)
class DisplayLight:
    """What display samples receive.

    visible  (s,) bool, samples that somebody sees
    normals  (s, 3) float32, unit, world space; (0, 3) unless the settings have them denoised
    light    (s,) float32, E/pi of all light, sum of the channels
    inside   (k,) int64, samples in walls that texels cannot part
    values   (s, 3) or (s,) float32 of every output, by name; of none without samples
    hidden   (n,) bool, patches that nobody sees
    count    samples of a texel
    reasons   sentences for the report
    warnings  sentences for the user
    """

    samples: DisplaySamples
    visible: np.ndarray
    normals: np.ndarray
    light: np.ndarray
    inside: np.ndarray
    values: dict[str, np.ndarray]
    hidden: np.ndarray
    count: int
    reasons: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def means(self, resolution: int) -> TexelMeans:
        """Return what texels show of the samples."""
        return TexelMeans(self.samples, self.visible, resolution)

    def beside_walls(self, shown: np.ndarray, known: np.ndarray) -> WallFit | None:
        """Return what texels beside thin walls show; None where there are none. See `WallFit`."""
        if not len(self.inside):
            return None
        return WallFit(self.samples, self.visible, self.light, self.inside, shown, known)


@dataclass(frozen=True)
class DisplayJob:
    """What light in texels is gathered for.

    job      the patches of all texels
    solved   the patches that send light out: those of the job, or groups of them
    """

    scene: Scene
    job: SolveJob
    solved: SolveJob
    choice: Choice
    lighting: DirectLighting
    _steps: dict[float, TexelSteps] = field(default_factory=dict)

    def steps(self, side: float) -> TexelSteps:
        """Return what a sample is of each triangle in the world; a texel has `side` of them along u and v."""
        if side not in self._steps:
            self._steps[side] = self.job.parts.geometry.steps.scaled(1 / side)
        return self._steps[side]


def light_in_texels(
    what: DisplayJob, atlases: int, near: NearFaces, solution: Solution
) -> Generator[float, None, DisplayLight]:
    """Return the light at the display samples of a solution; yield the fraction done.

    atlases: lightmaps of the user's; near: of the patches
    """
    if what.job.settings.texel_samples == 1 or what.choice.method == "none":
        return _nothing()
    compute, why = what.job.compute, _why_centres_only(what.job, what.choice)
    if why or compute is None:
        return _nothing(why)
    front = solution.gathered[:, 3]
    light = channel_sum(solution.irradiance)
    known = PatchLight(light, front, _nobody_sees(what, front, near))
    asked, clipper = what.job.settings.texel_samples, what.job.kept.clipper(compute, what.job.parts)
    samples, count = display_samples(clipper, what.job.parts, atlases, known, asked)
    if not len(samples):
        return _nothing("No texel shows more than its centre.")
    settings = _settings_of_samples(what.job.settings, count)
    settled = _as_seen(what, solution.settled, known.hidden)
    seen = _with_seen_surfaces(what, what.solved, known.hidden)
    radiance, remote = radiance_of(seen, settled), what.job.remote
    if remote is not None:
        sent = HalfLight.of(compute, radiance, what.solved.count)
        lit = yield from remote.light_at(samples, sent, what.choice, settings)
    else:
        lit = []
        for batch, done in _batches(samples):
            lit.append((yield from part_of(*done, light_at(what, radiance, batch, settings))))
    return _joined(what, lit, known.hidden, count)


def _nobody_sees(what: DisplayJob, front: np.ndarray, near: NearFaces) -> np.ndarray:
    """Return which patches nobody sees, (n,) bool.

    Those inside of something may see the front of what ends there, as a wall's inside that of a ceiling.
    front: (n,) float32, the fraction of each patch's view that no back takes
    """
    hidden = is_hidden(front, near)
    unsure = np.flatnonzero(~hidden & ~near.shine & (front < 1 - _MANY_BACKS))
    if len(unsure):
        parts = what.job.parts
        points = what.job.rays.of(parts.part(unsure))
        ways = ways_out(points, len(unsure), 1.0, parts.geometry.steps.geometric)
        hidden[unsure] = ways.without(what.lighting.lit_by_backs(points)).inside
    return hidden


def light_groups_in_texels(
    what: DisplayJob, lit: DisplayLight, groups: list[SettledGroup]
) -> Generator[float, None, list[np.ndarray]]:
    """Return E/pi of light groups at the samples of all light, (s, 3) float32 each.

    Yields the fraction done.
    """
    if not len(lit.samples):
        return []
    settings = of_all_light(_settings_of_samples(what.job.settings, lit.count))
    side_by_side = np.concatenate([group.settled for group in groups], axis=1)
    seen = _as_seen(what, side_by_side, lit.hidden).reshape(len(side_by_side), len(groups), 3)
    solved = [_with_seen_surfaces(what, group.solved, lit.hidden) for group in groups]
    light: list[np.ndarray] = []
    for batch, done in _batches(lit.samples):
        points = _Points(what, batch, settings)
        light.append((yield from part_of(*done, _gather_groups(what, solved, seen, points))))
    return list(np.concatenate(light, axis=1))


def _gather_groups(
    what: DisplayJob, solved: list[SolveJob], seen: np.ndarray, points: _Points
) -> Generator[float, None, np.ndarray]:
    """Return E/pi of light groups at points of texels, (g, s, 3) float32, from that of patches, (m, g, 3).

    solved: of each group, with surfaces as they are seen
    """
    lighting = what.lighting.of(points.rays, points.settings)
    sampled = yield from part_of(0.0, 0.3, lighting.gather_by_group())
    settled = list(seen.transpose(1, 0, 2))
    receivers = Receivers(points.parts, points.rays, sampled[0])
    gathering = gather_light_groups(solved, settled, what.choice, receivers, sampled, points.settings)
    return (yield from part_of(0.3, 1.0, gathering))


def _batches(samples: DisplaySamples) -> Iterator[tuple[DisplaySamples, tuple[float, float]]]:
    """Yield samples that gather together, and which fraction of all is before them and after them."""
    for first in range(0, len(samples), _BATCH):
        last = min(first + _BATCH, len(samples))
        yield samples.part(slice(first, last)), (first / len(samples), last / len(samples))


def _why_centres_only(job: SolveJob, choice: Choice) -> str:
    """Return why every texel shows the light at its centre alone, empty if some show it at more points."""
    if choice.method == "paper":
        return "Every texel shows the light at its centre, as the paper's method has it."
    return "" if job.compute else "Every texel shows the light at its centre: there is no OpenCL."


def _nothing(*reasons: str) -> DisplayLight:
    """Return the light of no samples, and why there are none."""
    nothing = np.zeros(0, np.float32)
    normals, inside = np.zeros((0, 3), np.float32), nothing.astype(np.int64)
    return DisplayLight(no_samples(), nothing > 0, normals, nothing, inside, {}, nothing > 0, 1, reasons)


def _as_seen(what: DisplayJob, settled: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return E/pi, (m, 3 g) float32, of the patches that send light out, as the samples see it.

    hidden: (n,) bool, patches that nobody sees
    """
    if not hidden.any():
        return settled
    if what.solved is what.job:
        return _seen_beside_hidden(what.job.parts, settled, hidden)
    patches, entries = what.job.parts.patches, what.solved.parts.texel_to_patch
    group = entries.reshape(len(entries), -1)[patches.atlas, patches.texel].astype(np.int64) - 1
    return _groups_beside_hidden(what.job.parts, group, settled, hidden)


def _with_seen_surfaces(what: DisplayJob, solved: SolveJob, hidden: np.ndarray) -> SolveJob:
    """Return a job whose hidden patches reflect what those beside them do, as in `_as_seen`."""
    surfaces = solved.parts.surfaces
    seen = replace(surfaces, reflectance=_as_seen(what, surfaces.reflectance, hidden))
    return replace(solved, parts=replace(solved.parts, surfaces=seen))


def _groups_beside_hidden(
    parts: Subdivision, group: np.ndarray, light: np.ndarray, hidden: np.ndarray
) -> np.ndarray:
    """Return light of groups of patches, (m, 3 g) float32, of which those with hidden ones have other light.

    It is the mean of that of visible patches and of what hidden ones at their border have from beside them:
    of a group nothing farther from its border is seen.

    group: (n,) int64, of each patch; hidden: (n,) bool
    """
    of_patches = _seen_beside_hidden(parts, light[group], hidden)
    changed = np.zeros(len(light), bool)
    changed[group[hidden]] = True
    seen = np.flatnonzero(changed[group])
    seen = seen[of_patches[seen].any(axis=1)]
    number = np.bincount(group[seen], minlength=len(light))[changed]
    sums = segment_sums(of_patches[seen], group[seen], len(light))[changed]
    result = light.copy()
    result[changed] = sums / np.maximum(number, 1)[:, None]
    return result


def radiance_of(solved: SolveJob, settled: np.ndarray) -> cl.Buffer:
    """Return the radiance of patches of E/pi (m, 3) on the device; see `FinalGather.gather_from`."""
    reflected = solved.parts.surfaces.reflectance * settled if solved.settings.bounces else 0
    return upload_float4(solved.opencl, solved.emission + reflected, first=1, last=1)


def light_at(
    what: DisplayJob, radiance: cl.Buffer, samples: DisplaySamples, settings: Settings
) -> Generator[float, None, LitSamples]:
    """Return the light at points of texels; yield the fraction done.

    radiance: on the device, float4 of each patch that sends light out, between two black entries
    """
    points = _Points(what, samples, settings)
    ways = points.push_out(what.lighting.lit_by_backs(points.rays))
    yield 0.1

    # Direct light, then all other light from what the patches send out.
    lighting = what.lighting.of(points.rays, settings)
    sampled = yield from part_of(0.1, 0.3, lighting.gather())
    receivers = Receivers(points.parts, points.rays, sampled)
    last, _ = last_gather(what.solved, what.choice, receivers, settings)
    yield from part_of(0.3, 0.8, last.gather_from(radiance))
    outputs, geometry = Outputs(what.scene, settings, lighting), points.parts.geometry
    made = yield from part_of(0.8, 1.0, outputs.make(last, geometry))
    values = {name: np.asarray(light) for name, light in made.items()}
    normals = geometry.normal if settings.denoise else np.zeros((0, 3), np.float32)
    visible = ~(is_hidden(last.gathered[:, 3], lighting.near_faces()) | ways.inside)
    return LitSamples(points.samples, ways, visible, normals, last.irradiance, values)


def _joined(what: DisplayJob, lit: list[LitSamples], hidden: np.ndarray, count: int) -> DisplayLight:
    """Return the light of all batches, and what the report says of it."""
    samples = joined_samples([batch.samples for batch in lit])
    ways = joined_ways([batch.ways for batch in lit])
    visible, normals, irradiance = (
        np.concatenate([getattr(batch, name) for batch in lit])
        for name in ("visible", "normals", "irradiance")
    )
    values = {name: np.concatenate([batch.values[name] for batch in lit]) for name in lit[0].values}
    parts = what.job.parts
    keys = samples.keys(parts.patches.resolution)
    reason = (
        f"Light was gathered at {len(keys):,} more points, of {len(np.unique(keys)):,} texels that show "
        "more than their centre."
    )
    light = channel_sum(irradiance)
    inside = in_thin_walls(parts, samples, ways, visible, light)
    warnings = note_thin_walls(what.scene, parts, samples, ways, inside)
    found = samples, visible, normals, light, inside, values
    return DisplayLight(*found, hidden, count, (reason,), tuple(warnings))


class _Points:
    """Display samples as patches that gather.

    settings  by which they do; each is one of `texel_samples` of its texel
    parts     as a Subdivision
    rays      casts rays from them
    """

    def __init__(self, what: DisplayJob, samples: DisplaySamples, settings: Settings) -> None:
        self._job, self.settings = what.job, settings

        # A sample stands for a part of its texel.
        self._side = math.sqrt(settings.texel_samples)
        self._steps = what.steps(self._side)
        self._place(samples)

    def _place(self, samples: DisplaySamples) -> None:
        parts = self._job.parts
        geometry = PatchGeometry(parts.triangles, self._steps, samples.triangle, samples.barycentric)
        patches = PatchList(
            parts.patches.resolution, samples.atlas, samples.texel, samples.triangle, samples.barycentric
        )
        self.samples, self.parts = samples, replace(parts, patches=patches, geometry=geometry)
        self.rays = self._job.rays.of(self.parts)

    def push_out(self, lit: np.ndarray) -> WaysOut:
        """Move samples that are inside of something to just outside of it; return the ways.

        Those that are moved are not inside any more. lit: (s,) bool, those that a back lights never are.
        """
        samples, parts = self.samples, self.parts
        ways = ways_out(self.rays, len(samples), self._side, self._steps.geometric).without(lit)
        inside = np.flatnonzero(ways.offset.any(axis=1))
        if not len(inside):
            return ways
        moved, stays = pushed_barycentrics(parts.geometry.part(inside), ways.offset[inside])
        inside, moved = inside[stays], moved[stays]
        ways.inside[inside] = False
        barycentric, weight = samples.barycentric.copy(), samples.weight.copy()
        position = samples.position.copy()
        barycentric[inside], weight[inside] = moved, _PUSHED * weight[inside]
        triangle = samples.triangle[inside]
        position[inside] = on_lightmap(parts.triangles, triangle, moved, parts.patches.resolution)
        self._place(replace(samples, barycentric=barycentric, weight=weight, position=position))
        return ways


def _settings_of_samples(settings: Settings, count: int) -> Settings:
    """Return settings for so many samples of each texel, which together have the rays of a patch."""
    hemicube = settings.hemicube >> (int(math.log2(count)) // 2)
    return replace(
        settings,
        texel_samples=count,
        samples=max(ray_count(settings) // count, _LEAST_RAYS),
        hemicube=max(hemicube, 8),
        light_samples=max(settings.light_samples // count, _LEAST_LIGHT_RAYS),
        ao_samples=max(settings.ao_samples // count, _LEAST_RAYS),
    )


def _seen_beside_hidden(parts: Subdivision, light: np.ndarray, hidden: np.ndarray) -> np.ndarray:
    """Return light of patches, (n, 3 g) float32, in which hidden ones have that of patches beside them.

    Who sees the visible part of a texel whose centre is hidden sees what is beside the centre. Where that is
    light on one side of a thin wall and dark on the other, it counts as their harmonic mean, which is dark:
    what is bright would light the foot of the wall on its dark side. The light of g groups of light, side by
    side, is bright or dark together.
    """
    filled, known, left = light.copy(), ~hidden, np.flatnonzero(hidden)
    total, beside = channel_sum(filled), _patches_beside(parts, left)
    for _ in range(_FILLED):
        counts = (beside > 0) & known[beside - 1]
        reached = counts.any(axis=1)
        mine, near, counts = left[reached], beside[reached], counts[reached].astype(np.float32)
        sums = np.einsum("hk,hkc->hc", counts, filled[near - 1])
        filled[mine] = sums * _darkened(total, near, counts)[:, None]
        total[mine] = channel_sum(filled[mine])
        known[mine] = True
        left, beside = left[~reached], beside[~reached]
    filled[left] = 0
    return filled


def _darkened(total: np.ndarray, beside: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return the factors, (h,) float32, that make harmonic means of sums of patches' light.

    total (n,) of all channels together; beside (h, k) int64, patch + 1; counts (h, k) float32, 1 for
    those that are added up, else 0
    """
    light, number = total[beside - 1], channel_sum(counts)
    bright = np.maximum(light, max(_FAINTEST * float(total.max()), 1e-30))
    inverse, sums = np.einsum("hk,hk->h", counts, 1 / bright), np.einsum("hk,hk->h", counts, light)
    factor: np.ndarray = np.minimum(number / np.maximum(inverse, 1e-30) / np.maximum(sums, 1e-30), 1 / number)
    return factor.astype(np.float32)


def _patches_beside(parts: Subdivision, patches: np.ndarray) -> np.ndarray:
    """Return patch + 1 in the 3 x 3 texels around some patches, (m, 9) int64, 0 for none."""
    resolution = parts.patches.resolution
    row, column = np.divmod(parts.patches.texel[patches], resolution)
    step = np.arange(9)
    y, x = row[:, None] + step // 3 - 1, column[:, None] + step % 3 - 1
    inside = (y >= 0) & (y < resolution) & (x >= 0) & (x < resolution)
    rows = parts.patches.atlas[patches, None].astype(np.int64) * resolution + y
    beside = parts.texel_to_patch.ravel().take(rows * resolution + x, mode="clip")
    return np.where(inside, beside, 0).astype(np.int64)
