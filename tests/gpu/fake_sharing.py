"""An OpenCL library that shares with OpenGL, for drivers that do not: with real objects and copies."""

import ctypes

import numpy as np
import pyopencl as cl

from engine.device.cl_library import loaded_library
from tools.cl_library import SIGNATURES
from tools.gl_interop import texture_bytes


class FakeLibrary:
    """Real function pointers, so that ctypes converts every argument.

    texture:     what is shared, as itself or in a buffer
    fails:       names of functions that return an error
    imported:    the OpenGL buffer that stands in for external memory
    calls:       name and arguments of all calls, in order
    properties:  of the context, or of the external memory
    """

    def __init__(self, compute, texture=None, fails=(), imported=None):
        self._compute, self._real, self._texture = compute, ctypes.CDLL(loaded_library()), texture
        self._fails, self._made, self._events = set(fails), {}, []
        self.imported, self.calls, self.properties = imported, [], []
        for name, (result, arguments) in SIGNATURES.items():
            setattr(self, name, ctypes.CFUNCTYPE(result, *arguments)(self._logged(name)))

    @property
    def names(self):
        return [name for name, *_ in self.calls]

    def _logged(self, name):
        def call(*arguments):
            self.calls.append((name, *arguments))
            if name in self._fails:
                if not name.startswith("clEnqueue"):
                    arguments[-1][0] = -59
                return -59 if name.startswith("clEnqueue") else 0
            return self._act(name, arguments)

        return call

    def _act(self, name, arguments):
        if name == "clGetExtensionFunctionAddressForPlatform":
            return ctypes.cast(getattr(self, arguments[1].decode()), ctypes.c_void_p).value
        if name == "clCreateContext":
            return self._context(*arguments)
        if name == "clCreateEventFromGLsyncKHR":
            return self._event()
        if name.startswith("clEnqueue"):
            if "Acquire" in name:
                self._copy(*self._made[arguments[2][0]])
            arguments[5][0] = self._event()
            return 0
        return self._memory(name, arguments)

    def _context(self, properties, count, devices, *_):
        while properties[len(self.properties)]:
            self.properties.append(properties[len(self.properties)])
        assert count == 1 and devices[0] == self._compute.device.int_ptr
        return self._retained("clRetainContext", self._compute.context)

    def _memory(self, name, arguments):
        """Return a real object of the size of the texture, to be filled from OpenGL's."""
        context, flags = self._compute.context, cl.mem_flags.READ_ONLY
        if name == "clCreateFromGLTexture":
            assert arguments[1:5] == (flags, 0x8C1A, 0, self._texture.glo)
            made, source = self._image(context, flags), None
        else:
            made, source = cl.Buffer(context, flags, texture_bytes(self._texture)), arguments[2]
            if name == "clCreateBufferWithProperties":
                self.properties, source = list(arguments[1][:3]), self.imported
        self._made[made.int_ptr] = (made, source)
        return self._retained("clRetainMemObject", made)

    def _image(self, context, flags):
        kind = (cl.channel_order.RGBA, cl.channel_type.FLOAT)
        if self._texture.components == 1:
            kind = (cl.channel_order.R, cl.channel_type.UNSIGNED_INT32)
        size = self._texture.size
        return cl.create_image(context, flags, cl.ImageFormat(*kind), shape=size, is_array=True)

    def _copy(self, made, buffer):
        """Fill an object with what OpenGL has in its own: the texture, or the buffer of a name."""
        if isinstance(made, cl.Image):
            where = {"origin": (0, 0, 0), "region": self._texture.size}
            cl.enqueue_copy(
                self._compute.queue, made, np.frombuffer(self._texture.read(), np.uint32), **where
            )
        else:
            cl.enqueue_copy(self._compute.queue, made, buffer_bytes(buffer, made.size))

    def _event(self):
        event = cl.UserEvent(self._compute.context)
        event.set_status(cl.command_execution_status.COMPLETE)
        self._events.append(event)
        return self._retained("clRetainEvent", event)

    def _retained(self, retain, thing):
        """Return a handle that the caller owns, too."""
        function = getattr(self._real, retain)
        function.argtypes = (ctypes.c_void_p,)
        assert function(thing.int_ptr) == 0
        return thing.int_ptr


def buffer_bytes(buffer, size):
    """Return the contents of an OpenGL buffer."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    read = ctypes.CFUNCTYPE(None, ctypes.c_uint, ctypes.c_ssize_t, ctypes.c_ssize_t, ctypes.c_void_p)
    values = np.empty(size, np.uint8)
    read(egl.eglGetProcAddress(b"glGetNamedBufferSubData"))(buffer, 0, size, values.ctypes.data)
    return values
