"""Prints and times the ways in which OpenGL can share textures with OpenCL on a machine (paper, IV.C).

Takes less than a minute. Each way is tried in a process of its own. Figures of desktop cards are welcome.

    python tools/probe_sharing.py [--mib 64] [--device "NVIDIA CUDA: ..."]
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pyopencl as cl

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.tables import table
from engine import Settings
from engine.device.cl_device import ComputeDevice, device_name, found_devices
from engine.device.gl_context import GraphicsContext
from engine.device.host_copy import HostCopy
from engine.errors import EngineError
from engine.gather.glsl_integrator import GlslIntegrator
from engine.gather.opencl_integrator import HemicubeIntegrator
from engine.patches.patch_scene import make_patch_scene
from engine.visibility.raster.hemicubes import Hemicubes
from engine.visibility.raster.targets import RadianceTarget
from engine.visibility.raster.tiles import COPIED_RADIANCE_BYTES, plan_tiles
from tests.analytic.scenes import nine_quad_room
from tools import gl_interop
from tools.cl_library import ClLibrary
from tools.vulkan_memory import VulkanMemory

ROOT = Path(__file__).resolve().parents[1]

#: Updates that are timed, after one that is not; seconds after which no more begin.
_UPDATES, _BUDGET = 20, 3.0

#: Seconds that a way gets.
_PATIENCE = 15

#: Extensions that have to do with sharing.
_WORDS = ("gl_", "GL_ARB_cl_event", "external", "memory_object", "EXT_semaphore", "khr_semaphore")


def main() -> None:
    """Print the lists of extensions, the ways, and the time of an iteration for sharing."""
    options = _options()
    if options.rung:
        _alone(*options.rung, options)
        return
    graphics = GraphicsContext()
    try:
        context = graphics.context
        print(f"OpenGL: {graphics.name}, {context.info['GL_VERSION']}")
        print("  " + (" ".join(sorted(filter(_shares, context.extensions))) or "nothing about sharing"))
        for device in found_devices():
            print(f"OpenCL: {device_name(device)}, driver {device.driver_version.strip()}")
            listed = sorted(filter(_shares, device.extensions.split()))
            print("  " + (" ".join(listed) or "nothing about sharing"))
        compute = ComputeDevice(opencl_device=options.device)
        print(f"\nThe ladder on {device_name(compute.device)}, {options.mib} MiB:\n", flush=True)
        rows = _ladder(graphics, compute.device, options)
        print(table(("way", "waits by", "ms", "GB/s", "outcome"), rows))
        print(f"\nAn iteration of 10,700 patches, hemicubes {options.hemicube} wide:\n", flush=True)
        print(table(("part", "ms", "of the whole"), iteration(graphics, compute, options.hemicube)))
    finally:
        graphics.release()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mib", type=int, default=64, help="size of the texture array")
    parser.add_argument("--hemicube", type=int, default=32, help="width of the hemicubes of the iteration")
    parser.add_argument("--device", help="OpenCL device, as this tool prints it")
    parser.add_argument("--rung", nargs=2, metavar=("WAY", "WAITS"), help="try one way, and print its row")
    return parser.parse_args()


def _shares(extension: str) -> bool:
    return any(word in extension for word in _WORDS)


def _ladder(
    graphics: GraphicsContext, device: cl.Device, options: argparse.Namespace
) -> list[tuple[str | None, ...]]:
    """Return a row for each way, from the best to the host's."""
    opencl, rows = device.extensions.split(), []
    for rung in gl_interop.RUNGS:
        missing = gl_interop.missing_extensions(rung, opencl, graphics.context.extensions)
        if missing:
            rows.append((rung, None, None, None, f"not offered: no {', '.join(missing)}"))
            continue
        kinds = ["copy"] if rung == "host" else ["finish"]
        if rung in ("texture", "buffer") and "cl_khr_gl_event" in opencl:
            kinds.append("events")
        rows += [(rung, kind, *_tried(rung, kind, options)) for kind in kinds]
    return rows


def _tried(rung: str, kind: str, options: argparse.Namespace) -> list[Any]:
    """Return milliseconds, GB/s and outcome of a way, found out by a process of its own: drivers may hang."""
    command = [sys.executable, __file__, "--mib", str(options.mib), "--rung", rung, kind]
    command += ["--device", options.device] if options.device else []
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    row = [None, None, ""]
    if done.stdout:
        row = json.loads(done.stdout.splitlines()[-1])
    if done.returncode:
        where = next((line.strip() for line in done.stderr.splitlines() if 'File "' in line), "at its end")
        kind = f"no answer in {_PATIENCE} s" if "Timeout" in done.stderr else f"ends with {done.returncode}"
        row[2] += f" {kind}: {where.replace(str(ROOT), '')}"
    return row


def _alone(rung: str, kind: str, options: argparse.Namespace) -> None:
    """Print milliseconds, GB/s and outcome of a way as JSON; who waits longer ends, and tells where."""
    faulthandler.enable()
    faulthandler.dump_traceback_later(_PATIENCE, exit=True)
    graphics, compute = GraphicsContext(), ComputeDevice(opencl_device=options.device)
    texture = graphics.context.texture_array((1024, 1024, max(1, options.mib // 16)), 4, dtype="f4")
    try:
        share, compute = _share(rung, kind, graphics, compute, texture)
        right = _hands_over(share, compute, texture)
        seconds = _time(lambda: (share.update(), compute.queue.finish()))
        share.release()
        rate = gl_interop.texture_bytes(texture) / seconds / 1e9
        row = [1000 * seconds, rate, "works" if right else "WRONG VALUES"]
    except (EngineError, cl.Error, OSError) as error:
        row = [None, None, str(error).splitlines()[0]]
    print(json.dumps(row), flush=True)


def _share(
    rung: str, kind: str, graphics: GraphicsContext, compute: ComputeDevice, texture: moderngl.TextureArray
) -> tuple[Any, ComputeDevice]:
    """Return a way to share a texture, and the device with the context that can."""
    if rung == "host":
        return HostCopy(compute, texture), compute
    library = ClLibrary(compute.device.platform.int_ptr)
    if rung == "external memory":
        handover = gl_interop.Finish(graphics, compute)
        export = VulkanMemory().export
        return gl_interop.ExternalShare(graphics, compute, library, handover, texture, export), compute
    graphics.use()
    properties = gl_interop.current_gl_context()
    context_of = partial(gl_interop.shared_context, library=library, properties=properties)
    compute = ComputeDevice(opencl_device=device_name(compute.device), context_of=context_of)
    handover = gl_interop.Finish(graphics, compute)
    if kind == "events":
        handover = gl_interop.Events(graphics, compute, library)
    if rung == "texture":
        return gl_interop.TextureShare(compute, library, handover, texture), compute
    return gl_interop.BufferShare(graphics, compute, library, handover, texture), compute


def _hands_over(share: Any, compute: ComputeDevice, texture: moderngl.TextureArray) -> bool:
    """Return True if OpenCL reads the drawn image correctly, twice."""
    random = np.random.default_rng(5)
    for _ in range(2):
        drawn = random.random(gl_interop.texture_bytes(texture) // 4, np.float32)
        texture.write(drawn.tobytes())
        seen = np.empty_like(drawn)
        cl.enqueue_copy(compute.queue, seen, share.update())
        if not np.array_equal(seen, drawn):
            return False
    return True


def _time(work: Callable[[], object]) -> float:
    """Return the mean seconds of some work."""
    work()
    start, times = time.perf_counter(), 0
    while times < _UPDATES and time.perf_counter() - start < _BUDGET:
        work()
        times += 1
    return (time.perf_counter() - start) / times


def iteration(
    graphics: GraphicsContext, compute: ComputeDevice, hemicube: int
) -> list[tuple[str, float, str]]:
    """Return the times of the parts of an iteration: in OpenGL alone, and with a copy to OpenCL."""
    scene, settings = nine_quad_room(), Settings(resolution=128, hemicube=hemicube, sample_emission=False)
    patch_scene = make_patch_scene(graphics, compute, scene, settings)
    tiles = plan_tiles(settings, len(patch_scene.patches), COPIED_RADIANCE_BYTES)
    emission, sky = patch_scene.surfaces.emission, np.zeros((1, 1, 3), np.float32)
    target = RadianceTarget(graphics, tiles, emission, (0.0, 0.0, 0.0, 2.0))
    target.set_radiance(emission)
    hemicubes = Hemicubes(graphics, patch_scene, tiles, target, settings, again=True)
    rows = []
    seconds = {"draw, glFinish": 0.0, "GLSL sum, nothing leaves": 0.0}
    glsl = (
        GlslIntegrator(graphics, tiles, target.texture, hemicubes.depth, sky) if graphics.computes else None
    )

    def in_opengl(_first: int, _last: int, frames: np.ndarray) -> None:
        _add(seconds, "draw, glFinish", graphics.context.finish)
        _add(seconds, "GLSL sum, nothing leaves", lambda: glsl.integrate(frames))

    copy, opencl = HostCopy(compute, target.texture), HemicubeIntegrator(compute, tiles, sky)
    others = {"draw, glFinish": 0.0, "copy through the host, clFinish": 0.0, "OpenCL sum, one wait": 0.0}

    def in_opencl(_first: int, _last: int, frames: np.ndarray) -> None:
        _add(others, "draw, glFinish", graphics.context.finish)
        _add(others, "copy through the host, clFinish", lambda: (copy.update(), compute.queue.finish()))
        _add(others, "OpenCL sum, one wait", lambda: opencl.integrate(copy.buffer, frames))

    for name, parts_of, take in (("OpenGL", seconds, in_opengl), ("OpenCL", others, in_opencl)):
        if name == "OpenGL" and glsl is None:
            continue
        whole = _timed_iteration(hemicubes, parts_of, take)
        parts_of["draw, glFinish"] = whole - sum(list(parts_of.values())[1:])
        rows += [(f"{name}: {part}", 1000 * s, f"{s / whole:.1%}") for part, s in parts_of.items()]
    return rows


def _timed_iteration(hemicubes: Hemicubes, parts: dict[str, float], take: Callable) -> float:
    """Return the seconds of the second of two iterations, whose parts are added up."""
    for _ in range(2):
        parts.update(dict.fromkeys(parts, 0.0))
        start = time.perf_counter()
        for _ in hemicubes.draw(0, hemicubes.count, take):
            pass
    return time.perf_counter() - start


def _add(seconds: dict[str, float], name: str, work: Callable[[], object]) -> None:
    start = time.perf_counter()
    work()
    seconds[name] += time.perf_counter() - start


if __name__ == "__main__":
    main()
