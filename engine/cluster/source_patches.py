"""Sources on a worker's device: patches or patch groups from which blocks gather."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property

from ..device.buffers import zeros
from ..device.devices import Devices
from ..device.opencl import cl
from ..direct.emitter_split import EmitterSplit
from ..direct.lighting import DirectLighting
from ..direct.sky import Sky
from ..gather.half_radiance import HalfRadiance
from ..plan.choose_solver import light_alone
from ..plan.session_cache import SessionCache
from ..plan.solve_job import SolveJob
from ..plan.solver_choice import SolverChoice
from ..probes.gather_probes import ProbeGather
from ..probes.sent_light import SentRadiance
from ..scene.model import Scene
from ..settings import Settings
from ..texel_gather.texel_sample_points import TexelGatherJob
from .patch_rows import SentRows, unpacked
from .patch_table import PatchTable, SceneTable
from .radiance_exchange import MappedRadiance
from .triangle_scene import TriangleScene


class SourcePatches:
    """Patches or patch groups that send out light, on the device of a worker.

    name:  name of their `PatchTable`
    job:   radiosity problem with these patches as sources only; none of them receives light
    """

    def __init__(
        self, devices: Devices, triangles: TriangleScene, settings: Settings, sky: Sky, table: PatchTable
    ) -> None:
        """Create the sources of a table, and the background."""
        self._devices, self._triangles, self.name = devices, triangles, table.name
        self._light: HalfRadiance | MappedRadiance | None = None
        compute, emission = devices.compute, table.emission
        self._count, seen = emission.count, emission.of_all()
        patch_scene = triangles.seen(
            settings.resolution, seen, table.texel_to_patch.opened(), table.back_to_back
        )
        none, rays = seen[:0], triangles.rays.of(patch_scene)
        self.job = SolveJob(
            graphics=devices.graphics,
            compute=compute,
            patch_scene=patch_scene,
            rays=rays,
            emission=seen,
            sky=sky.rest,
            sampled_light=none,
            areas=none[:, 0],
            settings=light_alone(settings),
        )

    @contextmanager
    def working(self) -> Iterator[None]:
        """Run work on the devices of this worker; convert their failures to DeviceError."""
        self._devices.graphics.use()
        with self._devices.translated_failures():
            yield

    def part(self, rows: SentRows) -> SolveJob:
        """Return a job whose receivers are the patches of these rows."""
        triangles, job = self._triangles, self.job
        opened = unpacked(rows).opened(triangles.triangles, triangles.steps, job.settings.resolution)
        patch_scene = job.patch_scene.seen_from(*opened)
        return replace(job, patch_scene=patch_scene, rays=job.rays.of(patch_scene), kept=SessionCache())

    def table(self, light: HalfRadiance | MappedRadiance) -> cl.Buffer:
        """Upload the radiance of all sources, once for all blocks of an iteration."""
        if light != self._light:
            opened = light.opened() if isinstance(light, MappedRadiance) else light
            self._light, self._table = light, opened.table(self.job.opencl)
        return self._table

    @cached_property
    def darkness(self) -> cl.Buffer:
        """Zero radiance of all sources, on the device."""
        return zeros(self.job.opencl, 16 * (self._count + 2))


class ScenePatches(SourcePatches):
    """Patches of a scene as sources.

    lighting:  direct lighting by shadow rays
    """

    def __init__(
        self,
        devices: Devices,
        triangles: TriangleScene,
        settings: Settings,
        sky: Sky,
        table: SceneTable,
        scene: Scene,
    ) -> None:
        """Create the sources of a table, the background, and direct lighting."""
        super().__init__(devices, triangles, settings, sky, table)
        job = self.job = replace(self.job, settings=settings)
        backs = None if table.backs is None else table.backs.of_all()
        surfaces = replace(job.patch_scene.surfaces, emission=table.glow.of_all(), back_emission=backs)
        bright = table.bright(len(triangles.triangles.mesh), job.emission)
        patch_scene = replace(job.patch_scene, surfaces=surfaces)
        self.lighting = DirectLighting(
            scene, patch_scene, job.rays, settings, split=EmitterSplit(bright, sky)
        )
        self._scene, self._emitting = scene, replace(job, patch_scene=patch_scene)
        self._probes: tuple[SentRadiance, ProbeGather] | None = None

    def probes(self, light: SentRadiance, choice: SolverChoice) -> ProbeGather:
        """Return the gather of light probes from the light of all patches; the last one is kept."""
        if self._probes is None or self._probes[0] is not light:
            self._probes, job = None, self._emitting
            texel_job = TexelGatherJob(self._scene, job, job, choice, self.lighting)
            lights = [light.opened(job.opencl)]
            # Blocks of the next bake may run on other workers.
            self._probes = light, ProbeGather(texel_job, lights, None, keeps_rows=False)
        return self._probes[1]
