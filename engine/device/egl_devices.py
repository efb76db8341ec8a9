"""Mapping from CUDA devices to EGL devices, so that a process draws on the GPU where it computes."""

from __future__ import annotations

import ctypes
import sys
from ctypes import CFUNCTYPE, POINTER, byref, c_char_p, c_int, c_ssize_t, c_uint, c_void_p

#: EGL_CUDA_DEVICE_NV of extension EGL_NV_device_cuda, and maximum number of devices.
_CUDA_DEVICE, _MOST = 0x323A, 64

_QueryDevices = CFUNCTYPE(c_uint, c_int, POINTER(c_void_p), POINTER(c_int))
_QueryAttribute = CFUNCTYPE(c_uint, c_void_p, c_int, POINTER(c_ssize_t))


def egl_devices() -> dict[int, int]:
    """Return the EGL device index for each CUDA device index; empty if EGL does not report it."""
    if not sys.platform.startswith("linux"):
        return {}
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return {}
    egl.eglGetProcAddress.restype, egl.eglGetProcAddress.argtypes = c_void_p, [c_char_p]
    query = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    attribute = egl.eglGetProcAddress(b"eglQueryDeviceAttribEXT")
    if not (query and attribute):
        return {}
    devices, count, number = (c_void_p * _MOST)(), c_int(), c_ssize_t()
    _QueryDevices(query)(_MOST, devices, byref(count))
    found = {}
    for index in range(count.value):
        if _QueryAttribute(attribute)(devices[index], _CUDA_DEVICE, byref(number)):
            found[number.value] = index
    return found
