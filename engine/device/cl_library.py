"""The OpenCL library that PyOpenCL has loaded, called by ctypes."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from pathlib import Path

from ..errors import DeviceError

#: CL_DEVICE_TYPE_ALL.
_ALL_DEVICES = 0xFFFFFFFF


def start_drivers() -> None:
    """Load the OpenCL drivers and let them search their devices.

    PyOpenCL would hold Python's global lock meanwhile. Errors are reported later, on the first use.
    """
    with suppress(OSError, DeviceError):
        library, count, most = ctypes.CDLL(loaded_library()), ctypes.c_uint32(), 64
        platforms = (ctypes.c_void_p * most)()
        library.clGetPlatformIDs(ctypes.c_uint32(most), platforms, ctypes.byref(count))
        for platform in platforms[: min(count.value, most)]:
            library.clGetDeviceIDs(
                ctypes.c_void_p(platform),
                ctypes.c_uint64(_ALL_DEVICES),
                ctypes.c_uint32(0),
                None,
                ctypes.byref(count),
            )


def loaded_library() -> str:
    """Return the path of the OpenCL library of PyOpenCL; a second library has separate objects."""
    if sys.platform == "win32":
        return "OpenCL.dll"
    if sys.platform == "darwin":
        return "/System/Library/Frameworks/OpenCL.framework/OpenCL"
    for line in Path("/proc/self/maps").read_text(encoding="utf-8", errors="surrogateescape").splitlines():
        if "libOpenCL" in line:
            return line.split(maxsplit=5)[-1]
    raise DeviceError("PyOpenCL has not loaded OpenCL yet.")
