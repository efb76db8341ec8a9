"""Python packages that a bake needs in addition to NumPy."""

from __future__ import annotations

import importlib
import sys

from ..errors import DeviceError

#: Purpose of each package in a bake. PyOpenCL may be absent: OpenGL 4.3 then casts the rays.
_PURPOSES = {
    "moderngl": "draws with OpenGL",
    "glcontext": "starts OpenGL",
    "pyopencl": "computes with OpenCL",
}
_REQUIRED = ("moderngl", "glcontext")


def require_packages() -> None:
    """Raise a DeviceError that names the first required package that cannot be imported, and the remedy."""
    for name in _REQUIRED:
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise DeviceError(missing_package(name, error)) from error


def missing_package(name: str, error: ImportError) -> str:
    """Return the sentences for the user about a package that cannot be imported."""
    return (
        f"The Python package '{name}', which {_PURPOSES[name]}, cannot be imported ({error}). "
        f"Install the Hemibake package for this system and Python {_python()}; in a checkout, run "
        f"'{sys.executable} -m pip install {name}'. Then bake again."
    )


def _python() -> str:
    """Return the Python version in the form that packages use, such as "3.11"."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"
