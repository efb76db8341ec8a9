"""Needs of OpenCL drivers: environment variables set before OpenCL is loaded, and missing built-ins."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import MutableMapping
from contextlib import suppress
from pathlib import Path

from .opencl import cl
from .planned_program import Source
from .program_cache import build
from .source import program_source

#: Disables vectorization in Intel's CPU driver. With it, kernels return NaN or false shadows on an AMD EPYC
#: (version 2026.2, measured); without it they match PoCL and build faster.
_OPTIONS = {"CL_CONFIG_CPU_VECTORIZER_MODE": "1"}

#: Mesa driver for each kernel driver of a GPU. rusticl offers only drivers that RUSTICL_ENABLE lists.
_MESA_DRIVERS = {
    "amdgpu": "radeonsi", "radeon": "radeonsi", "i915": "iris", "xe": "iris", "nouveau": "nouveau",
    "asahi": "asahi", "msm": "freedreno", "panfrost": "panfrost", "panthor": "panfrost", "v3d": "v3d",
}  # fmt: skip

#: Mesa driver for CPUs, on machines without a GPU that Mesa supports.
_SOFTWARE = "llvmpipe"

#: Folder of ICD files, which name the OpenCL drivers.
_VENDORS = "etc/OpenCL/vendors"


def set_driver_options(environment: MutableMapping[str, str] = os.environ, root: Path = Path("/")) -> None:
    """Set the variables that the user has not set.

    root:  root of the file system
    """
    for name, value in _OPTIONS.items():
        environment.setdefault(name, value)
    if sys.platform != "linux":
        return
    environment.setdefault("RUSTICL_ENABLE", ",".join(mesa_drivers(root)))
    folder = vendor_folder(root)
    if folder is not None and "OPENCL_VENDOR_PATH" not in environment:
        environment.setdefault("OCL_ICD_VENDORS", str(folder))


def mesa_drivers(root: Path = Path("/")) -> list[str]:
    """Return the names of Mesa's drivers for the GPUs of this machine, for its CPU if there is none."""
    links = sorted((root / "sys/class/drm").glob("card*/device/driver"))
    kernel = [os.path.basename(os.path.realpath(link)) for link in links]
    found = dict.fromkeys(_MESA_DRIVERS[name] for name in kernel if name in _MESA_DRIVERS)
    return list(found) or [_SOFTWARE]


def vendor_folder(root: Path = Path("/")) -> Path | None:
    """Return the folder of ICD files in Flatpak's GL extensions if the usual folder has none, else None.

    Flatpak merges them into GL/OpenCL/vendors; extensions of a vendor precede Mesa's, which is "default".
    """
    if any((root / _VENDORS).glob("*.icd")):
        return None
    base = root / f"usr/lib/{platform.machine()}-linux-gnu/GL"
    extensions = sorted(base.glob("*/OpenCL/vendors"), key=lambda path: "default" in path.parts)
    folders = [base / "OpenCL/vendors", *extensions]
    return next((folder for folder in folders if any(folder.glob("*.icd"))), None)


#: Test kernel with built-in functions that an incomplete driver may lack, such as Mesa with a missing libclc.
_PROBE = """
__kernel void probe(__global float *x)
{
    x[get_global_id(0)] = fma(sqrt(2.0f), sin(x[0]), atan2(x[1], x[2]));
}
"""

#: Files of kernels/ with replacements.
_REPLACEMENTS: Source = ("own_builtins.cl",)


def needed_replacements(context: cl.Context) -> Source:
    """Return the files of kernels/ that programs of a driver need before their own; mostly none.

    Raises cl.Error if the driver builds the test kernel neither without nor with replacements.
    """
    try:
        build(context, _PROBE)
    except cl.Error:
        with suppress(cl.Error):
            build(context, program_source(_REPLACEMENTS) + _PROBE)
            return _REPLACEMENTS
        raise
    return ()
