"""OpenCL functions for memory that OpenGL shares, called by ctypes on the library of PyOpenCL."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from engine.device.cl_library import loaded_library
from engine.errors import DeviceError

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

#: Extension functions that the OpenCL loader does not export.
_OF_PLATFORM = ("clEnqueueAcquireExternalMemObjectsKHR", "clEnqueueReleaseExternalMemObjectsKHR")


class ClLibrary:
    """OpenCL functions by name.

    library:   object with the functions as attributes; None for the library that PyOpenCL has loaded
    platform:  cl_platform_id

    Raises DeviceError if a function is missing or fails.
    """

    def __init__(self, platform: int, library: Any = None) -> None:
        self.platform = platform
        self._library = ctypes.CDLL(loaded_library()) if library is None else library

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
