"""Self test: a bake with a known result, the furnace test."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np

from .bake_result import BakeResult
from .errors import DeviceError
from .progress import Progress, Schedule, Stage
from .scene.model import Light, Material, Mesh, Scene
from .settings import Settings

#: Bake in this process or another one, which may have no progress to report.
Bake = Callable[[Scene, Settings], Generator[Progress | None, None, BakeResult]]

#: Reflectance and emission of the furnace. In a closed room of one material E/pi is emission / (1 -
#: reflectance) everywhere.
_REFLECTANCE, _EMISSION = 0.5, 1.0
_EXPECTED = _EMISSION / (1 - _REFLECTANCE)

#: Maximum relative error of a texel on a working machine.
TOLERANCE = 0.01

#: Width of the lightmap and of each wall in it, texels; primes, to cover uneven sizes.
_RESOLUTION, _WALL = 53, 13

_SETTINGS = Settings(
    resolution=_RESOLUTION,
    hemicube=16,
    tolerance=1e-4,
    method="cached",
    sample_emission=False,
    intermediates=False,
)

#: Expected seconds of one bake.
_PACE = 2.0


@dataclass(frozen=True)
class Verdict:
    """Result of a self test that passed.

    error:    maximum relative error of a texel
    devices:  see `Report`
    notes:    messages about missing devices, with a remedy
    """

    error: float
    devices: dict[str, str]
    notes: tuple[str, ...]


def run_self_test(bake: Bake, settings: Settings) -> Generator[Progress | None, None, Verdict]:
    """Bake a furnace with raster and with rays; yield the progress.

    settings:  settings of the machine: OpenCL device, memory, cache

    Raises DeviceError if a result is wrong, and errors of the bake.
    """
    base = furnace_settings(settings)
    drawing, casting = Stage("Drawing", pace=_PACE), Stage("Casting rays", pace=_PACE)
    schedule = Schedule([drawing, casting])
    drawn = yield from schedule.include(drawing, bake(furnace(), replace(base, visibility="raster")))
    error, devices = _checked(drawn, "drawn hemicubes"), drawn.report.devices
    if "cl" in devices:
        cast = yield from schedule.include(casting, bake(furnace(), replace(base, visibility="rays")))
        error = max(error, _checked(cast, "rays"))
    return Verdict(error, devices, drawn.report.warnings)


def furnace_settings(settings: Settings) -> Settings:
    """Return the self-test's settings, with devices, memory limits and folders of the given settings."""
    return replace(
        _SETTINGS,
        opencl_device=settings.opencl_device,
        memory_budget=settings.memory_budget,
        batch_bytes=settings.batch_bytes,
        cache_dir=settings.cache_dir,
    )


def largest_error(lightmap: BakeResult) -> float:
    """Return the largest error of a furnace's light, relative to the known light; infinite without light."""
    light = lightmap.image[lightmap.has_patch]
    error = float(np.abs(light / _EXPECTED - 1).max()) if len(light) else np.inf
    return error if np.isfinite(error) else np.inf


def _checked(lightmap: BakeResult, way: str) -> float:
    """Return the maximum relative error of a bake; raise DeviceError if it exceeds the tolerance."""
    error = largest_error(lightmap)
    if error <= TOLERANCE:
        return error
    devices = " and ".join(f"'{name}'" for name in lightmap.report.devices.values())
    raise DeviceError(
        f"The light of a closed room differs from its known value by {error:.1%} with {way}, on "
        f"{devices}. Update the driver, or choose another OpenCL device in Hemibake's preferences."
    )


def furnace(lights: tuple[Light, ...] = ()) -> Scene:
    """Return a closed cube, seen from inside, whose walls reflect half of the light and emit."""
    corners = _walls()
    split = np.array([[0, 1, 2], [0, 2, 3]])
    positions = corners[:, split].reshape(-1, 3, 3)
    normals = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    walls = np.arange(12, dtype=np.int32)
    mesh = Mesh(
        name="Furnace",
        positions=positions,
        normals=np.repeat(normals[:, None], 3, axis=1),
        uvs=_charts()[:, split].reshape(-1, 3, 2),
        face=walls // 2,
        subface=walls % 2,
        material=np.zeros(12, np.int32),
    )
    grey = np.ones(3, np.float32)
    material = Material("Furnace", _REFLECTANCE * grey, _EMISSION * grey)
    return Scene((mesh,), (material,), ("Furnace",), lights=lights)


def _walls() -> np.ndarray:
    """Return the walls of a cube of 1 m, (6, 4, 3) float32, counter-clockwise seen from inside."""
    unit = np.eye(3, dtype=np.float32)
    walls = []
    for axis in range(3):
        u, v = unit[(axis + 1) % 3], unit[(axis + 2) % 3]
        walls.append([0 * u, u, u + v, v])
        walls.append([unit[axis] + v, unit[axis] + u + v, unit[axis] + u, unit[axis]])
    return np.array(walls, np.float32)


def _charts() -> np.ndarray:
    """Return the lightmap UVs of the walls, (6, 4, 2) float32, three in a row, aligned to texels."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * _WALL
    start = np.array([(wall % 3, wall // 3) for wall in range(6)]) * (_WALL + 4) + 1
    return ((start[:, None] + square) / _RESOLUTION).astype(np.float32)
