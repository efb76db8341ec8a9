"""Description of the machine for stored measurements."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyopencl as cl

from benchmarks.options import ROOT
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext

_PACKAGES = ("numpy", "moderngl", "pyopencl", "pocl-binary-distribution", "bpy", "xatlas")


def has_bpy() -> bool:
    """Return whether Blender is there as a Python module."""
    return importlib.util.find_spec("bpy") is not None


def facts() -> dict[str, Any]:
    """Return date, commit, devices, drivers and versions."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": _said("git", "rev-parse", "--short=10", "HEAD"),
        "changed": bool(_said("git", "status", "--porcelain", "--untracked-files=no")),
        "system": platform.platform(),
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: version for name in _PACKAGES if (version := _version(name))},
        "nvidia_driver": _nvidia_driver(),
        "opencl": _opencl(),
        "opengl": _opengl(),
    }


def _opencl() -> dict[str, Any]:
    """Return the device that the engine chooses."""
    device = ComputeDevice().device
    return {
        "device": device.name.strip(),
        "gpu": bool(device.type & cl.device_type.GPU),
        "platform": device.platform.version.strip(),
        "driver": device.driver_version.strip(),
        "compute_units": device.max_compute_units,
        "memory_bytes": device.global_mem_size,
    }


def _opengl() -> dict[str, Any]:
    graphics = GraphicsContext()
    try:
        info = graphics.context.info
        return {name: info[f"GL_{name.upper()}"] for name in ("renderer", "vendor", "version")}
    finally:
        graphics.release()


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.processor()


def _nvidia_driver() -> str | None:
    if shutil.which("nvidia-smi") is None:
        return None
    return _said("nvidia-smi", "--query-gpu=driver_version", "--format=csv,noheader")


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _said(*command: str) -> str | None:
    """Return the output of a command; None if it is missing or fails."""
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
