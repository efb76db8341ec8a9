"""The ladder of ways in which a texture array that OpenGL has drawn reaches OpenCL (paper, IV.C).

    texture          OpenCL reads the texture itself; its kernels read buffers: one copy on the device
    buffer           OpenGL copies it into a buffer of its own, which OpenCL reads
    external memory  the same in memory that belongs to neither of the two, as Vulkan allocates
    host             through host memory, see `host_copy.HostCopy`

What a driver offers stands in its lists of extensions. Some of what is listed does not work: a rung counts
once it has handed over what was drawn.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Collection
from typing import Any, Protocol

import moderngl
import numpy as np

from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.device.opencl import cl
from engine.device.raw_gl import FLOAT, TEXTURE_2D_ARRAY, UNSIGNED_INT, RawGL, Signatures
from engine.errors import DeviceError
from tools.cl_library import ClLibrary

#: OpenCL and OpenGL extensions that each way requires, from the best way to the simplest.
RUNGS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "texture": (("cl_khr_gl_sharing",), ()),
    "buffer": (("cl_khr_gl_sharing",), ()),
    "external memory": (
        ("cl_khr_external_memory", "cl_khr_external_memory_opaque_fd"),
        ("GL_EXT_memory_object", "GL_EXT_memory_object_fd"),
    ),
    "host": ((), ()),
}

#: macOS has a name of its own.
_APPLE = {"cl_khr_gl_sharing": "cl_APPLE_gl_sharing"}

#: Keys of an OpenCL context's properties.
_PLATFORM, _GL_CONTEXT, _EGL_DISPLAY, _GLX_DISPLAY, _WGL_HDC = 0x1084, 0x2008, 0x2009, 0x200A, 0x200B
_CGL_SHARE_GROUP = 0x10000000

#: An external memory's kind in OpenCL and in OpenGL: a file descriptor that only drivers understand.
_CL_OPAQUE_FD, _GL_OPAQUE_FD = 0x2060, 0x9586

_READ_ONLY = 1 << 2

_PIXEL_PACK_BUFFER, _RGBA, _RED_INTEGER = 0x88EB, 0x1908, 0x8D94

_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_SIGNATURES: Signatures = {
    "glBindTexture": (None, (_UINT, _UINT)),
    "glBindBuffer": (None, (_UINT, _UINT)),
    "glGetTexImage": (None, (_UINT, _INT, _UINT, _UINT, _POINTER)),
    "glCreateBuffers": (None, (_INT, ctypes.POINTER(_UINT))),
    "glCreateMemoryObjectsEXT": (None, (_INT, ctypes.POINTER(_UINT))),
    "glImportMemoryFdEXT": (None, (_UINT, ctypes.c_uint64, _UINT, _INT)),
    "glNamedBufferStorageMemEXT": (None, (_UINT, ctypes.c_ssize_t, _UINT, ctypes.c_uint64)),
}


class SharingGL(RawGL):
    """OpenGL functions that copy a texture array into memory of another API."""

    def __init__(self) -> None:
        super().__init__(_SIGNATURES)

    def imported_buffer(self, descriptor: int, size: int, kind: int) -> int:
        """Return a buffer in memory imported by a file descriptor (GL_EXT_memory_object_fd)."""
        memory, buffer = _UINT(), _UINT()
        self("glCreateMemoryObjectsEXT", 1, ctypes.byref(memory))
        self("glImportMemoryFdEXT", memory.value, size, kind, descriptor)
        self("glCreateBuffers", 1, ctypes.byref(buffer))
        self("glNamedBufferStorageMemEXT", buffer.value, size, memory.value, 0)
        return buffer.value

    def read_texture_array(self, texture: int, integers: bool, buffer: int) -> None:
        """Copy a texture array of 4 floats or one unsigned integer into a buffer."""
        self("glBindTexture", TEXTURE_2D_ARRAY, texture)
        self("glBindBuffer", _PIXEL_PACK_BUFFER, buffer)
        kind = (_RED_INTEGER, UNSIGNED_INT) if integers else (_RGBA, FLOAT)
        self("glGetTexImage", TEXTURE_2D_ARRAY, 0, *kind, None)
        self("glBindBuffer", _PIXEL_PACK_BUFFER, 0)


def missing_extensions(rung: str, opencl: Collection[str], opengl: Collection[str]) -> tuple[str, ...]:
    """Return the extensions that a way requires and that OpenCL or OpenGL does not list."""
    of_opencl, of_opengl = RUNGS[rung]
    lacks = [name for name in of_opencl if name not in opencl and _APPLE.get(name) not in opencl]
    return (*lacks, *(name for name in of_opengl if name not in opengl))


def shared_context(device: cl.Device, library: ClLibrary, properties: list[int]) -> cl.Context:
    """Return an OpenCL context that shares objects with an OpenGL context; see `current_gl_context`."""
    keys = [_PLATFORM, library.platform, *properties, 0]
    if sys.platform == "darwin":
        keys = [*properties, 0]
    devices = (ctypes.c_void_p * 1)(device.int_ptr)
    made = library.make("clCreateContext", (ctypes.c_ssize_t * len(keys))(*keys), 1, devices, None, None)
    return cl.Context.from_int_ptr(made, retain=False)


def current_gl_context() -> list[int]:
    """Return the properties of an OpenCL context that name the OpenGL context that is current.

    Raises DeviceError if none is.
    """
    finder = {"win32": _wgl, "darwin": _cgl}.get(sys.platform, _egl_or_glx)
    properties = finder()
    if not properties:
        raise DeviceError("No OpenGL context is current.")
    return properties


def _egl_or_glx() -> list[int]:
    for file, prefix, key in (("libEGL.so.1", "egl", _EGL_DISPLAY), ("libGL.so.1", "glX", _GLX_DISPLAY)):
        library = ctypes.CDLL(file)
        context, display = (
            _address(library, f"{prefix}GetCurrent{thing}") for thing in ("Context", "Display")
        )
        if context:
            return [_GL_CONTEXT, context, key, display]
    return []


def _wgl() -> list[int]:
    library = ctypes.CDLL("opengl32")
    context = _address(library, "wglGetCurrentContext")
    return [_GL_CONTEXT, context, _WGL_HDC, _address(library, "wglGetCurrentDC")] if context else []


def _cgl() -> list[int]:
    library = ctypes.CDLL("/System/Library/Frameworks/OpenGL.framework/OpenGL")
    context = _address(library, "CGLGetCurrentContext")
    library.CGLGetShareGroup.restype, library.CGLGetShareGroup.argtypes = ctypes.c_void_p, (ctypes.c_void_p,)
    return [_CGL_SHARE_GROUP, library.CGLGetShareGroup(context)] if context else []


def _address(library: Any, name: str) -> int:
    """Return the address that a function without arguments returns; 0 for none."""
    function = getattr(library, name)
    function.restype = ctypes.c_void_p
    return function() or 0


class Handover(Protocol):
    """Synchronisation of OpenGL and OpenCL."""

    name: str

    def to_opencl(self) -> list[cl.Event]:
        """Make OpenCL wait for the commands of OpenGL; return the events to wait for."""

    def to_opengl(self, released: int) -> None:
        """Have OpenGL wait for the event of a release."""


class Finish:
    """glFinish and clFinish, as the paper does: each API waits until the other has nothing to do."""

    name = "finish"

    def __init__(self, graphics: GraphicsContext, compute: ComputeDevice) -> None:
        self._graphics, self._queue = graphics, compute.queue

    def to_opencl(self) -> list[cl.Event]:
        """Wait for OpenGL."""
        self._graphics.context.finish()
        return []

    def to_opengl(self, released: int) -> None:
        """Wait for OpenCL."""
        cl.Event.from_int_ptr(released, retain=False)
        self._queue.finish()


class Events:
    """An event in OpenGL's queue that OpenCL waits for (cl_khr_gl_event); the host waits for OpenCL's."""

    name = "events"

    def __init__(self, graphics: GraphicsContext, compute: ComputeDevice, library: ClLibrary) -> None:
        self._raw, self._context, self._library = graphics.raw, compute.context, library

    def to_opencl(self) -> list[cl.Event]:
        """Return the event of a fence in OpenGL's queue."""
        fence = self._raw.fence()
        made = self._library.make("clCreateEventFromGLsyncKHR", self._context.int_ptr, fence)
        return [cl.Event.from_int_ptr(made, retain=False)]

    def to_opengl(self, released: int) -> None:
        """Wait for one event, and not for all of the queue."""
        cl.Event.from_int_ptr(released, retain=False).wait()


class SharedMemory:
    """An OpenCL object that is also OpenGL's, or nobody's; OpenCL has it from `acquire` to `release`.

    calls:  the names of the functions that acquire and release it
    """

    def __init__(
        self,
        compute: ComputeDevice,
        library: ClLibrary,
        handover: Handover,
        memory: int,
        calls: tuple[str, str],
    ) -> None:
        self._queue, self._library, self._handover = compute.queue, library, handover
        self._memory, (self._acquire, self._release) = memory, calls
        self._acquired = False

    def acquire(self) -> None:
        """Take it once OpenGL is done with it."""
        drawn = self._handover.to_opencl()
        waits = [event.int_ptr for event in drawn]
        event = self._library.hand_over(self._acquire, self._queue.int_ptr, self._memory, waits)
        cl.Event.from_int_ptr(event, retain=False)
        self._acquired = True

    def release(self) -> None:
        """Give it back, if OpenCL has it."""
        if self._acquired:
            self._handover.to_opengl(
                self._library.hand_over(self._release, self._queue.int_ptr, self._memory)
            )
            self._acquired = False


_GL_CALLS = ("clEnqueueAcquireGLObjects", "clEnqueueReleaseGLObjects")
_EXTERNAL_CALLS = ("clEnqueueAcquireExternalMemObjectsKHR", "clEnqueueReleaseExternalMemObjectsKHR")


class TextureShare:
    """An OpenCL buffer of the size of a texture array, filled on the device from the texture itself."""

    name = "texture"

    def __init__(
        self, compute: ComputeDevice, library: ClLibrary, handover: Handover, texture: moderngl.TextureArray
    ) -> None:
        self._queue, self._size = compute.queue, texture.size
        where = (compute.context.int_ptr, _READ_ONLY, TEXTURE_2D_ARRAY, 0, texture.glo)
        memory = library.make("clCreateFromGLTexture", *where)
        self._image = cl.Image.from_int_ptr(memory, retain=False)
        self._shared = SharedMemory(compute, library, handover, memory, _GL_CALLS)
        self.buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, texture_bytes(texture))

    def update(self) -> cl.Buffer:
        """Copy the texture array on the device; return the buffer."""
        self._shared.acquire()
        cl.enqueue_copy(self._queue, self.buffer, self._image, offset=0, origin=(0, 0, 0), region=self._size)
        self._shared.release()
        return self.buffer

    def release(self) -> None:
        """Do nothing: OpenCL has the texture during an update alone."""


class BufferShare:
    """An OpenGL buffer of the size of a texture array, filled by OpenGL, read by OpenCL."""

    name = "buffer"

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice,
        library: ClLibrary,
        handover: Handover,
        texture: moderngl.TextureArray,
    ) -> None:
        self._texture = texture
        self._pixels = graphics.context.buffer(reserve=texture_bytes(texture))
        memory = library.make("clCreateFromGLBuffer", compute.context.int_ptr, _READ_ONLY, self._pixels.glo)
        self.buffer = cl.Buffer.from_int_ptr(memory, retain=False)
        self._shared = SharedMemory(compute, library, handover, memory, _GL_CALLS)

    def update(self) -> cl.Buffer:
        """Let OpenGL copy the texture array.

        Return the buffer, which OpenCL may use until the next update.
        """
        self._shared.release()
        self._texture.read_into(self._pixels)
        self._shared.acquire()
        return self.buffer

    def release(self) -> None:
        """Return the buffer to OpenGL before it is deleted, since some drivers wait endlessly otherwise."""
        self._shared.release()


class ExternalShare:
    """A buffer of the size of a texture array in memory that both import, filled by OpenGL, read by OpenCL.

    export:  returns two file descriptors of the same new memory of at least so many bytes, and how many it
             has
    """

    name = "external memory"

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice,
        library: ClLibrary,
        handover: Handover,
        texture: moderngl.TextureArray,
        export: Callable[[int], tuple[int, int, int]],
    ) -> None:
        self._raw, self._texture = SharingGL(), texture
        for_opengl, for_opencl, size = export(texture_bytes(texture))
        self._pixels = self._raw.imported_buffer(for_opengl, size, _GL_OPAQUE_FD)
        graphics.check("importing external memory")
        keys = (ctypes.c_uint64 * 3)(_CL_OPAQUE_FD, for_opencl, 0)
        memory = library.make(
            "clCreateBufferWithProperties", compute.context.int_ptr, keys, _READ_ONLY, size, None
        )
        self.buffer = cl.Buffer.from_int_ptr(memory, retain=False)
        self._shared = SharedMemory(compute, library, handover, memory, _EXTERNAL_CALLS)

    def update(self) -> cl.Buffer:
        """Let OpenGL copy the texture array.

        Return the buffer, which OpenCL may use until the next update.
        """
        self._shared.release()
        self._raw.read_texture_array(self._texture.glo, self._texture.dtype == "u4", self._pixels)
        self._shared.acquire()
        return self.buffer

    def release(self) -> None:
        """Give the buffer back: a driver may wait for ever for what is deleted while OpenCL has it."""
        self._shared.release()


def texture_bytes(texture: moderngl.TextureArray) -> int:
    """Return the bytes of a texture array of numbers of four bytes."""
    return int(np.prod(texture.size)) * texture.components * 4
