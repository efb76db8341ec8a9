"""Scene on a worker's device: triangles, BVH, and jobs for blocks of patches."""

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

#: Environment variable with the name of a worker's OpenCL device.
DEVICE = "HEMIBAKE_OPENCL_DEVICE"


@cache
def worker_devices() -> Devices:
    """Return the devices of this worker, which outlive bakes; raises DeviceError, see `Devices`."""
    keep_freed_memory()
    return Devices(opencl_device=os.environ.get(DEVICE))


class PreparedScene:
    """Scene of a payload on this worker's devices; triangles of the last bake are reused if unchanged.

    scene:  the scene, including objects without lightmap

    Raises DeviceError if the worker has no OpenGL or no OpenCL.
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
        """Return the patches of a table on the device; the patches of the last table are cached."""
        if self._patches is None or self._patches.name != table.name:
            self._patches = ScenePatches(*self._common, table, self.scene)
        return self._patches

    def sources(self, table: PatchTable) -> SourcePatches:
        """Return the sources of light of a table, patches or patch groups.

        The job of the last table is cached.
        """
        if isinstance(table, SceneTable):
            return self.patches(table)
        if self._groups is None or self._groups.name != table.name:
            self._groups = SourcePatches(*self._common, table)
        return self._groups

    def display(self, patches: ScenePatches, solved: SourcePatches, choice: SolverChoice) -> TexelGatherJob:
        """Return the input of the gather at texel samples; the last one is cached."""
        last = self._display
        if last is None or last.job is not patches.job or last.solved is not solved.job:
            self._display = last = TexelGatherJob(
                self.scene, patches.job, solved.job, choice, patches.lighting
            )
        return last

    def clear(self) -> None:
        """Free the scene's device memory."""
        self._devices.clear()


_prepared: PreparedScene | None = None
_kept = TriangleCache()


def prepared(shipment: ScenePayload) -> PreparedScene:
    """Return the prepared scene of a payload; the process caches the last one."""
    global _prepared
    if _prepared is None or _prepared.digest != shipment.digest:
        if _prepared is not None:
            _prepared.clear()

        # Free the last scene before the next one is prepared. It has reference cycles, so garbage collection
        # is needed.
        _prepared = None
        gc.collect()
        _prepared = PreparedScene(shipment, _kept)
    return _prepared


def prepare(shipment: ScenePayload) -> None:
    """Build the BVH of a scene: one task per worker, while the client creates the patches."""
    prepared(shipment)
