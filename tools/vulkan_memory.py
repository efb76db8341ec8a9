"""GPU memory that Vulkan allocates for import by other APIs, through ctypes."""

from __future__ import annotations

import ctypes
from ctypes import (
    POINTER,
    Structure,
    byref,
    c_char_p,
    c_float,
    c_int,
    c_uint32,
    c_uint64,
    c_void_p,
)
from typing import Any

#: Vulkan's loader, and a driver that has the same entry where there is no loader.
_LIBRARIES = ("libvulkan.so.1", "libGLX_nvidia.so.0")

#: VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT
_OPAQUE_FD, _DEVICE_LOCAL = 1, 1

#: Memory comes in multiples of this.
_PAGE = 1 << 16


class _Info(Structure):
    """Any Vk...CreateInfo begins so."""

    _fields_ = (("kind", c_uint32), ("next", c_void_p))


class _Application(_Info):
    _fields_ = (
        ("name", c_char_p), ("version", c_uint32), ("engine", c_char_p), ("engine_version", c_uint32),
        ("api", c_uint32),
    )  # fmt: skip


class _Instance(_Info):
    _fields_ = (
        ("flags", c_uint32), ("application", c_void_p), ("layers", c_uint32), ("layer_names", c_void_p),
        ("extensions", c_uint32), ("extension_names", c_void_p),
    )  # fmt: skip


class _Queue(_Info):
    _fields_ = (
        ("flags", c_uint32), ("family", c_uint32), ("count", c_uint32), ("priorities", POINTER(c_float)),
    )  # fmt: skip


class _Device(_Info):
    _fields_ = (
        ("flags", c_uint32), ("queues", c_uint32), ("queue", c_void_p), ("layers", c_uint32),
        ("layer_names", c_void_p), ("extensions", c_uint32), ("extension_names", POINTER(c_char_p)),
        ("features", c_void_p),
    )  # fmt: skip


class _Export(_Info):
    _fields_ = (("handles", c_uint32),)


class _Allocation(_Info):
    _fields_ = (("size", c_uint64), ("memory_type", c_uint32))


class _Descriptor(_Info):
    _fields_ = (("memory", c_uint64), ("handle", c_uint32))


class _MemoryProperties(Structure):
    _fields_ = (
        ("count", c_uint32),
        ("types", c_uint32 * 2 * 32),
        ("heaps", c_uint32),
        ("heap", c_uint64 * 32),
    )


class VulkanMemory:
    """Allocates on the first device of Vulkan; raises OSError where there is none or a call fails."""

    def __init__(self) -> None:
        self._instance_function = _entry()
        application = _Application(0, None, b"Hemibake", 0, None, 0, (1 << 22) | (1 << 12))
        info = _Instance(1, None, 0, ctypes.cast(byref(application), c_void_p), 0, None, 0, None)
        self._instance = c_void_p()
        self._call("vkCreateInstance", None, byref(info), None, byref(self._instance))

        # The first device, and a kind of memory that lies on it.
        count, devices = c_uint32(1), (c_void_p * 1)()
        self._call(
            "vkEnumeratePhysicalDevices", self._instance, self._instance, byref(count), devices, most=5
        )
        if not count.value:
            raise OSError("Vulkan has no device.")
        memory = _MemoryProperties()
        self._call(
            "vkGetPhysicalDeviceMemoryProperties", self._instance, c_void_p(devices[0]), byref(memory),
            checked=False,
        )  # fmt: skip
        self._kind = next(k for k in range(memory.count) if memory.types[k][0] & _DEVICE_LOCAL)

        priority, extension = (c_float * 1)(1.0), (c_char_p * 1)(b"VK_KHR_external_memory_fd")
        queue = _Queue(2, None, 0, 0, 1, priority)
        info = _Device(3, None, 0, 1, ctypes.cast(byref(queue), c_void_p), 0, None, 1, extension, None)
        self._device = c_void_p()
        self._call(
            "vkCreateDevice", self._instance, c_void_p(devices[0]), byref(info), None, byref(self._device)
        )

    def export(self, least: int) -> tuple[int, int, int]:
        """Return two file descriptors of the same new memory of `least` bytes or more, and its size."""
        size = -(-least // _PAGE) * _PAGE
        export = _Export(1000072002, None, _OPAQUE_FD)
        info = _Allocation(5, ctypes.cast(byref(export), c_void_p), size, self._kind)
        memory = c_uint64()
        self._call("vkAllocateMemory", self._instance, self._device, byref(info), None, byref(memory))
        first, second = (self._descriptor(memory.value) for _ in range(2))
        return first, second, size

    def _descriptor(self, memory: int) -> int:
        info, descriptor = _Descriptor(1000074002, None, memory, _OPAQUE_FD), c_int(-1)
        self._call("vkGetMemoryFdKHR", self._instance, self._device, byref(info), byref(descriptor))
        return descriptor.value

    def _call(self, name: str, instance: Any, *arguments: Any, checked: bool = True, most: int = 0) -> None:
        """Call a function of an instance; a result beyond `most` is an error."""
        address = self._instance_function(instance, name.encode())
        if not address:
            raise OSError(f"Vulkan has no function {name}.")
        code = ctypes.CFUNCTYPE(c_int, *[c_void_p] * len(arguments))(address)(
            *(ctypes.cast(argument, c_void_p) if argument is not None else None for argument in arguments)
        )  # fmt: skip
        if checked and not 0 <= code <= most:
            raise OSError(f"Vulkan: {name} fails with error {code}.")


def _entry() -> Any:
    """Return vkGetInstanceProcAddr of the loader, or of a driver; raises OSError without either."""
    for file in _LIBRARIES:
        try:
            library = ctypes.CDLL(file)
        except OSError:
            continue
        if file == _LIBRARIES[0]:
            entry = library.vkGetInstanceProcAddr
        else:
            version = c_uint32(5)
            library.vk_icdNegotiateLoaderICDInterfaceVersion(byref(version))
            entry = library.vk_icdGetInstanceProcAddr
        entry.restype, entry.argtypes = c_void_p, (c_void_p, c_char_p)
        return entry
    raise OSError("Vulkan is not installed.")
