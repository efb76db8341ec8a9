"""The bake: the paper's algorithm from patch list to lightmap, as a generator of progress."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np

from .bake_result import BakeResult, Report
from .device.device_array import Values
from .device.devices import Devices
from .direct.contact import Contacts
from .direct.emitter_split import split_light
from .direct.emitters import SampledTriangles
from .direct.lighting import DirectLighting
from .patches.backs import with_places
from .patches.patch_scene import PatchScene
from .patches.sides import both_sides
from .plan.choose_solver import choose_solver
from .plan.limits import check_limits, check_patch_count
from .plan.memory import shared_width
from .plan.opencl_fallback import without_opencl
from .plan.previous_solution import PreviousSolution
from .plan.remote_devices import RemoteDevices
from .plan.session_cache import SessionCache
from .plan.solve_job import SolveJob
from .plan.solver_choice import SolverChoice
from .plan.stages import BakeStages
from .postprocess.output_maps import Outputs
from .postprocess.outputs import output_names
from .postprocess.store import LightmapImages
from .progress import Progress
from .scene.model import Scene
from .settings import Settings
from .solve.solution import Solution
from .texel_gather.finishing import Finishing
from .texel_gather.light_group_outputs import light_by_groups
from .texel_gather.texel_sample_gather import TexelSampleLight, gather_texel_samples
from .texel_gather.texel_sample_points import TexelGatherJob
from .texel_gather.valid_patches import valid_front
from .visibility.rays.ray_scene import RayScene

#: Sends a scene that occluders have their places in to other processes; returns what sends them the patches,
#: of whose light some is sampled, and uses their devices.
Ship = Callable[[Scene], Callable[[PatchScene, RayScene, SampledTriangles], RemoteDevices]]


def bake(
    devices: Devices,
    scene: Scene,
    settings: Settings,
    stages: BakeStages,
    kept: SessionCache,
    ship: Ship | None = None,
) -> Generator[Progress, None, BakeResult]:
    """Bake a scene that has been checked; see `engine.bake`. The devices and what is kept stay.

    ship: sends the scene to devices of other processes; None to use these alone
    """
    return (yield from _current(devices, _bake(devices, scene, settings, stages, kept, ship)))


def _current(
    devices: Devices, work: Generator[Progress, None, BakeResult]
) -> Generator[Progress, None, BakeResult]:
    """Let a bake work with its devices current in every slice, and tell how they fail."""
    with devices.failures_told(), closing(work):
        while True:
            devices.graphics.use()
            try:
                progress = next(work)
            except StopIteration as stop:
                lightmap: BakeResult = stop.value
                return lightmap
            yield progress


def _bake(
    devices: Devices,
    scene: Scene,
    settings: Settings,
    stages: BakeStages,
    kept: SessionCache,
    ship: Ship | None,
) -> Generator[Progress, None, BakeResult]:
    """Bake: the paper's algorithm."""
    graphics, compute = devices.graphics, devices.compute
    scene, settings, notes = without_opencl(devices, scene, settings)
    atlases, scene = scene.atlases, with_places(scene, settings.resolution, kept.surfaces)
    check_limits(graphics, compute, scene, settings)

    # Other processes make what casts rays through it meanwhile.
    shipped = ship and ship(scene)

    # Texture space subdivision: which texels are patches, and where they are (III.A, IV.A).
    yield stages.begin(stages.patches)
    parts = kept.make_patch_scene(graphics, compute, scene, settings)
    check_patch_count(len(parts.patches))
    store = kept.store(parts.patches, len(atlases), settings, compute)
    last = kept.light_on(compute, parts, len(atlases), settings)
    yield stages.listed(len(parts.patches), parts.surfaces.mean_reflectance)

    # Lamps, small bright surfaces and bright sky are sampled with shadow rays (direct light). The room
    # appears in it, while it is still to be found what patches see of each other.
    rays = kept.ray_scene(compute, parts)
    split = split_light(scene.world, parts, settings, kept.choose_sampled_triangles, kept.split_sky)
    remote = shipped and shipped(parts, rays, split.bright)
    in_squares = remote is not None and shared_width(settings, len(parts.patches)) > 1
    meanwhile = partial(kept.inside, rays) if in_squares else None
    lighting = DirectLighting(scene, parts, rays, settings, remote, split, meanwhile)
    outputs = Outputs(scene, settings, lighting)
    lighting.follow(kept.sampled if settings.warm_start else None)
    sampled = yield from _direct_light(stages, store, outputs, lighting, last)
    kept.sampled = lighting.sampled_light(sampled) if settings.warm_start else None
    sampled = both_sides(parts.sides, sampled)

    # Threads beside the devices; they would hold up the first image of a scene that changes.
    areas, seams = kept.begin(compute, parts, len(atlases), settings)

    # Faces that touch patches hide them, whose light is not seen, or lie back to back with them.
    yield stages.begin(stages.choosing)
    near = kept.contacts(lighting)
    parts = replace(
        parts, surfaces=parts.surfaces.black_at(near.hide), back_to_back=bool(near.back_to_back.any())
    )

    # All other light is gathered: through hemicubes drawn in every iteration (IV.B), or what is kept of them.
    job = SolveJob(
        graphics, compute, parts, rays, lighting.emission_left, lighting.sky_left, sampled,
        areas.result(), settings, remote, kept, near=near, backs=lighting.backs_left,
    ).after(last)  # fmt: skip
    solution, choice, solved = choose_solver(job)
    if remote and compute and choice.method != "none":
        # What images need of texels is made while other processes find what patches see.
        kept.begin_texels(compute, parts, len(atlases), settings)
    yield stages.chosen(choice)

    # Every patch gathers what all others send out, until the light has settled (III.B, IV.C). The first
    # iteration tells which patches lie inside objects; after groups were solved, the last one does.
    texels = TexelGatherJob(scene, job, solved, choice, lighting)
    front = yield from _settle(stages, store, outputs, solution, texels, near, len(atlases))

    # What was asked for; where a texel shows more than its centre, at several points of it.
    made, lit = yield from _made(stages, outputs, texels, len(atlases), near, solution, front)

    # Images without noise and seams, and with dilated charts (VI.B).
    finishing = Finishing(store, texels, solution, made, lit)
    passes = yield from finishing.images(stages, seams)
    warnings = (*notes, *parts.warnings, *lighting.warnings, *finishing.warnings)
    choice = replace(choice, reasons=(*choice.reasons, *finishing.reasons))
    report = _summary(
        solution, solved.parts.surfaces.emission,
        settings, choice, len(parts.patches), stages.seconds, devices, warnings,
    )  # fmt: skip
    return BakeResult(
        atlases,
        store.image(next(iter(made.values()))) if settings.centres else store.no_image,
        next(iter(passes.values())),
        store.has_patch,
        store.known,
        report,
        passes,
    )


def _direct_light(
    stages: BakeStages,
    store: LightmapImages,
    outputs: Outputs,
    lighting: DirectLighting,
    last: PreviousSolution | None,
) -> Generator[Progress, None, np.ndarray]:
    """Return E/pi of the sampled light, (n, 3) float32, once it is shown.

    last: on a warm start what is known of all other light; it is shown with few rays' direct light first,
    unless that is as it was
    """
    stages.sampling(lighting.part_to_sample)
    if last:
        store.hide(last.front, last.near)
        if not lighting.part_to_sample:
            return (yield from stages.run(stages.direct, lighting.gather()))
    if last and outputs.begin_with_direct:
        glimpse = yield from stages.run(stages.first, lighting.preview_gather())
        yield stages.lit(store.display(glimpse + last.gathered))
    sampled = yield from stages.run(stages.direct, lighting.gather())
    if outputs.begin_with_direct and (last or sampled.any()):
        yield stages.lit(store.display(sampled + last.gathered if last else sampled))
    return sampled


def _settle(
    stages: BakeStages,
    store: LightmapImages,
    outputs: Outputs,
    solution: Solution,
    texels: TexelGatherJob,
    near: Contacts,
    atlases: int,
) -> Generator[Progress, None, np.ndarray]:
    """Iterate until the light has settled; near: of the patches. Return `valid_front` of the solution.

    A warm start leaves what it has found to the next one with each image, of which some may be left out: that
    of direct light, if it was shown, and others where sweeps are fast.
    """
    job = texels.job
    front = None
    warm, shows = job.settings.warm_start, job.settings.intermediates
    job.kept.light = job.kept.light if warm else None
    hidden = False
    while not outputs.done(solution):
        yield from stages.iterate(solution)
        done = outputs.done(solution)
        only_direct = stages.has_shown and not solution.iterations
        if warm and (only_direct or not (done or stages.image_due)):
            yield stages.iterated(solution, None)
            continue
        if warm:
            light = PreviousSolution.of(
                solution, job.parts.patches, job.sampled_light, near, job.direct_sources
            )
            job.kept.light = light.prepared() if done else light
        if done:
            front = valid_front(texels, atlases, near, solution)
            store.hide(front, near)
        elif shows and not hidden:
            store.hide(solution.front, near)
            hidden = True
        yield stages.iterated(solution, store.display(outputs.light(solution)) if shows else None)
    return solution.front if front is None else front


def _made(
    stages: BakeStages,
    outputs: Outputs,
    texels: TexelGatherJob,
    atlases: int,
    near: Contacts,
    solution: Solution,
    front: np.ndarray,
) -> Generator[Progress, None, tuple[dict[str, Values], TexelSampleLight]]:
    """Return every output of the patches, (n, 3) or (n,) float32, by name; and of the samples of texels.

    atlases: lightmaps of the user's; near: of the patches; front: from `valid_front`
    """
    job = texels.job
    made = yield from stages.run(stages.outputs, outputs.make(solution, job.parts.geometry))
    lit = yield from stages.run(stages.texels, gather_texel_samples(texels, atlases, near, solution, front))

    # The light of each light group on its own, over what was found of all light.
    groups, samples = yield from stages.run(stages.light_groups, light_by_groups(texels, solution, lit))
    made |= groups
    names = output_names(texels.scene, job.settings)
    return {name: made[name] for name in names}, replace(lit, values=lit.values | samples)


def _summary(
    solution: Solution,
    emission: np.ndarray,
    settings: Settings,
    choice: SolverChoice,
    patches: int,
    seconds: dict[str, float],
    devices: Devices,
    warnings: tuple[str, ...],
) -> Report:
    return Report(
        patches=patches,
        method=choice.method,
        visibility=choice.visibility,
        samples=choice.samples,
        reasons=choice.reasons,
        iterations=solution.iterations,
        convergence_error=solution.residual,
        converged=solution.converged or not settings.has_indirect,
        added_flux=tuple(solution.energies),
        seconds=seconds,
        devices={"gl": devices.graphics.name} | ({"cl": devices.compute.name} if devices.compute else {}),
        warnings=warnings,
        integrator=choice.integrator,
        energy=solution.energy(emission),
    )
