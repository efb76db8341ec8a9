"""OpenGL functions that ModernGL lacks, called by ctypes on the current context."""

from __future__ import annotations

import ctypes
import sys
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

FRAMEBUFFER = 0x8D40
DEPTH_ATTACHMENT = 0x8D00
FRAMEBUFFER_COMPLETE = 0x8CD5
TEXTURE_2D_ARRAY = 0x8C1A
TEXTURE0 = 0x84C0
MIN_FILTER, MAG_FILTER, NEAREST = 0x2801, 0x2800, 0x2600
ARRAY_BUFFER = 0x8892
UNSIGNED_INT = 0x1405
COLOR = 0x1800
DEPTH = 0x1801
DEPTH_COMPONENT = 0x1902
DEPTH_COMPONENT32F = 0x8CAC
FLOAT = 0x1406
LOWER_LEFT = 0x8CA1
ZERO_TO_ONE = 0x935F
DEPTH_CLAMP = 0x864F
SYNC_GPU_COMMANDS_COMPLETE = 0x9117

_UINT, _INT, _FLOAT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_float, ctypes.c_void_p

#: Result and argument types of functions by name.
Signatures = dict[str, tuple[Any, tuple[Any, ...]]]

_SIGNATURES: Signatures = {
    "glGenTextures": (None, (_INT, ctypes.POINTER(_UINT))),
    "glDeleteTextures": (None, (_INT, ctypes.POINTER(_UINT))),
    "glBindTexture": (None, (_UINT, _UINT)),
    "glActiveTexture": (None, (_UINT,)),
    "glTexParameteri": (None, (_UINT, _UINT, _INT)),
    "glTexImage3D": (None, (_UINT, _INT, _INT, _INT, _INT, _INT, _INT, _UINT, _UINT, _POINTER)),
    "glFramebufferTexture": (None, (_UINT, _UINT, _UINT, _INT)),
    "glCheckFramebufferStatus": (_UINT, (_UINT,)),
    "glViewportArrayv": (None, (_UINT, _INT, _POINTER)),
    "glClearBufferuiv": (None, (_UINT, _INT, ctypes.POINTER(_UINT))),
    "glClearBufferfv": (None, (_UINT, _INT, ctypes.POINTER(_FLOAT))),
    "glBindVertexArray": (None, (_UINT,)),
    "glBindBuffer": (None, (_UINT, _UINT)),
    "glVertexAttribIPointer": (None, (_UINT, _INT, _UINT, _INT, _POINTER)),
    "glClipControl": (None, (_UINT, _UINT)),
    "glFenceSync": (_POINTER, (_UINT, _UINT)),
    "glFlush": (None, ()),
}


class RawGL:
    """OpenGL functions by name, valid for the lifetime of the context in which they were found."""

    def __init__(self, signatures: Signatures = _SIGNATURES) -> None:
        address_of = _address_finder()
        prototype = ctypes.CFUNCTYPE
        if sys.platform == "win32":
            prototype = ctypes.WINFUNCTYPE
        self._functions: dict[str, Callable[..., Any]] = {}
        self._unused: list[int] = []
        for name, (result, arguments) in signatures.items():
            address = address_of(name)
            if address:
                self._functions[name] = prototype(result, *arguments)(address)

    def __contains__(self, name: str) -> bool:
        return name in self._functions

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call a function by name."""
        return self._functions[name](*arguments)

    def depth_array(self, width: int, height: int, layers: int) -> DepthArray:
        """Create a 32-bit float depth texture array."""
        name = _UINT()
        self("glGenTextures", 1, ctypes.byref(name))
        self("glBindTexture", TEXTURE_2D_ARRAY, name.value)
        self(
            "glTexImage3D", TEXTURE_2D_ARRAY, 0, DEPTH_COMPONENT32F, width, height, layers, 0,
            DEPTH_COMPONENT, FLOAT, None,
        )  # fmt: skip
        for filtering in (MIN_FILTER, MAG_FILTER):
            self("glTexParameteri", TEXTURE_2D_ARRAY, filtering, NEAREST)
        depth = DepthArray(self, name.value)
        weakref.finalize(depth, self._unused.append, name.value)
        return depth

    def delete_unused(self) -> None:
        """Delete unreferenced depth arrays."""
        while self._unused:
            self("glDeleteTextures", 1, ctypes.byref(_UINT(self._unused.pop())))

    def instances_from(self, vertex_array: int, location: int, buffer: int, offset: int) -> None:
        """Bind a per-instance unsigned integer attribute to a byte offset of a buffer."""
        self("glBindVertexArray", vertex_array)
        self("glBindBuffer", ARRAY_BUFFER, buffer)
        self("glVertexAttribIPointer", location, 1, UNSIGNED_INT, 0, offset)

    def set_viewports(self, viewports: np.ndarray) -> None:
        """Set the first viewports: x, y, width and height, (k, 4) float32, contiguous."""
        self("glViewportArrayv", 0, len(viewports), viewports.ctypes.data)

    def clear_integers(self, value: int) -> None:
        """Clear the unsigned integer colors of all layers of the bound framebuffer."""
        self("glClearBufferuiv", COLOR, 0, (_UINT * 4)(value, value, value, value))

    def clear_depth(self, depth: float) -> None:
        """Clear the depth of all layers of the bound framebuffer."""
        self("glClearBufferfv", DEPTH, 0, (_FLOAT * 1)(depth))

    def fence(self) -> int:
        """Insert a fence into the queue; return its GLsync."""
        fence = self("glFenceSync", SYNC_GPU_COMMANDS_COMPLETE, 0)
        self("glFlush")
        return int(fence)

    def attach_layered_depth(self, depth: DepthArray) -> bool:
        """Attach a depth array to the bound framebuffer; return True if it is complete."""
        self("glFramebufferTexture", FRAMEBUFFER, DEPTH_ATTACHMENT, depth.name, 0)
        return bool(self("glCheckFramebufferStatus", FRAMEBUFFER) == FRAMEBUFFER_COMPLETE)


class DepthArray:
    """Depth texture array with an OpenGL name."""

    def __init__(self, raw: RawGL, name: int) -> None:
        self._raw, self.name = raw, name

    def use(self, unit: int) -> None:
        """Bind the array to a texture unit."""
        self._raw("glActiveTexture", TEXTURE0 + unit)
        self._raw("glBindTexture", TEXTURE_2D_ARRAY, self.name)


def _address_finder() -> Callable[[str], int | None]:
    """Return the platform's function that finds the address of an OpenGL function."""
    if sys.platform == "win32":
        library = ctypes.WinDLL("opengl32")
        library.wglGetProcAddress.restype = _POINTER
        library.wglGetProcAddress.argtypes = (ctypes.c_char_p,)
        return lambda name: library.wglGetProcAddress(name.encode()) or _exported(library, name)
    if sys.platform == "darwin":
        framework = ctypes.CDLL("/System/Library/Frameworks/OpenGL.framework/OpenGL")
        return lambda name: _exported(framework, name)
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = _POINTER
    egl.eglGetProcAddress.argtypes = (ctypes.c_char_p,)
    return lambda name: egl.eglGetProcAddress(name.encode())


def _exported(library: ctypes.CDLL, name: str) -> int | None:
    """Return the address of an exported symbol, or None."""
    try:
        return ctypes.cast(getattr(library, name), _POINTER).value
    except AttributeError:
        return None
