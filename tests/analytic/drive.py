"""Runs bakes to their end, and prepares the same scenes for the reference solvers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine import BakeResult, Progress, Scene, Settings
from engine.device import devices
from engine.gather.interface import Gather
from engine.patches.geometry import PatchGeometry, patch_geometry
from engine.patches.patch_list import PatchList
from engine.scene.triangles import Triangles, join_meshes
from engine.session import Session
from engine.solve.host_radiosity import HostRadiosity
from engine.solve.radiosity_state import SolvedSurfaces, StartLight
from engine.solve.solver import Solver
from tests.reference.cpu_hemicubes import CpuHemicubes
from tests.reference.cpu_patches import list_patches, map_texels

#: Session of each pair of device classes. To open devices takes ten times as long as a small bake.
_sessions: dict[tuple[type, type], Session] = {}


def drive(scene: Scene, settings: Settings) -> BakeResult:
    """Bake to the end, with the devices of earlier bakes but without their data."""
    return drive_with_progress(scene, settings)[0]


def drive_with_progress(scene: Scene, settings: Settings) -> tuple[BakeResult, list[Progress]]:
    """Bake to the end; return the lightmap and all progress that the bake yielded."""
    session = _sessions.setdefault((devices.GraphicsContext, devices.ComputeDevice), Session())
    generator, progress = session.bake(scene, settings), []
    try:
        while True:
            progress.append(next(generator))
    except StopIteration as stop:
        return stop.value, progress
    finally:
        session.forget()


def irradiance(lightmap: BakeResult) -> np.ndarray:
    """Return E/pi of every patch of a lightmap, (n, 3) float32, in the order of the patch list."""
    return lightmap.image[lightmap.has_patch]


@dataclass(frozen=True)
class Prepared:
    """A scene with its patches, made without a GPU; reflectance and emission are (n, 3) float32."""

    scene: Scene
    patches: PatchList
    triangles: Triangles
    geometry: PatchGeometry
    reflectance: np.ndarray
    emission: np.ndarray

    @property
    def face(self) -> np.ndarray:
        """The polygon of each patch within its mesh, (n,) int32."""
        return np.concatenate([mesh.face for mesh in self.scene.meshes])[self.patches.triangle]

    def hemicubes(self, settings: Settings) -> CpuHemicubes:
        """Return the scene's hemicubes on the processor."""
        texels = map_texels(self.scene, self.patches)
        return CpuHemicubes(self.scene, self.triangles, self.geometry, texels, self.emission, settings)

    def solution(self, gather: Gather, settings: Settings) -> Solver:
        """Return the light after the paper's iterations with a way to gather."""
        start = StartLight(np.zeros_like(self.emission))
        surfaces = SolvedSurfaces(self.reflectance, self.geometry.area)
        solution = Solver(HostRadiosity(gather, surfaces, self.emission, start), start, settings)
        while not solution.done:
            for _ in solution.iteration():
                pass
        return solution


def prepare(scene: Scene, resolution: int) -> Prepared:
    """Return a scene with its patches."""
    patches, triangles = list_patches(scene, resolution), join_meshes(scene)
    geometry = patch_geometry(triangles, patches)
    reflectance = np.stack([material.reflectance for material in scene.materials])[geometry.material]
    emission = np.stack([material.emission for material in scene.materials])[geometry.material]
    return Prepared(scene, patches, triangles, geometry, reflectance, emission)
