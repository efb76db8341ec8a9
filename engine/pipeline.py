"""Bake pipeline: texture-space radiosity from patch list to lightmaps, as a generator of `Progress`.

The stages follow the paper: patch list, direct light, gather iterations, outputs, final images. By default
visibility comes from cached rays; method "paper" draws radiance hemicubes in every iteration.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .bake_result import BakeResult, ProbeGrid, ReflectionCube, Report
from .bake_state import BakeState, Inspect, ignore
from .device.cl_device import ComputeDevice
from .device.device_array import Values
from .device.devices import Devices
from .direct.contact import Contacts
from .direct.emitters import SampledTriangles
from .direct.lighting import DirectLighting
from .outputs import LIGHT_GROUP
from .patches.patch_scene import PatchScene
from .patches.seams import Seams
from .patches.sides import both_sides
from .plan.choose_solver import choose_solver
from .plan.limits import check_limits, check_patches, may_gather
from .plan.memory import shared_width
from .plan.opencl_fallback import without_opencl
from .plan.previous_solution import PreviousSolution
from .plan.remote_devices import RemoteDevices
from .plan.session_cache import SessionCache
from .plan.sharing import share, shared_work
from .plan.solve_job import SolveJob
from .plan.stages import BakeStages
from .postprocess.output_maps import Outputs
from .postprocess.output_names import output_names
from .postprocess.store import LightmapImages
from .progress import Progress, map_progress
from .scene.model import Scene
from .settings import Settings
from .solve.solution import Solution
from .texel_gather.finishing import Finishing
from .texel_gather.light_group_outputs import light_by_groups
from .texel_gather.texel_sample_gather import TexelSampleLight, gather_texel_samples
from .texel_gather.texel_sample_points import TexelGatherJob
from .texel_gather.valid_patches import patch_validity
from .visibility.rays.ray_scene import RayScene
from .visibility.rays.shaders.shader_builds import ShaderBuilds

#: Function that sends a scene to other processes. It returns a function that sends them the patches and
#: returns their devices. The scene has lightmap UVs for all objects; the sampled triangles count as lights.
Ship = Callable[[Scene], Callable[[PatchScene, RayScene, SampledTriangles], RemoteDevices]]


@dataclass(frozen=True)
class _Request:
    """Devices and inputs of a bake; see `bake`."""

    devices: Devices
    scene: Scene
    settings: Settings
    stages: BakeStages
    kept: SessionCache
    ship: Ship | None
    shares: bool


@dataclass(frozen=True)
class _LitPatches:
    """Patches of a bake with their direct light.

    scene:        with charts for objects without a lightmap and for back faces
    patch_scene:  the n patches
    rays:         casts rays from all patches
    lighting:     direct light, and the emission that is left to the gather
    sampled:      (n, 3) float32, E/pi of light by shadow rays, with the light of the other side
    outputs:      outputs of the bake
    store:        makes images of values of the patches
    previous:     solution of the last bake on a warm start
    remote:       devices of other processes
    notes:        report sentences on the devices that share the bake
    """

    scene: Scene
    patch_scene: PatchScene
    rays: RayScene
    lighting: DirectLighting
    sampled: np.ndarray
    outputs: Outputs
    store: LightmapImages
    previous: PreviousSolution | None
    remote: RemoteDevices | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Solved:
    """Solution of a bake of n patches.

    texels:    job and sampler of the final gathers
    solution:  the converged irradiance
    contacts:  contacts of the patches
    validity:  (n,) float32, validity from `patch_validity`
    atlases:   number of the user's lightmaps
    """

    texels: TexelGatherJob
    solution: Solution
    contacts: Contacts
    validity: np.ndarray
    atlases: int


def bake(
    devices: Devices,
    scene: Scene,
    settings: Settings,
    stages: BakeStages,
    kept: SessionCache,
    ship: Ship | None = None,
    inspect: Inspect = ignore,
    shares: bool = False,
) -> Generator[Progress, None, BakeResult]:
    """Bake a validated scene; see `engine.bake`. The devices and the session cache stay open.

    ship:     sends the scene to other processes; None to use only the given devices
    inspect:  called with the intermediate results before they are released
    shares:   True if devices of the model of the OpenCL device share a large bake
    """
    # On the first use of a device, wait for the programs of direct light. Other programs are built meanwhile.
    yield from stages.prepare(devices.compute, early=True)
    request = _Request(devices, scene, settings, stages, kept, ship, shares)
    return (yield from _current(devices, _bake(request, inspect)))


def _current(
    devices: Devices, work: Generator[Progress, None, BakeResult]
) -> Generator[Progress, None, BakeResult]:
    """Run a bake with its OpenGL context current in each slice, and translate device failures."""
    with devices.translated_failures(), closing(work):
        while True:
            devices.graphics.use()
            try:
                progress = next(work)
            except StopIteration as stop:
                lightmap: BakeResult = stop.value
                return lightmap
            yield progress


def _bake(request: _Request, inspect: Inspect) -> Generator[Progress, None, BakeResult]:
    """Run the stages of the bake."""
    settings, notes = without_opencl(request.devices, request.scene, request.settings)
    request = replace(request, settings=settings)
    stages, atlases = request.stages, request.scene.atlases

    # Patch list and direct light (III.A, IV.A).
    lit = yield from _lit_patches(request)

    # Background threads. They start late, since they would delay the first image of a warm start.
    compute, kept = request.devices.compute, request.kept
    areas, seams = kept.texels.begin(compute, lit.patch_scene, len(atlases), settings)

    # Gather iterations until convergence (III.B, IV.C).
    solved = yield from _solved(request, lit, areas)

    # Outputs at the patches, and at texel samples where texels are not uniform.
    made, gathered = yield from _made(stages, lit.outputs, solved)

    # Radiance over the sphere at the probes of volumes, from the solved patches.
    probes, probe_notes = yield from _probes(stages, solved, made)

    # Final images: denoised, equal across seams, dilated (VI.B). Reflection cubes show them.
    finishing = Finishing(lit.store, solved.texels, solved.solution, made, gathered)
    passes, cubes, cube_notes = yield from _shown(stages, finishing, solved, seams)
    inspect(_state(request, lit, solved, finishing, passes))
    warnings = (*notes, *lit.patch_scene.warnings, *lit.lighting.warnings, *probe_notes, *cube_notes)
    report = _report(request, lit, solved, finishing, warnings)
    return BakeResult(
        atlases=atlases,
        image=lit.store.image(next(iter(made.values()))) if settings.centres else lit.store.no_image,
        display=next(iter(passes.values())),
        has_patch=lit.store.has_patch,
        known=finishing.refined.known,
        report=report,
        passes=passes,
        probes=probes,
        reflections=cubes,
    )


def _state(
    request: _Request, lit: _LitPatches, solved: _Solved, finishing: Finishing, passes: dict[str, np.ndarray]
) -> BakeState:
    """Return the intermediate results of a bake; passes: its final images."""
    return BakeState(
        scene=lit.scene,
        atlases=len(request.scene.atlases),
        settings=request.settings,
        patch_scene=solved.texels.job.patch_scene,
        rays=lit.rays,
        contacts=solved.contacts,
        solution=solved.solution,
        validity=solved.validity,
        outputs=finishing.made,
        samples=finishing.lit,
        texels=finishing.refined,
        images=passes,
    )


def _report(
    request: _Request, lit: _LitPatches, solved: _Solved, finishing: Finishing, warnings: tuple[str, ...]
) -> Report:
    """Return the report of a bake.

    warnings:  of all stages but the finishing of images
    """
    graphics, compute = request.devices.graphics, request.devices.compute
    choice, solution = solved.texels.choice, solved.solution
    return Report(
        patches=len(lit.patch_scene.patches),
        method=choice.method,
        visibility=choice.visibility,
        samples=choice.samples,
        reasons=(*choice.reasons, *lit.notes, *shared_work(lit.rays), *finishing.reasons),
        iterations=solution.iterations,
        convergence_error=solution.residual,
        converged=solution.converged or not request.settings.has_indirect,
        added_flux=tuple(solution.energies),
        seconds=request.stages.seconds,
        devices={"gl": graphics.name} | ({"cl": compute.name} if compute else {}),
        warnings=(*warnings, *finishing.warnings),
        integrator=choice.integrator,
        energy=solution.energy(solved.texels.solved.patch_scene.surfaces.emission),
    )


def _lit_patches(request: _Request) -> Generator[Progress, None, _LitPatches]:
    """Return the patches with their direct light; yield its image before visibility is computed."""
    settings, stages, kept = request.settings, request.stages, request.kept
    graphics, compute = request.devices.graphics, request.devices.compute
    atlases = len(request.scene.atlases)

    # Add lightmap UVs for objects without a lightmap, and for back faces that test rays find visible.
    scene = yield from _placed(request)

    # Send the scene to the other processes, which build their ray tracing structures while this process
    # continues.
    shipped = request.ship and request.ship(scene)

    # Patch list: lightmap texels on surfaces, and their geometry. Other devices start to trace from them.
    patch_scene = kept.make_patch_scene(graphics, compute, scene, settings)
    gathers = may_gather(scene, patch_scene.surfaces, settings)
    used = int(np.count_nonzero(patch_scene.geometry.on_triangle))
    check_patches(compute, len(patch_scene.triangles.mesh), used, len(patch_scene.patches), gathers)
    rays = kept.ray_scene(graphics, compute, scene, patch_scene)
    open_peers = request.devices.peers if request.shares else None
    notes = share(rays, patch_scene, open_peers, settings, kept.samples is not None)
    store = kept.texels.images(patch_scene.patches, atlases, settings, compute)
    previous = kept.light_on(compute, patch_scene, atlases, settings)
    yield stages.listed(len(patch_scene.patches), patch_scene.surfaces.mean_reflectance)

    # Direct light: shadow rays to lights, small bright surfaces and bright sky.
    split = kept.emitters.split(scene.world, patch_scene, settings)
    remote = shipped and shipped(patch_scene, rays, split.bright)
    in_groups = remote is not None and shared_width(settings, len(patch_scene.patches)) > 1
    meanwhile = partial(kept.inside, rays) if in_groups else None
    lighting = DirectLighting(
        scene, patch_scene, rays, settings, elsewhere=remote, split=split, meanwhile=meanwhile
    )
    outputs = Outputs(scene, settings, lighting)
    lighting.follow(kept.sampled if settings.warm_start else None)
    yield from stages.build_shader(lighting.shader, ShaderBuilds(settings.cache_dir, graphics))
    sampled = yield from _direct_light(stages, store, outputs, lighting, previous, compute)
    kept.sampled = lighting.sampled_light(sampled) if settings.warm_start else None
    sampled = both_sides(patch_scene.sides, sampled)
    return _LitPatches(scene, patch_scene, rays, lighting, sampled, outputs, store, previous, remote, notes)


def _solved(
    request: _Request, lit: _LitPatches, areas: Future[np.ndarray]
) -> Generator[Progress, None, _Solved]:
    """Gather all other light until convergence, from drawn hemicubes (IV.B) or from visibility samples."""
    settings, stages, kept = request.settings, request.stages, request.kept
    compute, atlases = request.devices.compute, len(request.scene.atlases)

    # Contacts: patches covered by a touching face become black. `back_to_back` is set if two faces coincide.
    yield stages.begin(stages.choosing)
    contacts = kept.emitters.contacts(lit.lighting)
    patch_scene = replace(
        lit.patch_scene,
        surfaces=lit.patch_scene.surfaces.black_at(contacts.covered),
        back_to_back=bool(contacts.back_to_back.any()),
    )
    job = SolveJob(
        graphics=request.devices.graphics,
        compute=compute,
        patch_scene=patch_scene,
        rays=lit.rays,
        emission=lit.lighting.gathered_emission,
        sky=lit.lighting.gathered_sky,
        sampled_light=lit.sampled,
        areas=areas,
        settings=settings,
        remote=lit.remote,
        kept=kept,
        contacts=contacts,
        backs=lit.lighting.backs_left,
        mapped=patch_scene.patches.count_in(atlases),
    ).after(lit.previous)
    solution, choice, solved = choose_solver(job)
    if lit.remote and compute and choice.method != "none":
        # Prepare texel data on the host while other processes compute visibility.
        kept.texels.prepare(compute, patch_scene, atlases, settings)
    yield stages.chosen(choice)

    # The iterations also measure which patches lie inside geometry; with patch groups, the final gather does.
    texels = TexelGatherJob(lit.scene, job, solved, choice, lit.lighting)
    if lit.rays.early:
        lit.rays.early.stop()
        lit.rays.early = None
    validity = yield from _converge(stages, lit, solution, texels, contacts, atlases)
    return _Solved(texels, solution, contacts, validity, atlases)


def _placed(request: _Request) -> Generator[Progress, None, Scene]:
    """Begin the stage of patches; return the scene of `SessionCache.with_places`.

    Places add texels, so limits are checked before this work and again after it.

    Raises SettingsError if the lightmaps exceed a limit of the devices.
    """
    graphics, compute = request.devices.graphics, request.devices.compute
    scene, settings, stages = request.scene, request.settings, request.stages
    check_limits(graphics, compute, scene, settings)
    yield stages.begin(stages.patches)
    placing = request.kept.with_places(graphics, compute, scene, settings)
    placed = yield from map_progress(placing, lambda _: stages.placed())
    check_limits(graphics, compute, placed, settings)
    return placed


def _direct_light(
    stages: BakeStages,
    store: LightmapImages,
    outputs: Outputs,
    lighting: DirectLighting,
    previous: PreviousSolution | None,
    compute: ComputeDevice | None,
) -> Generator[Progress, None, np.ndarray]:
    """Return E/pi of the sampled light, (n, 3) float32, after showing it and building all other kernels.

    previous:  solution of the last bake on a warm start. Its other light is shown with direct light from few
               rays first, unless direct light is unchanged
    """
    stages.sampling(lighting.part_to_sample)
    if previous:
        store.hide(previous.validity, previous.contacts)
        if not lighting.part_to_sample:
            return (yield from stages.run(stages.direct, lighting.gather()))
    if previous and outputs.begin_with_direct:
        preview = yield from stages.run(stages.first, lighting.preview_gather())
        yield stages.lit(store.display(preview + previous.gathered))
    sampled = yield from stages.run(stages.direct, lighting.gather())
    if outputs.begin_with_direct and (previous or sampled.any()):
        yield stages.lit(store.display(sampled + previous.gathered if previous else sampled))
    yield from stages.prepare(compute, early=False)
    return sampled


def _converge(
    stages: BakeStages,
    lit: _LitPatches,
    solution: Solution,
    texels: TexelGatherJob,
    contacts: Contacts,
    atlases: int,
) -> Generator[Progress, None, np.ndarray]:
    """Iterate until convergence; return the validity of the patches from `patch_validity`.

    A warm start stores the solution for the next bake with each image. It skips the image of direct light if
    that was shown before, and images that follow faster than the display rate.

    contacts:  contacts of the patches
    atlases:   number of the user's lightmaps
    """
    job, store, outputs = texels.job, lit.store, lit.outputs
    validity = None
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
                solution, job.patch_scene.patches, job.sampled_light, contacts, job.direct_sources
            )
            job.kept.light = light.prepared() if done else light
        if done:
            validity = patch_validity(texels, atlases, contacts, solution)
            store.hide(validity, contacts)
        elif shows and not hidden:
            store.hide(solution.validity, contacts)
            hidden = True
        yield stages.iterated(solution, store.display(outputs.light(solution)) if shows else None)
    return solution.validity if validity is None else validity


def _made(
    stages: BakeStages, outputs: Outputs, solved: _Solved
) -> Generator[Progress, None, tuple[dict[str, Values], TexelSampleLight]]:
    """Return the outputs of the patches, (n, 3) or (n,) float32, by name, and texel samples with theirs."""
    texels, solution, job = solved.texels, solved.solution, solved.texels.job
    made = yield from stages.run(stages.outputs, outputs.make(solution, job.patch_scene.geometry))
    gathered = yield from stages.run(
        stages.texels,
        gather_texel_samples(
            texels, solved.atlases, solved.contacts, solution, solved.validity, stages.supersampling
        ),
    )

    # Light groups are solved separately with the visibility of the solution of all light.
    groups, samples = yield from stages.run(stages.light_groups, light_by_groups(texels, solution, gathered))
    made |= groups
    names = output_names(texels.scene, job.settings)
    return {name: made[name] for name in names}, replace(gathered, values=gathered.values | samples)


def _probes(
    stages: BakeStages, solved: _Solved, made: dict[str, Values]
) -> Generator[Progress, None, tuple[tuple[ProbeGrid, ...], tuple[str, ...]]]:
    """Return the light of the probe volumes, and warnings; both are empty unless probes are baked.

    made:  outputs of the patches by name; probes use the maps of light groups
    """
    texels = solved.texels
    if not (texels.job.settings.light_probes and texels.scene.probe_volumes):
        return (), ()
    # Few bakes need these modules, which take 20 ms to import.
    from .probes.gather_probes import gather_probes, probe_warnings

    warnings = probe_warnings(texels)
    if texels.job.compute is None:
        return (), warnings
    groups = {
        name.removeprefix(LIGHT_GROUP): light for name, light in made.items() if name.startswith(LIGHT_GROUP)
    }
    gathering = gather_probes(texels, solved.solution, solved.validity, solved.contacts, groups)
    return (yield from stages.run(stages.probes, gathering)), warnings


def _shown(
    stages: BakeStages, finishing: Finishing, solved: _Solved, seams: Future[Seams] | None
) -> Generator[Progress, None, tuple[dict[str, np.ndarray], tuple[ReflectionCube, ...], tuple[str, ...]]]:
    """Return the final images by output, the reflection cubes that show them, and warnings.

    seams:  pairs of points with equal light; None to leave seams visible
    """
    texels = solved.texels
    images = yield from finishing.images(stages, seams)
    if not (texels.job.settings.reflection_cubes and texels.scene.reflection_spheres):
        return images, (), ()
    from .reflections.gather_reflections import gather_reflections, reflection_warnings

    warnings = reflection_warnings(texels)
    if texels.job.compute is None:
        return images, (), warnings
    gathering = gather_reflections(texels, solved.solution, solved.validity, solved.contacts, images)
    cubes, notes = yield from stages.run(stages.reflections, gathering)
    return images, cubes, (*warnings, *notes)
