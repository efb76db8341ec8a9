"""Bakes with glim, a GPU lightmapper for Vulkan (github.com/z3y/glim), through its C interface.

The structures follow its bindings at 5eae8b2. A process makes few bakes: each opens a Vulkan instance that
the library does not close.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

#: Bakes of a process before another one takes its place (chosen).
_BAKES = 20

#: Kind of a message that reports an error.
_ERROR = 1

#: Width of the constant sky's faces, texels.
_SKY = 4


@dataclass(frozen=True)
class GlimScene:
    """Arrays of a scene with one lightmap.

    meshes:    (positions, normals, uvs, emissive) of each mesh: (3t, 3), (3t, 3), (3t, 2) float32, and
               whether it emits light
    albedo:    (r, r, 4) uint8, reflectance at each texel, bottom row first
    emission:  (r, r, 4) float32, W/(m^2 sr)
    sky:       (3,) float32, W/(m^2 sr), radiance of the world
    """

    meshes: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]
    albedo: np.ndarray
    emission: np.ndarray
    sky: np.ndarray


@dataclass(frozen=True)
class GlimSamples:
    """Samples of a texel for direct and for indirect light, and number of bounces."""

    direct: int
    indirect: int
    bounces: int


class Glim:
    """Bakes a scene in a process of its own."""

    def __init__(self, library: Path, scene: GlimScene) -> None:
        self._pool = ProcessPoolExecutor(
            1, get_context("spawn"), _open, (str(library), scene), max_tasks_per_child=_BAKES
        )

    def bake(self, samples: GlimSamples, seams: bool = False) -> tuple[float, np.ndarray]:
        """Return the time from arrays to arrays, s, and the image, (r, r, 4) float32, bottom row first.

        RGB is irradiance / pi, alpha is 0 where no texel was baked. Vulkan's start is not timed.
        """
        return self._pool.submit(_bake, samples, seams).result()

    def close(self) -> None:
        """End the process."""
        self._pool.shutdown()


class _Vector(ctypes.Structure):
    _fields_ = tuple((axis, ctypes.c_float) for axis in "xyz")


class _String(ctypes.Structure):
    _fields_ = (("raw", ctypes.c_void_p), ("length", ctypes.c_uint32))


class _LogMessage(ctypes.Structure):
    _fields_ = (("kind", ctypes.c_uint32), ("progress", ctypes.c_float), ("message", _String))


class _ProbeData(ctypes.Structure):
    _fields_ = (("probes", ctypes.c_void_p), ("count", ctypes.c_uint32))


_LOG = ctypes.CFUNCTYPE(None, _LogMessage)
_PROBES = ctypes.CFUNCTYPE(None, _ProbeData)


class _Lightmap(ctypes.Structure):
    _fields_ = (
        ("width", ctypes.c_uint32), ("height", ctypes.c_uint32), ("dilate", ctypes.c_bool),
        ("denoise", ctypes.c_bool), ("fix_seams", ctypes.c_bool),
    )  # fmt: skip


class _Config(ctypes.Structure):
    _fields_ = (
        ("coordinate_system", ctypes.c_uint32), ("is_preview", ctypes.c_bool),
        ("vulkan_validation_layers", ctypes.c_bool), ("seams_debug", ctypes.c_bool),
        ("hardware_rt", ctypes.c_bool), ("throttle_preview_ms", ctypes.c_uint32),
        ("preview_settings", _Lightmap), ("camera_position", _Vector), ("camera_forward", _Vector),
        ("log_callback", _LOG), ("lightprobes_read_callback", _PROBES), ("probe_samples", ctypes.c_uint32),
        ("light_falloff", ctypes.c_uint32), ("mis", ctypes.c_bool), ("direct_light_samples", ctypes.c_uint32),
        ("direct_emission_samples", ctypes.c_uint32), ("indirect_samples", ctypes.c_uint32),
        ("bounce_count", ctypes.c_uint32), ("lightmap_mode", ctypes.c_uint32),
        ("skybox_intensity", ctypes.c_float), ("indirect_intensity", ctypes.c_float),
        ("lightprobe_deringing", ctypes.c_float),
    )  # fmt: skip


class _Mesh(ctypes.Structure):
    _fields_ = (
        ("vertices", ctypes.c_void_p), ("normals", ctypes.c_void_p), ("uvs", ctypes.c_void_p),
        ("indices", ctypes.c_void_p), ("vertices_length", ctypes.c_uint32),
        ("indices_length", ctypes.c_uint32), ("lightmap_group", ctypes.c_uint32),
        ("backface_gi", ctypes.c_bool), ("transparent", ctypes.c_bool), ("emissive", ctypes.c_bool),
    )  # fmt: skip


#: Errors that the library has reported to this process.
_errors: list[str] = []


@_LOG
def _note_error(message: _LogMessage) -> None:
    """Keep an error; ignore progress."""
    if message.kind == _ERROR:
        _errors.append(ctypes.string_at(message.message.raw, message.message.length).decode(errors="replace"))


@_PROBES
def _ignore_probes(data: _ProbeData) -> None:
    """Ignore light probes: there are none."""


#: Library and scene of this process.
_opened: list[tuple[ctypes.CDLL, GlimScene]] = []


def _open(library: str, scene: GlimScene) -> None:
    """Load the library into this process, without its messages on standard output."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    loaded = ctypes.CDLL(library)
    pointer, number = ctypes.c_void_p, ctypes.c_uint32
    loaded.app_new.restype, loaded.app_new.argtypes = pointer, (_Config, _String)
    loaded.app_add_mesh.argtypes = (pointer, _Mesh)
    loaded.app_add_lightmap_group.argtypes = (pointer, _Lightmap, pointer, number, pointer, number)
    loaded.app_set_skybox.argtypes = (pointer, pointer, number, number, number)
    loaded.app_run.argtypes = loaded.app_destroy.argtypes = (pointer,)
    _opened.append((loaded, scene))


def _bake(samples: GlimSamples, seams: bool) -> tuple[float, np.ndarray]:
    """Bake in this process; see `Glim.bake`."""
    library, scene = _opened[0]
    width = len(scene.albedo)
    with tempfile.TemporaryDirectory(dir=_memory_folder()) as folder:
        name = ctypes.create_string_buffer(folder.encode())
        app = library.app_new(_config(samples), _String(ctypes.addressof(name), len(folder)))
        began = time.perf_counter()
        _add_scene(library, app, scene, seams)
        library.app_run(app)
        if _errors:
            raise RuntimeError(f"glim: {'; '.join(_errors)}")
        image = np.fromfile(Path(folder) / "Lightmap-0.raw", np.float32).reshape(width, width, 4)
        seconds = time.perf_counter() - began
        library.app_destroy(app)
    return seconds, image


def _memory_folder() -> str | None:
    """Return a folder in memory, for the image file that the library writes; None without one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _config(samples: GlimSamples) -> _Config:
    """Return settings, with multiple importance sampling of emissive triangles."""
    return _Config(
        camera_forward=_Vector(0, 0, 1),
        log_callback=_note_error,
        lightprobes_read_callback=_ignore_probes,
        mis=True,
        direct_light_samples=samples.direct,
        direct_emission_samples=samples.direct,
        indirect_samples=samples.indirect,
        bounce_count=samples.bounces,
        skybox_intensity=1.0,
        indirect_intensity=1.0,
    )


def _add_scene(library: ctypes.CDLL, app: int, scene: GlimScene, seams: bool) -> None:
    """Give the arrays to the library, which copies them."""
    width = len(scene.albedo)
    for positions, normals, uvs, emissive in scene.meshes:
        indices = np.arange(len(positions), dtype=np.uint32)
        pointers = [array.ctypes.data for array in (positions, normals, uvs, indices)]
        library.app_add_mesh(app, _Mesh(*pointers, len(positions), len(indices), 0, False, False, emissive))
    sky = np.ones((6, _SKY, _SKY, 4), np.float32)
    sky[..., :3] = scene.sky
    library.app_set_skybox(app, sky.ctypes.data, sky.size, _SKY, _SKY)
    lightmap = _Lightmap(width, width, dilate=True, denoise=False, fix_seams=seams)
    images = (scene.albedo, scene.emission)
    sizes = [value for image in images for value in (image.ctypes.data, image.size)]
    library.app_add_lightmap_group(app, lightmap, *sizes)
