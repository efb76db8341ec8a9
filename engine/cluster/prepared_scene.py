"""A scene on the device of a worker: its triangles, and what blocks of patches are solved with."""

from __future__ import annotations

import gc
import os
from functools import cache

from ..device.devices import Devices
from ..device.freed_memory import keep_freed_memory
from ..direct.emitter_split import sky_of
from ..plan.solver_choice import Choice
from ..texel_gather.texel_sample_points import DisplayJob
from .patch_table import PatchTable, SceneTable
from .scene_payload import Shipment
from .source_patches import Patches, Sources
from .triangle_scene import KeptTriangles

#: Environment variable that names the OpenCL device of a worker.
DEVICE = "HEMIBAKE_OPENCL_DEVICE"


@cache
def worker_devices() -> Devices:
    """Return the devices of this worker, which outlive bakes; raises DeviceError, see `Devices`."""
    keep_freed_memory()
    return Devices(opencl_device=os.environ.get(DEVICE))


class PreparedScene:
    """The scene of a shipment; its triangles are those that are kept of the last bake, if they serve.

    scene  occluders have their places in it

    Raises DeviceError if the worker has no OpenGL, or no OpenCL.
    """

    def __init__(self, shipment: Shipment, kept: KeptTriangles) -> None:
        self.scene, settings = shipment.unpacked()
        self.digest = shipment.digest
        self._devices = worker_devices()
        self._devices.graphics.use()
        triangles, sky = (
            kept.of(self._devices.compute, self.scene, settings),
            sky_of(self.scene.world, settings),
        )
        self._common = self._devices, triangles, settings, sky
        self._patches: Patches | None = None
        self._groups: Sources | None = None
        self._display: DisplayJob | None = None

    def patches(self, table: SceneTable) -> Patches:
        """Return the patches of a table; the last ones are kept."""
        if self._patches is None or self._patches.name != table.name:
            self._patches = Patches(*self._common, table, self.scene)
        return self._patches

    def sources(self, table: PatchTable) -> Sources:
        """Return the patches, or groups of them, of a table; the last ones are kept."""
        if isinstance(table, SceneTable):
            return self.patches(table)
        if self._groups is None or self._groups.name != table.name:
            self._groups = Sources(*self._common, table)
        return self._groups

    def display(self, patches: Patches, solved: Sources, choice: Choice) -> DisplayJob:
        """Return what light at points of texels is gathered for; the last one is kept."""
        last = self._display
        if last is None or last.job is not patches.job or last.solved is not solved.job:
            self._display = last = DisplayJob(self.scene, patches.job, solved.job, choice, patches.lighting)
        return last

    def clear(self) -> None:
        """Free what the devices hold of the scene."""
        self._devices.clear()


_prepared: PreparedScene | None = None
_kept = KeptTriangles()


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
    """Make what casts rays through a scene: a task for each worker, while the client makes the patches."""
    prepared(shipment)
