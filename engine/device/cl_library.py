"""OpenCL functions that PyOpenCL lacks, called by ctypes on the same library."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import DeviceError

_POINTER, _INT, _UINT, _ULONG, _SIZE = (
    ctypes.c_void_p, ctypes.c_int32, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t,
)  # fmt: skip
_ERROR = ctypes.POINTER(_INT)
_POINTERS = ctypes.POINTER(_POINTER)
_HANDOVER = (_INT, (_POINTER, _UINT, _POINTERS, _UINT, _POINTERS, _POINTERS))

#: Result and argument types; functions that create an object report errors in their last argument.
SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "clCreateContext": (
        _POINTER,
        (ctypes.POINTER(ctypes.c_ssize_t), _UINT, _POINTERS, _POINTER, _POINTER, _ERROR),
    ),
    "clCreateFromGLTexture": (_POINTER, (_POINTER, _ULONG, _UINT, _INT, _UINT, _ERROR)),
    "clCreateFromGLBuffer": (_POINTER, (_POINTER, _ULONG, _UINT, _ERROR)),
    "clCreateBufferWithProperties": (
        _POINTER, (_POINTER, ctypes.POINTER(_ULONG), _ULONG, _SIZE, _POINTER, _ERROR),
    ),
    "clCreateEventFromGLsyncKHR": (_POINTER, (_POINTER, _POINTER, _ERROR)),
    "clEnqueueAcquireGLObjects": _HANDOVER,
    "clEnqueueReleaseGLObjects": _HANDOVER,
    "clGetExtensionFunctionAddressForPlatform": (_POINTER, (_POINTER, ctypes.c_char_p)),
    "clEnqueueAcquireExternalMemObjectsKHR": _HANDOVER,
    "clEnqueueReleaseExternalMemObjectsKHR": _HANDOVER,
}  # fmt: skip

#: CL_DEVICE_TYPE_ALL.
_ALL_DEVICES = 0xFFFFFFFF

#: Extension functions that the OpenCL loader does not export.
_OF_PLATFORM = ("clEnqueueAcquireExternalMemObjectsKHR", "clEnqueueReleaseExternalMemObjectsKHR")


def start_drivers() -> None:
    """Load the OpenCL drivers and let them search their devices.

    PyOpenCL would hold Python's global lock meanwhile. Errors are reported later, on the first use.
    """
    with suppress(OSError, DeviceError):
        library, count, most = ctypes.CDLL(_loaded()), _UINT(), 64
        platforms = (_POINTER * most)()
        library.clGetPlatformIDs(_UINT(most), platforms, ctypes.byref(count))
        for platform in platforms[: min(count.value, most)]:
            library.clGetDeviceIDs(
                _POINTER(platform), _ULONG(_ALL_DEVICES), _UINT(0), None, ctypes.byref(count)
            )


class ClLibrary:
    """OpenCL functions by name.

    library:   object with the functions as attributes; None for the library that PyOpenCL has loaded
    platform:  cl_platform_id

    Raises DeviceError if a function is missing or fails.
    """

    def __init__(self, platform: int, library: Any = None) -> None:
        self.platform = platform
        self._library = ctypes.CDLL(_loaded()) if library is None else library

    def make(self, name: str, *arguments: Any) -> int:
        """Return the object that a function creates; appends the error argument."""
        error = _INT()
        made = self._function(name)(*arguments, ctypes.byref(error))
        if error.value or not made:
            raise DeviceError(f"OpenCL: {name} fails with error {error.value}.")
        return int(made)

    def hand_over(self, name: str, queue: int, memory: int, after: Sequence[int] = ()) -> int:
        """Enqueue the acquire or release of an object after events; return its event."""
        event = _POINTER()
        waits = (_POINTER * len(after))(*after) if after else None
        code = self._function(name)(
            queue, 1, (_POINTER * 1)(memory), len(after), waits, ctypes.byref(event)
        )  # fmt: skip
        if code:
            raise DeviceError(f"OpenCL: {name} fails with error {code}.")
        return int(event.value or 0)

    def _function(self, name: str) -> Any:
        """Return a function with its types set."""
        result, arguments = SIGNATURES[name]
        if name in _OF_PLATFORM:
            find = self._function("clGetExtensionFunctionAddressForPlatform")
            address = find(self.platform, name.encode())
            if not address:
                raise DeviceError(f"OpenCL has no function {name}.")
            return ctypes.CFUNCTYPE(result, *arguments)(address)
        function = getattr(self._library, name, None)
        if function is None:
            raise DeviceError(f"OpenCL has no function {name}.")
        function.restype, function.argtypes = result, arguments
        return function


def _loaded() -> str:
    """Return the path of the OpenCL library of PyOpenCL; a second library has separate objects."""
    if sys.platform == "win32":
        return "OpenCL.dll"
    if sys.platform == "darwin":
        return "/System/Library/Frameworks/OpenCL.framework/OpenCL"
    for line in Path("/proc/self/maps").read_text(encoding="utf-8", errors="surrogateescape").splitlines():
        if "libOpenCL" in line:
            return line.split(maxsplit=5)[-1]
    raise DeviceError("PyOpenCL has not loaded OpenCL yet.")
