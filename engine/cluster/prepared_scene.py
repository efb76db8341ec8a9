"""A scene on the device of a worker: patches, triangles, and what blocks of them are solved with."""

from __future__ import annotations

import gc
import os
from dataclasses import replace
from functools import cache

import numpy as np

from ..device.devices import Devices
from ..device.freed_memory import keep_freed_memory
from ..direct.contact import patches_in_contact
from ..direct.lighting import DirectLighting
from ..plan.choice import Choice
from ..plan.choose import light_alone
from ..plan.display_points import DisplayJob
from ..plan.kept import Kept
from ..plan.solve_job import SolveJob
from ..plan.trial import untried_visibility
from ..solve.patch_groups import PatchGroups
from .shipment import Shipment
from .sources import Sources
from .squares import Squares

#: Environment variable that names the OpenCL device of a worker.
DEVICE = "HEMIBAKE_OPENCL_DEVICE"


@cache
def worker_devices() -> Devices:
    """Return the devices of this worker, which outlive bakes; raises DeviceError, see `Devices`."""
    keep_freed_memory()
    return Devices(opencl_device=os.environ.get(DEVICE))


class PreparedScene(Sources):
    """The scene of a shipment; its patches are those that are kept of the last bake, if they serve.

    scene     occluders have their places in it
    lighting  what shadow rays sample

    Raises DeviceError if the worker has no OpenGL, or no OpenCL.
    """

    def __init__(self, shipment: Shipment, kept: Kept) -> None:
        self.scene, settings = shipment.unpacked()
        self.digest = shipment.digest
        devices = worker_devices()
        graphics, compute = devices.graphics, devices.compute
        graphics.use()
        parts = kept.subdivide(graphics, compute, self.scene, settings, checked=True)
        rays = kept.ray_scene(compute, parts)
        if untried_visibility(settings) == "raster":
            parts = replace(parts, back_to_back=bool(patches_in_contact(rays, rays.count)[1].any()))
        self.lighting = DirectLighting(self.scene, parts, rays, settings)
        nothing = np.zeros((len(parts.patches), 3), np.float32)
        left = self.lighting.emission_left, self.lighting.sky_left
        job = SolveJob(graphics, compute, parts, rays, *left, nothing, parts.geometry.area, settings)
        super().__init__(devices, job)
        self._display: DisplayJob | None = None
        self._groups: tuple[str, Sources] | None = None

    def sources(self, squares: Squares | None) -> Sources:
        """Return groups of the patches, the last of which are kept; without any the patches themselves."""
        if squares is None:
            return self
        if self._groups is None or self._groups[0] != squares.digest:
            self._groups = squares.digest, Sources(self._devices, self._grouped(squares))
        return self._groups[1]

    def display(self, squares: Squares | None, choice: Choice) -> DisplayJob:
        """Return what light at points of texels is gathered for; the last one is kept."""
        solved = self.sources(squares).job
        if self._display is None or self._display.solved is not solved:
            self._display = DisplayJob(self.scene, self.job, solved, choice, self.lighting)
        return self._display

    def _grouped(self, squares: Squares) -> SolveJob:
        """Return the radiosity equation of groups."""
        job = self.job
        groups = PatchGroups(job.rays, job.parts, job.area, squares.leader, squares.width)
        return replace(
            job,
            parts=groups.parts,
            rays=groups.rays,
            emission=groups.mean(job.emission),
            sampled_light=groups.mean(job.sampled_light),
            area=groups.area,
            settings=light_alone(job.settings),
        )

    def clear(self) -> None:
        """Free what the devices hold of the scene."""
        self._devices.clear()


_prepared: PreparedScene | None = None
_kept = Kept()


def prepared(shipment: Shipment) -> PreparedScene:
    """Return the scene of a shipment; a process keeps the last one."""
    global _prepared
    if _prepared is None or _prepared.digest != shipment.digest:
        if _prepared is not None:
            _prepared.clear()

        # The memory of the last scene and its blocks is free for this one, also where they refer in circles.
        _prepared = None
        gc.collect()
        _prepared = PreparedScene(shipment, _kept)
    return _prepared


def prepare(shipment: Shipment) -> None:
    """Make the patches of a scene: a task for each worker, while the client makes its own."""
    prepared(shipment)
