"""Bakes with every kernel of the engine; prints each mean as JSON. Run in a process of its own."""

import json
import sys
from dataclasses import replace

import numpy as np

from engine import Light, Scene, Settings
from engine.device import devices
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.scene.model import NO_LIGHTMAP
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace, quads, rectangle
from tests.gpu.graphics_card import GraphicsCard

SETTINGS = Settings(resolution=19, hemicube=8, max_bounces=2, tolerance=0, light_samples=4, ao_samples=4)
DIRECTIONAL = ("combined", "directional", "dominant_direction")
BAKES = {
    "paper": replace(SETTINGS, method="paper"),
    "raster": replace(SETTINGS, visibility="raster", outputs=DIRECTIONAL),
    "rays": replace(SETTINGS, visibility="rays", outputs=("combined", "shadow_mask", "ambient_occlusion")),
    "directional": replace(SETTINGS, visibility="rays", outputs=DIRECTIONAL),
    "stream": replace(
        SETTINGS, visibility="rays", method="stream", directions="hemicube", outputs=DIRECTIONAL
    ),
    "groups": replace(SETTINGS, visibility="rays", patch_groups=4),
}


class WithoutComputeShaders(GraphicsContext):
    """OpenGL 4.1: OpenCL sums hemicubes."""

    def __init__(self):
        super().__init__()
        self.computes = self.indirect = False


def room() -> Scene:
    """Return a furnace with a lamp and with dust: more triangles than are split from the top down."""
    corners = np.random.default_rng(0).random((1500, 3)) * 0.9 + 0.05
    dust = np.stack([rectangle(point, (1e-3, 0, 0), (0, 1e-3, 0)) for point in corners])
    mesh = replace(quads(dust, [(0, 0, 1, 1)] * 1500, [0] * 1500, 32, "Dust"), atlas=NO_LIGHTMAP)
    closed = furnace(0.5, 1.0)
    lamp = Light("Lamp", "point", np.full(3, 0.5), np.eye(3), np.ones(3, np.float32), radius=0.1)
    return replace(closed, meshes=(*closed.meshes, mesh), lights=(lamp,))


if __name__ == "__main__":
    devices.GraphicsContext = WithoutComputeShaders
    devices.ComputeDevice = GraphicsCard if "card" in sys.argv else ComputeDevice
    compute = devices.ComputeDevice()
    facts = {"limit": compute.device.max_work_group_size}
    for name, settings in BAKES.items():
        lightmap = drive(room(), settings)
        facts |= {f"{name} {key}": float(np.abs(image).mean()) for key, image in lightmap.passes.items()}
        assert lightmap.report.integrator == "opencl"
    sys.stdout.write(json.dumps(facts))
