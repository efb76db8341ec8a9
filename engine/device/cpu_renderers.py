"""OpenGL drivers that draw on the CPU."""

from __future__ import annotations

#: Parts of the names of drivers that draw on the CPU.
_CPU_DRIVERS = ("llvmpipe", "softpipe", "swrast", "SwiftShader", "GDI Generic", "Basic Render")


def draws_on_cpu(device: str) -> bool:
    """Return True if an OpenGL renderer of this name draws on the CPU."""
    return any(name in device for name in _CPU_DRIVERS)
