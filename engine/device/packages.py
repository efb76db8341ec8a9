"""The Python packages that a bake needs beside NumPy."""

from __future__ import annotations

import importlib
import sys

from ..errors import DeviceError

#: What each package does for a bake.
_PURPOSES = {
    "moderngl": "draws with OpenGL",
    "glcontext": "starts OpenGL",
    "pyopencl": "computes with OpenCL",
}


def require_packages() -> None:
    """Raise a DeviceError that names the first package that cannot be imported, and the remedy."""
    for name, purpose in _PURPOSES.items():
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise DeviceError(
                f"The Python package '{name}', which {purpose}, cannot be imported ({error}). "
                f"Install it with '{sys.executable} -m pip install {name}', then bake again."
            ) from error
