"""Warm-up bake: builds the programs that most bakes need before the first bake."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from . import session
from .device.device_records import DeviceRecords
from .device.packages import require_packages
from .errors import DeviceError
from .progress import Progress
from .scene.model import Light, Material, Mesh, Scene
from .scene.texture import Texture
from .self_test import TOLERANCE, furnace, furnace_settings, largest_error
from .settings import Settings

#: Settings of the quality "preview" with few samples and a small lightmap.
SMALL: dict[str, Any] = {
    "resolution": 53, "samples": 64, "hemicube": 16, "adaptive": True, "checkpoint_space": 0
}  # fmt: skip

#: `SMALL` with a lightmap of typical size. It has more patches than 16-bit samples can index. Its kernels run
#: with more than 65,535 work items, for which PoCL compiles them separately.
TYPICAL = SMALL | {"resolution": 401}


def warm_up(settings: dict[str, Any]) -> Generator[Progress, None, None]:
    """Open the chosen devices and build programs in the session of this process.

    settings:  values of `Settings` by name
    """
    has_opencl = _has_opencl(Settings(**settings))
    chosen = Settings(**settings | (TYPICAL if has_opencl else SMALL))
    yield from session.warm_up(warm_up_scene(), chosen)
    yield from check_device(chosen)


def check_device(settings: Settings) -> Generator[Progress, None, None]:
    """Bake a scene of known light on the session's OpenCL device, once per driver version, and compare.

    Bakes skip a device whose light is wrong, unless the user chooses it by its name.
    """
    device, records = session.device(), DeviceRecords(settings.cache_dir)
    if device is None or settings.opencl_device is not None or records.is_tested(device):
        return
    rays = replace(
        furnace_settings(settings),
        resolution=settings.resolution,
        samples=settings.samples,
        adaptive=True,
        visibility="rays",
    )
    lightmap = yield from session.warm_up(furnace(), rays)
    error = largest_error(lightmap)
    if error <= TOLERANCE:
        records.keep_tested(device)
    else:
        records.skip(device, f"computes light that is wrong by {error:.1%}")
        session.close()


def _has_opencl(settings: Settings) -> bool:
    """Return True if there is an OpenCL device; bakes without one take long for a typical lightmap."""
    require_packages()
    with suppress(DeviceError):
        from .device.cl_device import search_devices

        return bool(search_devices(DeviceRecords(settings.cache_dir), settings.opencl_device))
    return False


def warm_up_scene() -> Scene:
    """Return a room with typical features: a light, a shadow, a texture, and a seam off the texel grid."""
    lamp = Light("Lamp", "point", np.array([0.5, 0.5, 0.9]), np.eye(3), np.ones(3, np.float32), radius=0.05)
    room = furnace((lamp,))
    return replace(room, meshes=(*room.meshes, _shelf()), materials=(*room.materials, _painted()))


def _shelf() -> Mesh:
    """Return two adjacent squares with separate charts."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    split = np.array([[0, 1, 2], [0, 2, 3]])
    places = np.concatenate([0.3 * square + (0.2 + 0.3 * side, 0.3) for side in (0, 1)])[:, None]
    corners = np.concatenate([places, np.full((8, 1, 1), 0.4)], axis=2).reshape(2, 4, 3)
    charts = np.stack([10 * square + (2.3 + 14 * side, 38.4) for side in (0, 1)]) / SMALL["resolution"]
    triangles = np.arange(4, dtype=np.int32)
    uvs = charts[:, split].reshape(-1, 3, 2).astype(np.float32)
    return Mesh(
        name="Shelf",
        positions=corners[:, split].reshape(-1, 3, 3).astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (4, 3, 1)),
        uvs=uvs,
        face=triangles // 2,
        subface=triangles % 2,
        material=np.ones(4, np.int32),
        texture_uvs={"UVMap": uvs},
    )


def _painted() -> Material:
    """Return a material with an image texture."""
    pixels = np.random.default_rng(5).random((8, 8, 3), np.float32)
    white, black = np.ones(3, np.float32), np.zeros(3, np.float32)
    return Material("Painted", white, black, reflectance_map=Texture("Paint", pixels, "UVMap"))
