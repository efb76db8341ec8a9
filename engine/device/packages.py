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
                f"Install the file of Hemibake that is made for this system and Python {_python()}, or into "
                f"the Python of a checkout '{sys.executable} -m pip install {name}', then bake again."
            ) from error


def _python() -> str:
    """Return the version of this Python that packages are made for."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"
