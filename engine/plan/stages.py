"""Stages of a bake with their amounts of work and costs."""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..outputs import OUTPUTS
from ..progress import Progress, Schedule, Stage
from ..scene.cutouts import is_tinted
from ..scene.light_groups import light_group_names
from ..scene.model import Scene, shining_lights
from ..settings import MOST_LIGHTS, Settings
from ..visibility.sample_counts import expected_samples
from .iterations_left import iterations_left

if TYPE_CHECKING:
    from ..device.cl_device import ComputeDevice
    from ..device.program_cache import Preparation
    from ..direct.shader_shadow_rays import ShaderShadowRays
    from ..solve.solution import Solution
    from ..visibility.rays.shaders.shader_builds import ShaderBuilds
    from .solver_choice import SolverChoice

#: Guessed seconds, until measured, to open devices and to choose a method.
_OPENING, _CHOOSING = 0.5, 0.5

#: Guessed times of the host, s: to copy one texel of an image, and to find the patch of one texel. A triangle
#: costs as much as the patches of `_TRIANGLE` texels. Measured for all patches of 1024 x 1024 texels on two
#: cores: 0.5, 1.3, 9.2 and 13.7 CPU s for 48, 5,000, 109,000 and 316,000 triangles.
_TEXEL, _LISTED, _TRIANGLE = 1e-7, 2e-6, 8

#: Guessed seconds of a CPU for each ray or hemicube texel, and for each shadow ray; chosen for a machine that
#: is less busy than the one of tests/blender/test_paces.py. There, two levels took 4e-7 to 1.6e-6 s a ray and
#: 3e-7 to 6e-7 s a shadow ray on two cores.
_RAY, _SHADOW_RAY = 2e-7, 1e-7

#: Guessed seconds of a CPU to denoise a texel, with the second gather that measures the noise. 1024 x 1024
#: texels took 43 to 76 s on two cores that other programs used to two thirds.
_FILTERED = 1.5e-5

#: Cost of the choice of a method, which contacts and areas precede, relative to `_CHOOSING`: of any, and of a
#: triangle and a texel. Measured: 0.08 s in a room of 192 x 192 texels, 4 s with 316,000 triangles and 1024 x
#: 1024 texels.
_CHOSEN, _CHOSEN_TRIANGLE, _CHOSEN_TEXEL = 0.1, 2.4e-5, 2e-6

#: Cost of a cached sample, as a fraction of computing it: a guess before any visibility is timed, and the
#: fraction after that. Measured with PoCL: 0.0015 in a level, 0.0045 in the Cornell box, 0.019 in a living
#: room.
_LOOK_UP, _ITERATED = 0.02, 0.01

#: Seconds in which the first bake on a CPU loads the programs of each stage, and starts their first kernels.
#: Measured with PoCL in CPU s, as the difference of the first and second bake of a session.
_LOADING = {"patches": 0.13, "choosing": 0.15, "bounces": 0.02, "texels": 0.07, "images": 0.05}

#: Assumed fraction of lightmap texels that are patches, and their mean reflectance. Own charts covered 0.76
#: to 0.94 of lightmaps of 256 x 256 to 1024 x 1024 texels.
COVERAGE, _REFLECTANCE = 0.8, 0.6

#: Assumed fraction of patches at edges, times the root of patches per triangle: edges are lines, so their
#: length grows with the root of the number of triangles.
_EDGES = 0.5

#: Assumed fraction of samples that adaptive bakes compute: at least, for each patch at an edge, and at most.
#: Measured at 1024 x 1024 texels, with the final gather: 24 % in a room of 48 triangles, 68 % in a living
#: room of 5,000, 60 % in a level of 109,000.
_ADAPTED, _ADAPTED_OF_EDGE, _MOST_ADAPTED = 0.25, 11, 0.7

#: Assumed fraction of patches with supersampled texels in light groups, samples per texel at which fractions
#: were measured, and maximum fraction of patches at edges. Work grows with the root of the samples (measured
#: for 4 and 16). Measured at 1024 x 1024 texels: 0.3 % of a room of 48 triangles, 5 % of a living room of
#: 5,000, 23 and 15 % of levels of 109,000 and 316,000. In small lightmaps the light of neighbours differs
#: more: `_BORDERS` divided by the root of the patches is added. Measured: 34 and 13 % of nine squares in a
#: room with 741 and 12,143 patches.
_REFINED, _REFINED_SAMPLES, _MOST_REFINED, _BORDERS = 0.1, 4, 0.25, 4

#: Samples of a texel of a reflection cube: four rays, and filters that take as long (measured).
_CUBE_SAMPLES = 8

#: Names of the paces of visibility samples.
_FINDING = ("Visibility rays", "Visibility raster")

#: Duration in seconds below which a stage is too short to predict a longer one.
_SHORTEST = 0.02

#: Seconds of a stage at which its new pace counts as much as the stored pace (chosen).
_LONG = 1.0

#: Name of stages that wait for programs to be built, and seconds between two polls.
PREPARING, _POLL = "Preparing for this device (once)", 0.02

#: Number of progress reports, `_POLL` apart, before a shader build that blocks: the window shows one of them
#: (chosen).
_REPORTS = 5

#: Minimum time between two images of Live, s.
_BETWEEN_IMAGES = 0.02


@dataclass(frozen=True)
class Extent:
    """Size of a scene: numbers of lightmaps, triangles, lights with nonzero strength, and light groups.

    tinted:  True if a surface tints transmitted light, which makes visibility samples larger
    probes:  number of light probes
    cubes:   number of reflection cubes
    """

    atlases: int
    triangles: int
    lamps: int
    light_groups: int = 1
    tinted: bool = False
    probes: int = 0
    cubes: int = 0

    @classmethod
    def of(cls, scene: Scene) -> Extent:
        """Return the extent of a scene."""
        triangles = sum(len(mesh.positions) for mesh in scene.meshes)
        groups = len(light_group_names(scene))
        lamps = len(shining_lights(scene))
        probes = sum(volume.count for volume in scene.probe_volumes)
        cubes = len(scene.reflection_spheres)
        return cls(len(scene.atlases), triangles, lamps, groups, is_tinted(scene), probes, cubes)


def _filtered_images(settings: Settings) -> int:
    """Return the number of images that the denoiser filters for each lightmap; signed maps are two images."""
    return sum(OUTPUTS[name].denoised_images for name in settings.outputs)


def _probe_rays(extent: Extent, settings: Settings) -> int:
    """Return the number of rays of all light probes."""
    shadow_rays = settings.light_samples * min(extent.lamps + 1, MOST_LIGHTS)
    return extent.probes * settings.light_probes * (settings.probe_samples + shadow_rays)


def _cube_samples(extent: Extent, settings: Settings) -> int:
    """Return the number of rays and filter samples of all reflection cubes together."""
    return _CUBE_SAMPLES * 6 * settings.reflection_size**2 * extent.cubes * settings.reflection_cubes


class BakeStages(Schedule):
    """Schedule of a bake; each stage has its own unit of work.

        starting   once                    visibility  samples of patches
        patches    texels                  bounces     samples of patches, times iterations
        first      shadow rays             final       samples of patches
        direct     shadow rays             outputs     rays
        choosing   once                    denoising   texels
        texels     samples of patches      images      texels
        light_groups  samples of patches   probes      rays
        reflections   samples

    paces:  seconds for each unit of each stage in earlier bakes, by name; `update_paces` updates them
    """

    def __init__(self, extent: Extent, settings: Settings, paces: dict[str, float]) -> None:
        self._settings, self._paces = settings, paces
        self._lamps, self._light_groups, self._triangles = extent.lamps, extent.light_groups, extent.triangles
        self._residuals: list[float] = []
        self._reflectance = _REFLECTANCE
        self._names: dict[Stage, str] = {}
        self._samples_of_sweep, self._kept, self._found, self._name = 0, False, False, ""
        self._shown = -math.inf
        texels = settings.resolution**2 * extent.atlases
        self.starting = self._stage("Starting", 1, _OPENING)
        self.early_preparing, self.preparing = Stage(PREPARING, 0), Stage(PREPARING, 0)
        self.patches = self._stage("Preparing texels", texels + _TRIANGLE * extent.triangles, _LISTED)
        self.first = self._stage("First light", 0, _SHADOW_RAY)
        self.direct = self._stage("Direct light", 0, _SHADOW_RAY)
        choosing = _CHOSEN + _CHOSEN_TRIANGLE * extent.triangles + _CHOSEN_TEXEL * texels
        self.choosing = self._stage("Choosing method", choosing, _CHOOSING)
        self.visibility = self._stage("Visibility", 0, _RAY)
        self.bounces = self._stage("Bounces", 0, _RAY * _LOOK_UP)
        self.bounces.like, self.bounces.ratio = self.visibility, _ITERATED
        self.final = self._stage("Final gather", 0, _RAY)
        self.final.like = self.visibility
        self.outputs = self._stage("Outputs", 0, _RAY)
        self.texels = self._stage("Supersampling", 0, _RAY)
        self.texels.like = self.visibility
        self.light_groups = self._stage("Light groups", 0, _RAY)
        self.light_groups.like = self.visibility
        self.probes = self._stage("Light probes", _probe_rays(extent, settings), _RAY)
        self.reflections = self._stage("Reflection cubes", _cube_samples(extent, settings), _RAY)
        more = (extent.light_groups - 1) * settings.by_light_groups
        filtered = texels * (_filtered_images(settings) + more) if settings.denoise else 0
        self.denoising = self._stage("Denoising", filtered, _FILTERED)
        maps = sum(len(OUTPUTS[name].maps) or 1 for name in settings.outputs) + more
        self.images = self._stage("Finishing lightmaps", texels * maps, _TEXEL)
        gathering = (self.visibility, self.bounces, self.final, self.texels, self.light_groups)
        self._casting = (self.first, self.direct, self.outputs, self.probes, self.reflections, *gathering)
        names = list(self._names)
        after = names.index(self.direct) + 1
        super().__init__([names[0], self.early_preparing, *names[1:after], self.preparing, *names[after:]])
        self._size(int(COVERAGE * texels))
        self.begin(self.starting)

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time, s, by the names of `Report.seconds`."""
        solving = (self.choosing, self.visibility, self.bounces, self.final)
        return {
            "devices": self.starting.seconds,
            "patches": self.patches.seconds,
            "direct": self.direct.seconds,
            "hemicubes": sum(stage.seconds for stage in solving),
            "outputs": self.outputs.seconds + self.images.seconds,
            "texels": self.texels.seconds,
            "light groups": self.light_groups.seconds,
            "light probes": self.probes.seconds,
            "reflection cubes": self.reflections.seconds,
            "denoising": self.denoising.seconds,
        }

    def opened(self, speed: float, first: bool = False) -> None:
        """Scale expected times by the speed of casting rays; in a first bake, add the time to load programs.

        speed:  relative to OpenCL on a CPU, see `rates.ray_speed`
        first:  True if the programs of this device were not loaded before
        """
        if first and speed <= 1:
            for name, seconds in _LOADING.items():
                getattr(self, name).overhead = seconds
        self.scale(speed)
        self.end()

    def scale(self, speed: float) -> None:
        """Divide the guessed paces of casting rays by a speed."""
        for stage in self._casting:
            if not stage.measured:
                stage.pace /= speed

    def prepare(self, compute: ComputeDevice | None, early: bool) -> Generator[Progress, None, None]:
        """Wait until other processes have built the programs for the device.

        early:  True to wait only for the programs that direct light needs
        """
        if compute is None or compute.preparation(early) is None:
            return
        stage = self.early_preparing if early else self.preparing
        self.begin(stage)
        for _ in compute.build_own():
            yield self._prepared(stage, compute.preparation(early))
        while (left := compute.preparation(early)) is not None:
            yield self._prepared(stage, left)
            time.sleep(_POLL)
        yield self.end()

    def build_shader(
        self, shader: ShaderShadowRays | None, builds: ShaderBuilds
    ) -> Generator[Progress, None, None]:
        """Build the shader of direct light, unless this driver has built it before; None for no shader.

        The driver builds in one call, so the stage is reported before, and until a window has shown it.
        """
        if shader is None or builds.has(shader.program_digest):
            return
        self.begin(self.early_preparing)
        self.early_preparing.amount, self.early_preparing.forecast = 1, builds.expected_seconds
        for _ in range(_REPORTS):
            self.advance(0)
            yield self.progress(0.0, f"{PREPARING}: 0 of 1")
            time.sleep(_POLL)
        began = time.perf_counter()
        shader.build()
        builds.keep(shader.program_digest, time.perf_counter() - began)
        yield self.end()

    def _prepared(self, stage: Stage, left: Preparation | None) -> Progress:
        """Return the progress of a preparation."""
        if left is None:
            return self.end()
        stage.amount, stage.forecast = left.total, left.seconds_left
        self.advance(left.done)
        return self.progress(left.done / left.total, f"{PREPARING}: {left.done} of {left.total}")

    def estimate_seconds(self, patches: int) -> float:
        """Return the expected seconds of a bake of `patches` patches, before it starts."""
        found = [name for name in _FINDING if name in self._paces]
        for name in sorted(found, key=self._paces.__getitem__)[:1]:
            self._foresee(self.visibility, name, _RAY)
            self._foresee(
                self.bounces, name.replace("Visibility", "Bounces cached"), self.visibility.pace * _ITERATED
            )
        self._kept = True
        self._size(patches)
        return sum(stage.seconds_left for stage in self._names)

    def placed(self) -> Progress:
        """Return the progress of work before the patch list, which reports no fraction."""
        self.advance(self.current.done)
        return self.progress(0.0)

    def listed(self, patches: int, reflectance: float) -> Progress:
        """Set the number of patches and their mean reflectance; end the stage that lists them."""
        self._reflectance = reflectance
        self._size(patches)
        return self.end()

    def supersampling(self, samples: int, rays: int) -> None:
        """Set the numbers of texel samples, and of the rays of each."""
        self.texels.amount = samples * rays

    def sampling(self, part: float) -> None:
        """Set the fraction of patches that cast shadow rays."""
        self.first.amount *= part
        self.direct.amount *= part

    def lit(self, image: np.ndarray) -> Progress:
        """Return the progress after direct light, with lightmaps that hold only direct light."""
        self._shown = time.perf_counter()
        return self.progress(1.0, self.direct.name, intermediate=image)

    def chosen(self, choice: SolverChoice) -> Progress:
        """Set the chosen gather; end the stage that chooses it."""
        self._kept, self._found = choice.method == "cached", choice.found
        self._samples_of_sweep = choice.patches * choice.samples
        finding, looking = f"Visibility {choice.visibility}", f"Bounces {choice.method} {choice.visibility}"
        again = " again" if choice.found_again else ""
        self._foresee(self.visibility, finding + again, self.visibility.pace, choice.pace)
        self._foresee(self.final, f"Final {choice.visibility}", self.visibility.pace)
        self.bounces.ratio = _ITERATED if self._kept else 1.0
        self._foresee(self.bounces, looking, self.visibility.pace * self.bounces.ratio)
        self.visibility.amount = self._samples_of_sweep * (1 - choice.resumed) if self._samples_first else 0
        self.final.amount = choice.final_samples
        self._expect_sweeps()
        return self.end()

    def iterate(self, solution: Solution) -> Generator[Progress, None, None]:
        """Run one iteration of a solution."""
        stage, self._name = self._stage_of_iteration(solution)
        self.begin(stage)
        yield self._about(solution, 0.0)
        before, amount = stage.done, self._samples_of_sweep if stage is self.bounces else stage.amount
        for fraction in solution.iteration():
            if self.due:
                self.advance(before + fraction * amount)
                yield self._about(solution, fraction)
        self._residuals.append(solution.residual)
        self.advance(before + amount)
        self._expect_sweeps()

    @property
    def has_shown(self) -> bool:
        """True if any lightmaps were shown."""
        return self._shown > -math.inf

    @property
    def image_due(self) -> bool:
        """True if the last lightmaps were shown long enough ago; GPUs iterate faster than a display shows."""
        return time.perf_counter() - self._shown >= _BETWEEN_IMAGES

    def iterated(self, solution: Solution, image: np.ndarray | None) -> Progress:
        """Return the progress after an iteration, with the current lightmaps."""
        self._shown = self._shown if image is None else time.perf_counter()
        self.advance(self.current.done)
        return self._about(solution, 1.0, image)

    def update_paces(self) -> None:
        """Store the paces of this bake for the next one, except the pace of reused patches.

        Fixed costs dominate short stages, so these weigh little against the pace of earlier bakes or the
        expected one. The mean of both is geometric, as in `Stage`.
        """
        for stage, name in self._names.items():
            if stage is self.patches and self._found:
                continue
            if stage.seconds > _SHORTEST and stage.own_pace > 0:
                trust = stage.seconds / (stage.seconds + _LONG)
                before = self._paces.get(name, stage.expected_pace) or stage.own_pace
                self._paces[name] = before ** (1 - trust) * stage.work_pace**trust

    def _stage(self, name: str, amount: float, guess: float) -> Stage:
        stage = Stage(name, amount)
        self._foresee(stage, name, guess)
        return stage

    def _foresee(self, stage: Stage, name: str, guess: float, tried: float = math.nan) -> None:
        """Set the pace of a stage: from a trial, else from an earlier bake, else a guess."""
        self._names[stage] = name
        stage.measured = not math.isnan(tried) or name in self._paces
        stage.pace = self._paces.get(name, guess) if math.isnan(tried) else tried

    def _size(self, patches: int) -> None:
        """Set the amounts of work that depend on the number of patches."""
        settings = self._settings
        self.direct.amount = patches * settings.light_samples * min(self._lamps + 1, MOST_LIGHTS)
        edges = _EDGES * math.sqrt(self._triangles / max(1, patches))
        adapted = min(_ADAPTED + _ADAPTED_OF_EDGE * edges, _MOST_ADAPTED) if settings.adaptive else 1
        self.visibility.amount = patches * expected_samples(settings) * adapted
        self._samples_of_sweep = int(self.visibility.amount)
        entries = [OUTPUTS[name] for name in settings.outputs if OUTPUTS[name].ray_setting]
        rays: float = sum(
            getattr(settings, entry.ray_setting) * (self._lamps if entry.rays_per_light else 1)
            for entry in entries
        )
        self.outputs.amount = patches * rays + _LOOK_UP * self._samples_of_sweep * settings.directional
        if settings.texel_samples > 1 and settings.method != "paper":
            more = math.sqrt(settings.texel_samples / _REFINED_SAMPLES)
            refined = min(edges + _BORDERS / math.sqrt(max(1, patches)), _MOST_REFINED) * patches
            self.texels.amount = more * refined * expected_samples(settings)
        if settings.by_light_groups:
            self.light_groups.amount = self._light_groups * (_REFINED * patches * expected_samples(settings))
        self._expect_sweeps()

    def _expect_sweeps(self) -> None:
        """Set the amount of work of the remaining bounces."""
        sweeps = iterations_left(self._residuals, self._settings, self._reflectance)
        if self._samples_first and not self._residuals:
            sweeps -= 1
        self.bounces.amount = self.bounces.done + sweeps * self._samples_of_sweep

    @property
    def _samples_first(self) -> bool:
        """True if the first iteration computes the samples that later ones look up."""
        return self._kept and not self._found

    def _stage_of_iteration(self, solution: Solution) -> tuple[Stage, str]:
        """Return the stage of the next iteration, and its name."""
        if solution.gathers_finally:
            return self.final, self.final.name
        if self._samples_first and not self._residuals:
            return self.visibility, self.visibility.name
        return self.bounces, f"Bounce {solution.iterations + 1}"

    def _about(self, solution: Solution, fraction: float, image: np.ndarray | None = None) -> Progress:
        """Return the progress with facts about a solution."""
        energies = solution.energies
        return self.progress(
            fraction, self._name, iteration=solution.iterations, residual=solution.residual,
            energy=energies[-1] if energies else 0.0, intermediate=image,
        )  # fmt: skip
