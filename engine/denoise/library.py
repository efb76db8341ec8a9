"""Binding of Open Image Denoise 2 by ctypes: devices, buffers, and the ray tracing filter.

Functions, parameter names and constants are as in its header oidn.h. Only the process that bakes loads the
library.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import POINTER, byref, c_bool, c_char_p, c_float, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DenoiseError
from .found import REMEDY

#: Device types of oidn.h, by the names of `Settings.denoise_device`.
DEVICE_TYPES = {"cpu": 1, "sycl": 2, "cuda": 3, "hip": 4, "metal": 5}

#: Pixel format of three floats, OIDN_FORMAT_FLOAT3.
_FLOAT3 = 3

#: Major version of the interface.
_MAJOR = 2

#: Memory limit of a filter in MiB, without its images; if it needs more, it processes the image in tiles.
_MEMORY = 1024

#: Result and argument types of each function used.
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "oidnNewDevice": (c_void_p, [c_int]),
    "oidnCommitDevice": (None, [c_void_p]),
    "oidnReleaseDevice": (None, [c_void_p]),
    "oidnGetDeviceInt": (c_int, [c_void_p, c_char_p]),
    "oidnGetDeviceError": (c_int, [c_void_p, POINTER(c_char_p)]),
    "oidnNewBuffer": (c_void_p, [c_void_p, c_size_t]),
    "oidnWriteBuffer": (None, [c_void_p, c_size_t, c_size_t, c_void_p]),
    "oidnReadBuffer": (None, [c_void_p, c_size_t, c_size_t, c_void_p]),
    "oidnReleaseBuffer": (None, [c_void_p]),
    "oidnNewFilter": (c_void_p, [c_void_p, c_char_p]),
    "oidnSetFilterImage": (
        None,
        [c_void_p, c_char_p, c_void_p, c_int, c_size_t, c_size_t, c_size_t, c_size_t, c_size_t],
    ),
    "oidnSetFilterBool": (None, [c_void_p, c_char_p, c_bool]),
    "oidnSetFilterInt": (None, [c_void_p, c_char_p, c_int]),
    "oidnSetFilterFloat": (None, [c_void_p, c_char_p, c_float]),
    "oidnCommitFilter": (None, [c_void_p]),
    "oidnExecuteFilter": (None, [c_void_p]),
    "oidnReleaseFilter": (None, [c_void_p]),
}


class DenoiseLibrary:
    """Loaded Open Image Denoise library.

    call:  its functions, by their names in oidn.h

    Raises DenoiseError if the file is not a usable Open Image Denoise library.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.call = ctypes.CDLL(str(path))
            for name, (result, arguments) in _SIGNATURES.items():
                function = getattr(self.call, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            raise DenoiseError(
                f"Open Image Denoise cannot be loaded from '{path}': {error}. {REMEDY}."
            ) from error

    def check(self, device: int | None, doing: str) -> None:
        """Raise a DenoiseError if the last call failed; without a device, the last creation of a device."""
        message = c_char_p()
        if self.call.oidnGetDeviceError(device, byref(message)):
            text = (message.value or b"unknown error").decode(errors="replace")
            raise DenoiseError(f"Open Image Denoise failed while {doing}: {text}.")


class DenoiseDevice:
    """Device that denoises images; `release` frees it.

    kind:  one of DEVICE_TYPES
    name:  library, version and kind, for display

    Raises DenoiseError if there is no such device, or the library's major version is not 2.
    """

    def __init__(self, library: DenoiseLibrary, kind: str) -> None:
        self._library, self._kind = library, kind
        self._filter: _Filter | None = None
        self._handle = library.call.oidnNewDevice(DEVICE_TYPES[kind])
        if not self._handle:
            library.check(None, f"looking for a device of type {kind.upper()}")
            raise DenoiseError(f"Open Image Denoise has no device of type {kind.upper()}.")
        try:
            self._commit()
        except DenoiseError:
            self.release()
            raise

    def filtered(self, image: np.ndarray) -> np.ndarray:
        """Return a denoised image; both are (h, w, 3) float32, linear, with 1 as about white.

        Raises DenoiseError if the device fails or has too little memory.
        """
        if self._filter is None or self._filter.shape != image.shape:
            self._release_filter()
            self._filter = _Filter(self._library, self._handle, image.shape)
        return self._filter.run(image)

    def release(self) -> None:
        """Free all resources; may be called again."""
        self._release_filter()
        if self._handle:
            self._library.call.oidnReleaseDevice(self._handle)
            self._handle = None

    def _commit(self) -> None:
        call = self._library.call
        call.oidnCommitDevice(self._handle)
        self._library.check(self._handle, "starting its device")
        number = call.oidnGetDeviceInt(self._handle, b"version")
        version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
        self.name = f"Open Image Denoise {version} ({self._kind.upper()})"
        if number // 10000 != _MAJOR:
            raise DenoiseError(
                f"'{self._library.path}' is version {version}: Hemibake needs version {_MAJOR}. {REMEDY}."
            )

    def _release_filter(self) -> None:
        if self._filter is not None:
            self._filter.release()
            self._filter = None


class _Filter:
    """Filter "RT" for high dynamic range images, and its image buffer on a device.

    shape:  shape of the image, (h, w, 3), which is filtered in place
    """

    def __init__(self, library: DenoiseLibrary, device: int, shape: tuple[int, ...]) -> None:
        self.shape, self._library, self._device = shape, library, device
        call, (height, width, _) = library.call, shape
        self._size = 4 * math.prod(shape)
        self._buffer = call.oidnNewBuffer(device, self._size)
        self._handle = call.oidnNewFilter(device, b"RT")
        try:
            library.check(device, f"taking memory for {width} x {height} pixels")
            self._commit()
        except DenoiseError:
            self.release()
            raise

    def run(self, image: np.ndarray) -> np.ndarray:
        """Return the filtered image."""
        call, image = self._library.call, np.ascontiguousarray(image, np.float32)
        filtered = np.empty(self.shape, np.float32)
        call.oidnWriteBuffer(self._buffer, 0, self._size, image.ctypes.data)
        call.oidnExecuteFilter(self._handle)
        call.oidnReadBuffer(self._buffer, 0, self._size, filtered.ctypes.data)
        self._library.check(self._device, "filtering")
        return filtered

    def release(self) -> None:
        """Free filter and buffer."""
        call = self._library.call
        if self._handle:
            call.oidnReleaseFilter(self._handle)
        if self._buffer:
            call.oidnReleaseBuffer(self._buffer)

    def _commit(self) -> None:
        call, (height, width, _) = self._library.call, self.shape
        for name in (b"color", b"output"):
            call.oidnSetFilterImage(self._handle, name, self._buffer, _FLOAT3, width, height, 0, 0, 0)
        call.oidnSetFilterBool(self._handle, b"hdr", True)
        call.oidnSetFilterFloat(self._handle, b"inputScale", 1)
        call.oidnSetFilterInt(self._handle, b"maxMemoryMB", _MEMORY)
        call.oidnCommitFilter(self._handle)
        self._library.check(self._device, "preparing its filter")
