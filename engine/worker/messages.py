"""Serialization of engine objects for messages between a parent and its worker.

The package is named `engine` in the worker, and for example `bl_ext.user_default.hemibake.engine` in Blender.
An object is therefore sent as class name and fields. Arrays in shared memory are sent as their position.

    bytes  | count | size of part 0 | ... | part 0: pickle | part 1 ... : arrays |
           '-------- 64-bit integers -----'
"""

from __future__ import annotations

import io
import pickle
import struct
from collections.abc import Callable
from dataclasses import fields
from operator import attrgetter
from typing import Any

import numpy as np

from .. import errors
from ..bake_result import BakeResult, FluxBalance, ProbeGrid, ReflectionCube, Report
from ..device.device_info import DeviceInfo, DeviceSurvey
from ..object_message import ObjectMessage
from ..progress import Progress
from ..scene.model import BackSide, Light, Material, Mesh, Scene
from ..scene.probe_volume import ProbeVolume
from ..scene.profile import Profile
from ..scene.reflection_sphere import ReflectionSphere, ReflectionVolume
from ..scene.scene_changes import SceneChanges
from ..scene.texture import Texture
from ..scene.transmission import Fresnel, Transmission, Transmittance
from ..settings import Settings
from ..unwrap.chart_options import ChartOptions
from ..unwrap.polygon_mesh import MeshCharts, PolygonMesh
from ..unwrap.unwrapping import PackJob, PackResult, Unwrapped
from .shared_arrays import array_at, place_of

#: Dataclasses that can be sent, by name.
RECORDS: dict[str, type] = {
    record.__name__: record
    for record in (
        BackSide,
        SceneChanges,
        MeshCharts,
        ChartOptions,
        DeviceSurvey,
        FluxBalance,
        Fresnel,
        PackResult,
        DeviceInfo,
        Light,
        BakeResult,
        Material,
        Mesh,
        PolygonMesh,
        Profile,
        ProbeGrid,
        ProbeVolume,
        Progress,
        ReflectionCube,
        ReflectionSphere,
        ReflectionVolume,
        Report,
        Scene,
        Settings,
        PackJob,
        Texture,
        Transmission,
        Transmittance,
        Unwrapped,
    )
}

#: Other classes and functions of this package in messages, by name.
_OTHERS: dict[str, Callable[..., Any]] = {each.__name__: each for each in (ObjectMessage, array_at)}

#: Function that returns all fields of each dataclass.
_FIELDS: dict[type, Callable[[Any], tuple[Any, ...]]] = {
    record: attrgetter(*(field.name for field in fields(record))) for record in RECORDS.values()
}

#: Errors that keep their class, by name; all others become a WorkerError.
ERRORS: dict[str, type[errors.EngineError]] = {
    error.__name__: error
    for error in (
        errors.EngineError,
        errors.SceneError,
        errors.OverlapError,
        errors.SettingsError,
        errors.DeviceError,
        errors.PatchFileError,
    )
}


class PackedMessage:
    """Serialized object: a pickle, and the arrays that it refers to, not yet copied."""

    def __init__(self, value: object) -> None:
        """Serialize the builtins, NumPy arrays and records in `value`."""
        arrays: list[pickle.PickleBuffer] = []
        stream = io.BytesIO()
        _Packer(stream, protocol=5, buffer_callback=arrays.append).dump(value)
        self._parts: list[memoryview] = [stream.getbuffer(), *(array.raw() for array in arrays)]
        sizes = [part.nbytes for part in self._parts]
        self._head = struct.pack(f"<{len(sizes) + 1}Q", len(sizes), *sizes)
        self.size = len(self._head) + sum(sizes)

    def write(self, memory: memoryview) -> None:
        """Copy header and parts into `memory`, of at least `size` bytes."""
        start = 0
        for part in (memoryview(self._head), *self._parts):
            end = start + len(part)
            memory[start:end] = part
            start = end


def read(memory: memoryview) -> Any:
    """Return the object that `PackedMessage.write` stored in `memory`; its arrays are copies."""
    (count,) = struct.unpack_from("<Q", memory)
    sizes = struct.unpack_from(f"<{count}Q", memory, 8)

    # Copy each part, so that the block can be reused at once.
    start = 8 * (count + 1)
    parts = []
    for size in sizes:
        parts.append(bytearray(memory[start : start + size]))
        start += size
    return _Unpacker(io.BytesIO(parts[0]), buffers=parts[1:]).load()


class _Packer(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        """Return a record or message as class and fields, and an array in shared memory as its position.

        Not called for builtins.
        """
        if type(value) is np.ndarray and (place := place_of(value)) is not None:
            return array_at, place
        if type(value) is ObjectMessage:
            return ObjectMessage, (str(value), value.objects, value.fix)
        values = _FIELDS.get(type(value))
        return NotImplemented if values is None else (type(value), values(value))


class _Unpacker(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Return this process's record, message class or function with a name; others by module."""
        own = _OTHERS.get(name) or RECORDS.get(name)
        return own or super().find_class(module, name)


def describe_error(error: Exception, traceback: str) -> tuple[str, str, str]:
    """Return the class name (empty for other errors), message and traceback of an EngineError."""
    known = (kind.__name__ for kind in type(error).__mro__ if ERRORS.get(kind.__name__) is kind)
    return next(known, ""), str(error), traceback


def rebuild_error(name: str, message: str, traceback: str) -> errors.EngineError:
    """Return the error from its description; a WorkerError for unknown classes."""
    if name:
        return ERRORS[name](message)
    return errors.WorkerError(
        f"The bake stopped because of a bug in Hemibake: {traceback.splitlines()[-1]}. "
        f"Please report it together with these lines.\n{traceback}"
    )
