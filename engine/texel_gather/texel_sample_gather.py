"""Final gather at texel samples: supersampling of texels whose light or surface is not uniform."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..array_ops import joined_rows
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, channel_sums
from ..device.opencl import cl
from ..direct.contact import Contacts
from ..gather.half_radiance import HalfRadiance
from ..patches.sides import both_sides
from ..plan.gathered_samples import GatheredSamples
from ..plan.receivers import Receivers, make_final_gather
from ..plan.solve_job import SolveJob
from ..plan.solver_choice import SolverChoice
from ..postprocess.blended_light import BlendedLight
from ..postprocess.device_images import DeviceTexels
from ..postprocess.irradiance_edges import PatchLight
from ..postprocess.output_maps import Outputs
from ..postprocess.texel_means import TexelMeans
from ..postprocess.texel_samples import TexelSamples, display_samples, joined_samples, no_samples
from ..postprocess.thin_wall_fit import ThinWallFit
from ..postprocess.thin_walls import in_thin_walls, warn_thin_walls
from ..progress import run_as_fraction
from ..scene.color import channel_sum
from ..settings import Settings
from ..solve.solution import Solution
from ..validity.invalid import is_invalid
from ..validity.push_off import joined_push_offs
from ..visibility.sample_counts import expected_samples, ray_count
from .light_group_final_gather import gather_light_groups, of_all_light
from .light_group_solver import LightGroupSolution
from .pockets import in_pockets
from .texel_sample_points import TexelGatherJob, TexelSamplePoints, with_other_sides
from .valid_patches import invalid_patches, lit_backs_of, radiance_of, substitutes_of

#: Minimum rays of a sample, and minimum shadow rays to each light.
_LEAST_RAYS, _LEAST_LIGHT_RAYS = 16, 4

#: Number of points that gather at once on any device, and the bytes of device memory for each further one: a
#: point takes about 0.5 KiB, of at most a 64th of the memory.
_BATCH, _OF_MEMORY = 1 << 19, 64 * 512


@dataclass(frozen=True)
class TexelSampleLight:
    """Light at texel samples.

    samples:  texel samples after push-off
    visible:  (s,) bool, valid samples
    normals:  (s, 3) float32, unit, world space; (0, 3) if nothing is denoised
    light:    (s,) float32, E/pi of all light, sum of the channels
    centres:  (n, 1) float32, E/pi of the patches, sum of the channels
    inside:   (k,) int64, samples inside walls thinner than two texels
    values:   (s, 3) or (s,) float32, value of each output, by name; empty without samples
    invalid:  (n,) bool, invalid patches
    substitute: (m,) uint32, substitute of each sender of light; None if all are valid
    count:     samples of each texel
    reasons:   sentences for the report
    warnings:  messages for the user
    """

    samples: TexelSamples
    visible: np.ndarray
    normals: np.ndarray
    light: np.ndarray
    centres: Values
    inside: np.ndarray
    values: dict[str, np.ndarray]
    invalid: np.ndarray
    substitute: np.ndarray | None
    count: int
    reasons: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def means(self, compute: ComputeDevice, shape: tuple[int, ...]) -> TexelMeans:
        """Return the texel means of the samples on lightmaps, (atlases, r, r); there must be a sample."""
        return TexelMeans(compute, self.samples, self.visible, shape)

    def beside_walls(
        self, compute: ComputeDevice, shown: DeviceTexels, known: np.ndarray
    ) -> ThinWallFit | None:
        """Return the fit of texels at walls thinner than a texel; None without such walls."""
        if not len(self.inside):
            return None
        return ThinWallFit(
            compute=compute,
            samples=self.samples,
            visible=self.visible,
            light=self.light,
            inside=self.inside,
            shown=shown,
            known=known,
        )


def gather_texel_samples(
    texel_job: TexelGatherJob,
    atlases: int,
    contacts: Contacts,
    solution: Solution,
    validity: np.ndarray,
    found: Callable[[int, int], None],
) -> Generator[float, None, TexelSampleLight]:
    """Gather light at the texel samples of a solution; yield the fraction done.

    texel_job: patches and direct light
    atlases:   number of the user's lightmaps
    contacts:  contacts of the patches
    solution:  solution of all light
    validity:  (n,) float32, validity from `patch_validity`
    found:     called with the numbers of texel samples and of the rays of each, before the gather
    """
    if texel_job.job.settings.texel_samples == 1 or texel_job.choice.method == "none":
        return _nothing()
    compute, why = texel_job.job.compute, _why_centres_only(texel_job.job, texel_job.choice)
    if why or compute is None:
        return _nothing(why)
    known = PatchLight(channel_sums(solution.light), validity, invalid_patches(texel_job, validity, contacts))
    asked, clipper = (
        texel_job.job.settings.texel_samples,
        texel_job.job.kept.texels.clipper(compute, texel_job.job.patch_scene),
    )
    samples, count = display_samples(clipper, texel_job.job.patch_scene, atlases, known, asked)
    if not len(samples):
        return _nothing("No texel needs more than one sample.")
    settings = _settings_of_samples(texel_job.job.settings, count)
    found(len(samples), expected_samples(settings))
    substitute = substitutes_of(texel_job, known.invalid, solution.source_irradiance, solution.substitute)
    radiance, remote = (
        radiance_of(texel_job.solved, solution.source_irradiance, substitute),
        texel_job.job.remote,
    )
    if texel_job.job.patch_scene.sides is not None:
        # Remote devices do not store the weights of both sides of a surface, so this device gathers.
        texel_job, remote = replace(texel_job, solved=replace(texel_job.solved, remote=None)), None
    if remote is not None:
        sent = HalfRadiance.of(compute, radiance, texel_job.solved.count)
        lit = yield from remote.gather_at(samples, sent, texel_job.choice, settings)
    else:
        lit = []
        for batch, done in _batches(samples, compute):
            lit.append((yield from run_as_fraction(*done, gather_at(texel_job, radiance, batch, settings))))
    return _joined(texel_job, lit, known, substitute, count)


def light_groups_in_texels(
    texel_job: TexelGatherJob, lit: TexelSampleLight, groups: list[LightGroupSolution]
) -> Generator[float, None, list[np.ndarray]]:
    """Return E/pi of light groups at the texel samples, (s, 3) float32 each.

    Yields the fraction done.
    """
    if not len(lit.samples):
        return []
    settings = of_all_light(_settings_of_samples(texel_job.job.settings, lit.count))
    light: list[np.ndarray] = []
    for batch, done in _batches(lit.samples, texel_job.job.opencl):
        both, sides = with_other_sides(batch, texel_job.job.patch_scene)
        points = TexelSamplePoints(texel_job, both, settings)
        found = yield from run_as_fraction(*done, _gather_groups(texel_job, groups, lit.substitute, points))
        light.append(np.stack([both_sides(sides, group)[: len(batch)] for group in found]))
    return list(np.concatenate(light, axis=1))


def _gather_groups(
    texel_job: TexelGatherJob,
    groups: list[LightGroupSolution],
    substitute: np.ndarray | None,
    points: TexelSamplePoints,
) -> Generator[float, None, np.ndarray]:
    """Return E/pi of light groups at texel samples, (g, s, 3) float32.

    substitute:  (m,) uint32, substitute of each sender of light; None if all are valid
    """
    lighting = texel_job.lighting.of(points.rays, points.settings)
    sampled = yield from run_as_fraction(0.0, 0.3, lighting.gather_by_group())
    solved, source_irradiance = (
        [group.solved for group in groups],
        [group.source_irradiance for group in groups],
    )
    receivers = Receivers(points.patch_scene, points.rays, sampled[0])
    gathering = gather_light_groups(
        solved, source_irradiance, texel_job.choice, receivers, sampled, points.settings, substitute
    )
    return (yield from run_as_fraction(0.3, 1.0, gathering))


def _batches(
    samples: TexelSamples, compute: ComputeDevice
) -> Iterator[tuple[TexelSamples, tuple[float, float]]]:
    """Split samples between texels into batches.

    Yields each with the fractions of the work before and after it.
    """
    most = max(_BATCH, compute.device.global_mem_size // _OF_MEMORY)
    if len(samples) <= most:
        yield samples, (0.0, 1.0)
        return
    ends = np.append(samples.starts, len(samples))
    borders = np.unique(ends[np.searchsorted(ends, [*range(0, len(samples), most), len(samples)])])
    for first, last in pairwise(borders.tolist()):
        yield samples.subset(slice(first, last)), (first / len(samples), last / len(samples))


def _why_centres_only(job: SolveJob, choice: SolverChoice) -> str:
    """Return the reason not to supersample; empty if supersampling is possible."""
    if choice.method == "paper":
        return "Every texel shows the light at its centre, as in the paper's method."
    return "" if job.compute else "Every texel shows the light at its centre: there is no OpenCL."


def _nothing(*reasons: str) -> TexelSampleLight:
    """Return a result without samples, and the reasons for it."""
    nothing, none = np.zeros(0, np.float32), np.zeros(0, bool)
    return TexelSampleLight(
        samples=no_samples(),
        visible=none,
        normals=np.zeros((0, 3), np.float32),
        light=nothing,
        centres=nothing,
        inside=np.zeros(0, np.int64),
        values={},
        invalid=none,
        substitute=None,
        count=1,
        reasons=reasons,
    )


def gather_at(
    texel_job: TexelGatherJob, radiance: cl.Buffer, samples: TexelSamples, settings: Settings
) -> Generator[float, None, GatheredSamples]:
    """Gather light at texel samples; yield the fraction done.

    radiance:  exitant radiance of the senders on the device, float4, between two black entries
    """
    count = len(samples)
    samples, sides = with_other_sides(samples, texel_job.job.patch_scene)
    points = TexelSamplePoints(texel_job, samples, settings)
    push_offs = points.push_out(
        texel_job.lighting.lit_by_backs(points.rays), lit_backs_of(texel_job, radiance)
    )
    yield 0.1

    # Gather direct light, then all other light from the radiance of the patches.
    lighting = texel_job.lighting.of(points.rays, settings)
    sampled = yield from run_as_fraction(0.1, 0.3, lighting.gather())
    receivers = Receivers(points.patch_scene, points.rays, sampled)
    last, _ = make_final_gather(texel_job.solved, texel_job.choice, receivers, settings)
    yield from run_as_fraction(0.3, 0.8, last.gather_from(radiance))
    outputs, geometry = Outputs(texel_job.scene, settings, lighting), points.patch_scene.geometry
    received = last if sides is None else BlendedLight(last, sides)
    made = yield from run_as_fraction(0.8, 1.0, outputs.make(received, geometry))
    values = {name: np.asarray(light) for name, light in made.items()}
    normals = geometry.normal if settings.denoise else np.zeros((0, 3), np.float32)
    visible = ~(is_invalid(last.gathered[:, 3], lighting.contacts()) | push_offs.inside)
    lit = GatheredSamples(points.samples, push_offs, visible, normals, received.irradiance, values)
    return lit if sides is None else lit.first(count)


def _joined(
    texel_job: TexelGatherJob,
    lit: list[GatheredSamples],
    known: PatchLight,
    substitute: np.ndarray | None,
    count: int,
) -> TexelSampleLight:
    """Join the light of all batches; add the report's sentence and the warnings."""
    samples = joined_samples([batch.samples for batch in lit])
    push_offs = joined_push_offs([batch.push_offs for batch in lit])
    visible, normals, irradiance = (
        joined_rows([getattr(batch, name) for batch in lit]) for name in ("visible", "normals", "irradiance")
    )
    values = {name: joined_rows([batch.values[name] for batch in lit]) for name in lit[0].values}
    patch_scene = texel_job.job.patch_scene
    reason = (
        f"Light was gathered at {len(samples):,} more points in {len(samples.starts):,} texels whose light "
        "or surface is not uniform."
    )
    light = channel_sum(irradiance)
    visible = visible.copy()
    visible[in_pockets(samples.starts, visible, push_offs.enclosed, light)] = False
    inside = in_thin_walls(patch_scene, samples, push_offs, visible, light)
    warnings = warn_thin_walls(texel_job.scene, patch_scene, samples, push_offs, inside)
    return TexelSampleLight(
        samples=samples,
        visible=visible,
        normals=normals,
        light=light,
        centres=known.light,
        inside=inside,
        values=values,
        invalid=known.invalid,
        substitute=substitute,
        count=count,
        reasons=(reason,),
        warnings=tuple(warnings),
    )


def _settings_of_samples(settings: Settings, count: int) -> Settings:
    """Return settings with fewer rays: `count` samples of a texel share the rays of one patch."""
    hemicube = settings.hemicube >> (int(math.log2(count)) // 2)
    return replace(
        settings,
        texel_samples=count,
        samples=max(ray_count(settings) // count, _LEAST_RAYS),
        hemicube=max(hemicube, 8),
        light_samples=max(settings.light_samples // count, _LEAST_LIGHT_RAYS),
        ao_samples=max(settings.ao_samples // count, _LEAST_RAYS),
    )
