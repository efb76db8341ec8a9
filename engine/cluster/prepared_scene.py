"""A scene on the device of a worker: patches, triangles, and what blocks of them are solved with."""

from __future__ import annotations

import os
from functools import cache

import numpy as np
import pyopencl as cl

from ..device.buffers import upload_float4
from ..device.devices import Devices
from ..direct.lighting import DirectLighting
from ..patches.subdivision import subdivide
from ..plan.solve_job import SolveJob
from ..visibility.rays.ray_scene import RayScene
from .shipment import Shipment

#: Environment variable that names the OpenCL device of a worker.
DEVICE = "HEMIBAKE_OPENCL_DEVICE"


@cache
def worker_devices() -> Devices:
    """Return the devices of this worker, which outlive bakes; raises DeviceError, see `Devices`."""
    return Devices(opencl_device=os.environ.get(DEVICE))


class PreparedScene:
    """The scene of a shipment.

    job  the radiosity equation of all its patches, without the light that shadow rays sample

    Raises DeviceError if the worker has no OpenGL, or no OpenCL.
    """

    def __init__(self, shipment: Shipment) -> None:
        scene, settings = shipment.unpacked()
        self.digest = shipment.digest
        self.devices = worker_devices()
        graphics, compute = self.devices.graphics, self.devices.compute
        graphics.use()
        parts = subdivide(graphics, compute, scene, settings)
        rays = RayScene(compute, parts)
        lighting = DirectLighting(scene, parts, rays, settings)
        nothing = np.zeros((len(parts.patches), 3), np.float32)
        self._radiance: np.ndarray | None = None
        left = lighting.emission_left, lighting.sky_left
        self.job = SolveJob(graphics, compute, parts, rays, *left, nothing, parts.geometry.area, settings)

    def table(self, radiance: np.ndarray) -> cl.Buffer:
        """Return radiance of all patches, (n, 3) float32, on the device: once for all blocks of a sweep."""
        if radiance is not self._radiance:
            self._radiance, self._table = radiance, upload_float4(self.job.opencl, radiance, first=1, last=1)
        return self._table


_prepared: PreparedScene | None = None


def prepared(shipment: Shipment) -> PreparedScene:
    """Return the scene of a shipment; a process keeps the last one."""
    global _prepared
    if _prepared is None or _prepared.digest != shipment.digest:
        if _prepared is not None:
            _prepared.devices.clear()
        _prepared = PreparedScene(shipment)
    return _prepared
