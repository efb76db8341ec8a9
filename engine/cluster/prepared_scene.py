"""A scene on the device of a worker: its triangles, and what blocks of patches are solved with."""

from __future__ import annotations

import gc
import os
from functools import cache

from ..device.devices import Devices
from ..device.freed_memory import keep_freed_memory
from ..direct.emitter_split import sky_of
from ..plan.solver_choice import SolverChoice
from ..texel_gather.texel_sample_points import TexelGatherJob
from .patch_table import PatchTable, SceneTable
from .scene_payload import ScenePayload
from .source_patches import ScenePatches, SourcePatches
from .triangle_scene import TriangleCache

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

    def __init__(self, shipment: ScenePayload, kept: TriangleCache) -> None:
        self.scene, settings = shipment.unpacked()
        self.digest = shipment.digest
        self._devices = worker_devices()
        self._devices.graphics.use()
        triangles, sky = (
            kept.of(self._devices.compute, self.scene, settings),
            sky_of(self.scene.world, settings),
        )
        self._common = self._devices, triangles, settings, sky
        self._patches: ScenePatches | None = None
        self._groups: SourcePatches | None = None
        self._display: TexelGatherJob | None = None

    def patches(self, table: SceneTable) -> ScenePatches:
        """Return the patches of a table; the last ones are kept."""
        if self._patches is None or self._patches.name != table.name:
            self._patches = ScenePatches(*self._common, table, self.scene)
        return self._patches

    def sources(self, table: PatchTable) -> SourcePatches:
        """Return the patches, or groups of them, of a table; the last ones are kept."""
        if isinstance(table, SceneTable):
            return self.patches(table)
        if self._groups is None or self._groups.name != table.name:
            self._groups = SourcePatches(*self._common, table)
        return self._groups

    def display(self, patches: ScenePatches, solved: SourcePatches, choice: SolverChoice) -> TexelGatherJob:
        """Return what light at points of texels is gathered for; the last one is kept."""
        last = self._display
        if last is None or last.job is not patches.job or last.solved is not solved.job:
            self._display = last = TexelGatherJob(
                self.scene, patches.job, solved.job, choice, patches.lighting
            )
        return last

    def clear(self) -> None:
        """Free what the devices hold of the scene."""
        self._devices.clear()


_prepared: PreparedScene | None = None
_kept = TriangleCache()


def prepared(shipment: ScenePayload) -> PreparedScene:
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


def prepare(shipment: ScenePayload) -> None:
    """Make what casts rays through a scene: a task for each worker, while the client makes the patches."""
    prepared(shipment)
