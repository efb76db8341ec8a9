"""Chooses how patches gather: by memory, and by timing what could be used on the scene itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyopencl as cl

from ..device.compute import Compute
from ..device.graphics import Graphics
from ..errors import DeviceError
from ..gather.cached import CachedSweep, RayStreamSweep, StreamSweep
from ..gather.final_gather import FinalGather
from ..gather.glsl_cached import fits_glsl_cache
from ..gather.hemicube_gather import GlslGather, PaperGather
from ..gather.sweep import Sweep
from ..patches.subdivision import Subdivision
from ..scene.model import Scene
from ..settings import Settings
from ..solve.anderson import COLUMNS
from ..solve.darkness import Darkness
from ..solve.device_radiosity import DeviceRadiosity
from ..solve.grouped_solution import GroupedSolution
from ..solve.host_radiosity import HostRadiosity
from ..solve.patch_groups import PatchGroups
from ..solve.solver import PLAIN_COLUMNS, Radiosity, Solution, Solver
from ..visibility.identity import Identity, SeenBuffers, Surroundings, sample_bytes, surroundings
from ..visibility.raster.identity import RasterIdentity
from ..visibility.raster.tiles import IDENTITY_BYTES, plan_tiles
from ..visibility.rays.identity import RayIdentity, ray_count
from ..visibility.rays.ray_scene import RayScene

#: Patches that are tried first, how many times more the next try takes, and when a try is long enough, s.
_TRIED, _MORE, _LONG_ENOUGH = 32, 8, 0.01

#: If rays take less than this for all patches, drawing is not tried: the trial would take about as long, s.
_SHORT = 0.5

#: Width of the squares of patches that are solved as one where memory is short, texels.
_GROUP_WIDTH = 4


@dataclass(frozen=True)
class Choice:
    """How patches gather.

    method      "paper", "cached" or "stream"; "none" where there is no light to gather
    visibility  "raster" or "rays"; "none" where nothing is looked for
    samples     of each patch
    reasons     sentences that say why
    integrator  what sums up, "opencl" or "glsl"
    """

    method: str
    visibility: str
    samples: int
    reasons: tuple[str, ...]
    integrator: str = "opencl"


@dataclass(frozen=True)
class Bake:
    """What a choice is made for.

    emission  (n, 3) float32, radiance of each patch that the patches themselves see
    sky       (h, w, 3) float32, radiance, equirectangular, as patches see it
    lights    (n, 3) float32, E/pi of lights that patches do not gather
    area      (n,) float32, m^2, of each patch
    """

    graphics: Graphics
    compute: Compute | None
    scene: Scene
    parts: Subdivision
    rays: RayScene
    emission: np.ndarray
    sky: np.ndarray
    lights: np.ndarray
    settings: Settings
    area: np.ndarray

    @property
    def opencl(self) -> Compute:
        """The OpenCL device; raises DeviceError if there is none."""
        if self.compute is None:
            raise DeviceError("Only what OpenGL can do alone is possible without OpenCL.")
        return self.compute

    @cached_property
    def around(self) -> Surroundings:
        """What patches see beside each other's fronts, on the OpenCL device."""
        return surroundings(self.opencl, self.emission, self.sky)

    @property
    def budget(self) -> int:
        """The device memory that the samples of patches may take, bytes: half of it unless told."""
        memory = self.opencl.device.global_mem_size
        return min(self.settings.memory_budget or memory // 2, memory)

    @property
    def columns(self) -> int:
        """Iterates that the solver keeps: more if sweeps are accelerated."""
        settings = self.settings
        accelerated = settings.accelerate and settings.method != "paper" and settings.bounces
        return COLUMNS if accelerated else PLAIN_COLUMNS

    @property
    def glowing(self) -> bool:
        """True if patches gather light before any is reflected."""
        return bool(self.emission.any() or self.sky.any())

    @property
    def dark(self) -> bool:
        """True if no light reaches any patch, and nothing but light is asked for."""
        lit = self.glowing or self.lights.any()
        return not lit and self.settings.light_outputs == self.settings.outputs


def choose_solver(bake: Bake) -> tuple[Solution, Choice]:
    """Return what solves a bake's light, and the way that was chosen for patches to gather."""
    if bake.dark:
        why = "No light reaches any patch: nothing is looked for."
        return Darkness(len(bake.parts.patches)), Choice("none", "none", 0, (why,))
    width, reasons = _choose_width(bake)
    return _solver(bake) if width == 1 else _grouped_solution(bake, width, reasons)


def _solver(bake: Bake) -> tuple[Solver, Choice]:
    """Return what solves for every patch on its own."""
    radiosity: Radiosity
    if bake.settings.method == "paper":
        radiosity, choice = _paper(bake)
    else:
        radiosity, choice = _without_opencl(bake) if bake.compute is None else _identities(bake)
    return Solver(radiosity, bake.lights, bake.settings, bake.glowing), choice


def _choose_width(bake: Bake) -> tuple[int, tuple[str, ...]]:
    """Return how wide the squares of patches are that are solved as one, texels, and why."""
    settings, count = bake.settings, len(bake.parts.patches)
    if bake.compute is None or settings.method == "paper" or not settings.bounces:
        return 1, ()
    if settings.patch_groups:
        return settings.patch_groups, ("The settings ask for groups of patches.",)
    needed, budget = _most_samples(settings) * count * sample_bytes(count), bake.budget
    if settings.method != "auto" or needed <= budget:
        return 1, ()
    why = f"what all patches see takes {needed / 2**20:,.0f} MiB, {budget / 2**20:,.0f} MiB may be used"
    return _GROUP_WIDTH, (f"Squares of {_GROUP_WIDTH} x {_GROUP_WIDTH} patches are solved as one: {why}.",)


def _most_samples(settings: Settings) -> int:
    """Return how many samples a patch may have, whichever way is taken to find what it sees."""
    hemicube, rays = 3 * settings.hemicube**2, ray_count(settings)
    cast = hemicube if settings.directions == "hemicube" else rays
    return {"raster": hemicube, "rays": cast, "auto": max(hemicube, cast)}[settings.visibility]


def _grouped_solution(bake: Bake, width: int, reasons: tuple[str, ...]) -> tuple[GroupedSolution, Choice]:
    """Return what solves for squares of patches, then gathers for each patch."""
    groups = PatchGroups(bake.rays, bake.parts, width)
    emission, lights = groups.mean(bake.emission), groups.mean(bake.lights)
    squares = replace(
        bake, parts=groups.parts, rays=groups.rays, emission=emission, lights=lights, area=groups.area
    )
    solver, choice = _solver(squares)

    # Every patch looks for itself, but sees the groups.
    lookups = replace(bake.parts, texel_to_patch=groups.parts.texel_to_patch)
    everyone = replace(squares, parts=lookups, rays=bake.rays)
    identity = _identity_makers(everyone)[choice.visibility]()
    final = FinalGather(bake.opencl, _stream(everyone, identity), bake.lights)
    parted = bake.glowing and bool({"direct", "indirect"} & set(bake.settings.outputs))
    solution = GroupedSolution(solver, groups, final, bake.lights, emission, parted)
    return solution, replace(choice, reasons=(*reasons, *choice.reasons))


def _identities(bake: Bake) -> tuple[Radiosity, Choice]:
    identity, reasons = _choose_identity(bake)
    sweep, method, reason = _choose_sweep(bake, identity)
    reflectance = bake.parts.surfaces.reflectance
    radiosity = DeviceRadiosity(
        bake.opencl, sweep, reflectance, bake.around.emission, bake.area, bake.lights, bake.glowing,
        bake.columns,
    )  # fmt: skip
    return radiosity, Choice(method, identity.name, identity.samples, (*reasons, reason))


def _paper(bake: Bake) -> tuple[Radiosity, Choice]:
    settings, reflectance = bake.settings, bake.parts.surfaces.reflectance
    gather = PaperGather(
        bake.graphics, bake.compute, bake.scene, bake.parts, bake.emission, bake.sky, settings
    )
    radiosity = HostRadiosity(gather, reflectance, bake.emission, bake.area, bake.lights, bake.glowing)
    reason = "Hemicubes are drawn anew in every iteration: the settings ask for the paper's method."
    choice = Choice("paper", "raster", 3 * settings.hemicube**2, (reason,), gather.integrator)
    return radiosity, choice


def _without_opencl(bake: Bake) -> tuple[Radiosity, Choice]:
    settings, count = bake.settings, len(bake.parts.patches)
    if not fits_glsl_cache(bake.graphics, plan_tiles(settings, count, IDENTITY_BYTES), count):
        return _paper(bake)
    gather = GlslGather(bake.graphics, bake.scene, bake.parts, bake.emission, bake.sky, settings)
    reflectance = bake.parts.surfaces.reflectance
    radiosity = HostRadiosity(
        gather, reflectance, bake.emission, bake.area, bake.lights, bake.glowing, bake.columns
    )
    reason = "Hemicubes are drawn once and summed by OpenGL: there is no OpenCL."
    return radiosity, Choice("cached", "raster", 3 * settings.hemicube**2, (reason,), "glsl")


def _identity_makers(bake: Bake) -> dict[str, Callable[[], Identity]]:
    """Return what makes each way to find what patches see, first the one that is quickly tried."""
    return {
        "rays": lambda: RayIdentity(bake.opencl, bake.rays, bake.parts, bake.around, bake.settings),
        "raster": lambda: RasterIdentity(
            bake.graphics, bake.opencl, bake.scene, bake.parts, bake.around, bake.settings
        ),
    }


def _choose_identity(bake: Bake) -> tuple[Identity, list[str]]:
    """Return the way to find what patches see, the faster one if the settings leave it open."""
    wanted, makers = bake.settings.visibility, _identity_makers(bake)
    if wanted != "auto":
        return makers[wanted](), [f"The settings ask for {wanted}."]
    count, tried, rates = len(bake.parts.patches), {}, {}
    for name, make in makers.items():
        tried[name] = make()
        rates[name] = _patches_per_second(bake.opencl, tried[name], count, bake.budget)
        if rates[name] * _SHORT > count * _sweeps(bake, tried[name]):
            break
    best = max(rates, key=lambda name: rates[name])
    told = " and ".join(f"{name} {rate:,.0f} ({tried[name].samples} samples)" for name, rate in rates.items())
    reasons = [f"Views of patches found in a second: {told}."]
    if len(tried) < len(makers):
        reasons.append(f"Nothing else was tried: {best} find all of them in {count / rates[best]:.2g} s.")

    # The memory of what was rejected is free for the bake.
    chosen = tried.pop(best)
    tried.clear()
    bake.graphics.collect()
    return chosen, reasons


def _choose_sweep(bake: Bake, identity: Identity) -> tuple[Sweep, str, str]:
    """Return how identities become light, the method's name, and why."""
    count = len(bake.parts.patches)
    needed, budget = identity.row_bytes * count / 2**20, bake.budget / 2**20
    sizes = f"what patches see takes {needed:,.0f} MiB, {budget:,.0f} MiB may be used"
    if _sweeps(bake, identity) == 1:
        return CachedSweep(bake.opencl, identity, count), "cached", f"It is kept: {sizes}."
    why = f"It is found anew in every iteration: {sizes}."
    if bake.settings.method == "stream":
        why = "It is found anew in every iteration: the settings ask for it."
    return _stream(bake, identity), "stream", why


def _sweeps(bake: Bake, identity: Identity) -> int:
    """Return how often what patches see is found: once if it can be kept, else in every iteration."""
    kept = bake.settings.method != "stream" and identity.row_bytes * len(bake.parts.patches) <= bake.budget
    return 1 if kept else max(2, bake.settings.iterations)


def _stream(bake: Bake, identity: Identity) -> Sweep:
    """Return how identities become light without being kept."""
    count = len(bake.parts.patches)
    if isinstance(identity, RayIdentity):
        return RayStreamSweep(bake.opencl, identity, count)
    most = min(bake.budget, bake.settings.batch_bytes)
    return StreamSweep(bake.opencl, identity, count, most // identity.row_bytes)


def _patches_per_second(compute: Compute, identity: Identity, count: int, budget: int) -> float:
    """Return how many patches' views an identity finds in a second, timed on more and more of them.

    What any number of patches takes, as the copy of a whole batch of hemicubes, is not counted.
    """
    tried, before = min(_TRIED, count), (0, 0.0)
    largest = max(tried, min(compute.device.max_mem_alloc_size, budget) // identity.row_bytes)
    _time(compute, identity, count, tried)
    while True:
        seconds = _time(compute, identity, count, tried)
        if seconds > _LONG_ENOUGH or tried == min(count, largest):
            return (tried - before[0]) / max(seconds - before[1], seconds / 4)
        before = tried, seconds
        tried = min(tried * _MORE, count, largest)


def _time(compute: Compute, identity: Identity, count: int, tried: int) -> float:
    """Return the seconds that the views of some patches in the middle take."""
    first = (count - tried) // 2
    sizes = (identity.row_bytes * tried, 16 * count, 4 * count)
    cache, static_light, seen = (cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size) for size in sizes)
    began = time.perf_counter()
    for _ in identity.find(first, first + tried, SeenBuffers(cache, first, static_light, seen)):
        pass
    compute.queue.finish()
    return time.perf_counter() - began
