"""A scene on the device of a worker: patches, triangles, and what blocks of them are solved with."""

from __future__ import annotations

import os
from functools import cache

import numpy as np

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
        left = lighting.emission_left, lighting.sky_left
        self.job = SolveJob(graphics, compute, parts, rays, *left, nothing, parts.geometry.area, settings)


_prepared: PreparedScene | None = None


def prepared(shipment: Shipment) -> PreparedScene:
    """Return the scene of a shipment; a process keeps the last one."""
    global _prepared
    if _prepared is None or _prepared.digest != shipment.digest:
        if _prepared is not None:
            _prepared.devices.clear()
        _prepared = PreparedScene(shipment)
    return _prepared
