"""Measures the build of the ray hierarchy and rays per second on the OpenCL device.

    PYTHONPATH=. python benchmarks/rays.py [--triangles 24 10000 100000 1000000] [--rays 1000000]

Each scene is a closed room with another box inside; from 1,000 triangles on their walls are uneven grids.
Incoherent rays start anywhere in the room and go anywhere; coherent ones are 256 from each of random points
of the surfaces, the same into the hemisphere of each.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import pyopencl as cl

from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.scene.cutouts import read_cutouts
from engine.scene.model import Material, Scene
from engine.scene.triangles import Triangles
from engine.visibility.rays.ray_tracer import SOURCE, RayTracer

_REPEATS = 5
_PER_POINT = 256


def main() -> None:
    """Print a line for each number of triangles."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--triangles", type=int, nargs="+", default=[24, 10_000, 100_000, 1_000_000])
    parser.add_argument("--rays", type=int, default=1_000_000)
    options = parser.parse_args()
    compute = ComputeDevice()
    print(f"{compute.name}, {compute.device.platform.version.strip()}")
    print("triangles  build s  coherent  incoherent  million nearest hits a second")
    _rays(compute, room(24))
    for count in options.triangles:
        positions = room(count)
        seconds, rays = min((_rays(compute, positions) for _ in range(3)), key=lambda made: made[0])
        batches = (coherent(positions, options.rays), incoherent(positions, options.rays))
        near, far = (_speed(compute, rays, *batch) for batch in batches)
        print(f"{len(positions):9}  {seconds:7.3f}  {near:8.2f}  {far:10.2f}", flush=True)


def room(count: int) -> np.ndarray:
    """Return the triangles of a room of 4 m with a box of 1 m, (t, 3, 3) float32; about `count` of them."""
    cells = max(round((count / 24) ** 0.5), 1)
    random = np.random.default_rng(1)
    outer, inner = _box(cells, random)[:, ::-1] * 4, _box(cells, random) + np.array([1.3, 1.2, 0.01])
    return np.concatenate([outer, inner]).astype(np.float32)


def _box(cells: int, random: np.random.Generator) -> np.ndarray:
    """Return the six sides of the unit cube, (t, 3, 3): grids, uneven within their borders, facing out."""
    u, v = np.meshgrid(*2 * [np.linspace(0, 1, cells + 1)], indexing="ij")
    sides = []
    for axis in range(3):
        for end in (0, 1):
            depth = np.zeros_like(u)
            depth[1:-1, 1:-1] = random.random((max(cells - 1, 0),) * 2) * 0.02
            points = np.empty((*u.shape, 3))
            points[..., axis] = end + depth * (1 - 2 * end)
            points[..., (axis + 1) % 3], points[..., (axis + 2) % 3] = u, v
            a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
            side = np.stack([np.stack([a, b, c], -2), np.stack([a, c, d], -2)], 2).reshape(-1, 3, 3)
            sides.append(side if end else side[:, ::-1])
    return np.concatenate(sides)


def coherent(positions: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions, (n, 3), of rays from points of the surfaces."""
    random = np.random.default_rng(2)
    a, b, c = positions[random.integers(0, len(positions), count // _PER_POINT)].astype(float).swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    origins = np.repeat((a + b + c) / 3 + 1e-4 * normal, _PER_POINT, axis=0)
    index = np.arange(_PER_POINT) + 0.5
    z, angle = 1 - 2 * index / _PER_POINT, np.pi * (1 + np.sqrt(5)) * index
    around = np.sqrt(1 - z * z)
    sphere = np.stack([around * np.cos(angle), around * np.sin(angle), z], axis=1)
    directions = np.tile(sphere, (len(normal), 1)) + 1.001 * np.repeat(normal, _PER_POINT, axis=0)
    return origins, directions


def incoherent(positions: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return origins and directions, (n, 3), anywhere within the scene's bounds."""
    random = np.random.default_rng(3)
    low, high = positions.min(axis=(0, 1)), positions.max(axis=(0, 1))
    return low + (high - low) * random.uniform(0.05, 0.95, (count, 3)), random.normal(size=(count, 3))


def _rays(compute: ComputeDevice, positions: np.ndarray) -> tuple[float, RayTracer]:
    """Build a ray tracer; return the seconds, with the upload, and the tracer."""
    count = len(positions)
    zeros = np.zeros(count, np.int32)
    triangles = Triangles(positions, positions, positions[..., :2], zeros, zeros, zeros)
    solid = read_cutouts(Scene((), (Material("Solid", np.ones(3), np.zeros(3)),)))
    began = time.perf_counter()
    rays = RayTracer(compute, triangles, solid)
    compute.queue.finish()
    return time.perf_counter() - began, rays


def _speed(compute: ComputeDevice, rays: RayTracer, origins: np.ndarray, directions: np.ndarray) -> float:
    """Return million rays a second of the kernel alone, the best of some runs."""
    count, seconds = len(origins), []
    kernel = rays.kernels(SOURCE, "closest_hit")[0]
    padded = np.zeros((2, count, 4), np.float32)
    padded[0, :, :3], padded[1, :, :3] = origins, directions
    inputs = [upload(compute, array) for array in padded]
    outputs = [cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, size * count) for size in (8, 4)]
    for _ in range(_REPEATS):
        began = time.perf_counter()
        rays.run(kernel, count, *inputs, np.int32(0), *outputs, np.int32(count))
        compute.queue.finish()
        seconds.append(time.perf_counter() - began)
    return count / min(seconds) / 1e6


if __name__ == "__main__":
    main()
