"""Rays through the triangles of a scene, traced by OpenGL compute shaders."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Generator, Mapping, Sequence

import moderngl
import numpy as np

from ....device.device_struct import DeviceStruct
from ....device.gl_context import GraphicsContext
from ....device.source import shader_source
from ....scene.cutouts import BOUNCE, Cutouts
from ....scene.tints import tint_palette
from ....scene.triangles import Triangles
from ..ray_tracer import transmittance_records
from .host_bvh import HostBvh, build_host_bvh
from .shader_tables import ShaderTables, reserve_storage, storage_buffer

#: Storage blocks of shaders/rays/bvh_traversal.glsl, of the shader's own records, and of results.
NODES, TRIANGLES, TRANSMISSION, RECORDS, RESULTS, STATES = 0, 1, 2, 3, 7, 8

#: Invocations of a work group, as in the shaders, and most groups of a dispatch that OpenGL guarantees.
_GROUP, _MAX_GROUPS = 64, 65535

#: Invocations of the first dispatch, and seconds that a dispatch takes at least and at most: displays may
#: hang on the device.
_FIRST, _SHORT, _LONG = 4 * _GROUP, 0.02, 0.05

#: Stacks of shaders are a multiple of this: scenes share programs, which take seconds to build.
_STACK = 32

#: Maximum size of the ray states of a dispatch, 32-bit words; chosen.
_MAX_STATES = 1 << 22

#: Uniform values by name.
Uniforms = Mapping[str, int | float]

#: Buffers by the numbers of their storage blocks.
Buffers = Mapping[int, moderngl.Buffer]


class ShaderTracer:
    """A scene's triangles on the OpenGL device, for shaders that include shaders/rays/bvh_traversal.glsl.

    graphics   the context; it has compute shaders
    cutouts    transmittance of the surfaces
    bvh        BVH of the triangles that are no back faces
    """

    def __init__(
        self, graphics: GraphicsContext, triangles: Triangles, cutouts: Cutouts, bvh: HostBvh | None = None
    ) -> None:
        """Build the BVH, or use an existing one of the same triangles."""
        self.graphics, self.cutouts = graphics, cutouts
        self.bvh = bvh = bvh or build_host_bvh(triangles.positions[: triangles.solid])
        self._features: tuple[str, ...] = (f"stack {_STACK * max(1, -(-bvh.depth // _STACK))}",)
        self._buffers = {
            NODES: storage_buffer(graphics, bvh.nodes),
            TRIANGLES: storage_buffer(graphics, bvh.triangles),
        }
        self._uniforms: dict[str, int] = {}
        if cutouts.needed:
            named = {"transmission": True, "tinted": cutouts.tinted, "angular": cutouts.angular}
            self._features += tuple(name for name, used in named.items() if used)
            tables = ShaderTables(graphics, _transmission_arrays(triangles, cutouts))
            self._buffers[TRANSMISSION], self._uniforms = tables.buffer, tables.uniforms
        self._programs: dict[tuple[str, tuple[str, ...]], moderngl.ComputeShader] = {}
        self._sizes: dict[tuple[str, tuple[str, ...]], int] = {}

    def run(
        self,
        name: str,
        items: int,
        buffers: Buffers,
        uniforms: Uniforms,
        features: Sequence[str] = (),
        records: Sequence[DeviceStruct] = (),
        state_words: int = 0,
    ) -> Generator[float, None, None]:
        """Run <name>.comp over items, some at a time; yield progress 0..1.

        The shader has uniforms `start` and `end`, its items. A dispatch takes about 20 to 50 ms.

        state_words: words of an item's state if its work may pause, see shaders/rays/resumed.glsl
        """
        key = (name, tuple(features))
        program = self._program(name, features, records)
        _set(program, self._uniforms)
        _set(program, uniforms)
        start = 0
        while start < items:
            self.graphics.use()
            for binding, buffer in (self._buffers | dict(buffers)).items():
                buffer.bind_to_storage_buffer(binding)
            size = self._sizes.setdefault(key, _FIRST)
            if state_words:
                size = min(size, _MAX_STATES // state_words)
            end = min(start + size, items)
            _set(program, {"start": start, "end": end})
            taken = self._dispatch(program, end - start, state_words)
            if taken < _SHORT and end - start == size:
                self._sizes[key] = min(2 * size, _GROUP * _MAX_GROUPS)
            elif taken > _LONG and size > _GROUP:
                self._sizes[key] = max(size // 2, _GROUP)
            start = end
            yield end / items
        self.graphics.check("casting rays")

    def digest(self, name: str, features: Sequence[str], records: Sequence[DeviceStruct]) -> str:
        """Return a digest of the source of a shader; parameters as for `run`."""
        source = shader_source(f"{name}.comp", (*self._features, *features), records)
        return hashlib.sha256(source.encode()).hexdigest()[:16]

    def build(self, name: str, features: Sequence[str], records: Sequence[DeviceStruct]) -> None:
        """Build a shader by a dispatch without items, since drivers build at the first dispatch."""
        program = self._program(name, features, records)
        self.graphics.use()
        _set(program, {"start": 0, "end": 0})
        program.run(1)
        self.graphics.context.finish()

    def _program(
        self, name: str, features: Sequence[str], records: Sequence[DeviceStruct]
    ) -> moderngl.ComputeShader:
        """Return the program of a shader with the features of this scene, linked on the first call."""
        key = (name, tuple(features))
        if key not in self._programs:
            named = (*self._features, *features)
            self._programs[key] = self.graphics.compute_program(name, named, records)
        return self._programs[key]

    def _dispatch(self, program: moderngl.ComputeShader, items: int, state_words: int) -> float:
        """Run a shader over items until all are done; return the seconds of the longest dispatch."""
        states = None
        if state_words:
            zeros = np.zeros(1 + state_words * items, np.uint32)
            states = storage_buffer(self.graphics, zeros)
            states.bind_to_storage_buffer(STATES)
        longest = 0.0
        while True:
            began = time.perf_counter()
            program.run(-(-items // _GROUP))
            self.graphics.context.memory_barrier()
            self.graphics.context.finish()
            longest = max(longest, time.perf_counter() - began)
            if states is None:
                return longest
            if not any(states.read(4)):
                states.release()
                return longest
            states.write(bytes(4))

    def cast(
        self, origins: np.ndarray, directions: np.ndarray, backs: bool = False, kind: int = BOUNCE
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the closest hit of each ray; see `RayTracer.cast`."""
        found = self._cast("closest_hit", origins, directions, 0.0, {"backs": int(backs), "kind": kind})
        triangle = np.ascontiguousarray(found[:, 0]).view(np.int32)
        return triangle, found[:, 1] != 0, found[:, 2].copy()

    def transmittance(
        self, origins: np.ndarray, directions: np.ndarray, distance: float, kind: int = BOUNCE
    ) -> np.ndarray:
        """Return the transmittance along each ray, (m, 3) float32; see `RayTracer.transmittance`."""
        return self._cast("through_surface", origins, directions, distance, {"kind": kind})[:, :3].copy()

    def _cast(
        self, name: str, origins: np.ndarray, directions: np.ndarray, distance: float, uniforms: Uniforms
    ) -> np.ndarray:
        """Run a ray shader; return its results, (m, 4) float32."""
        count = len(origins)
        rays = np.zeros((count, 2, 4), np.float32)
        rays[:, 0, :3], rays[:, 1, :3], rays[:, 1, 3] = origins, directions, distance
        results = reserve_storage(self.graphics, 16 * count)
        buffers = {RECORDS: storage_buffer(self.graphics, rays), RESULTS: results}
        for _ in self.run(name, count, buffers, uniforms):
            pass
        return read_rows(results, count)


def read_rows(buffer: moderngl.Buffer, count: int, first: int = 0) -> np.ndarray:
    """Return rows of four numbers from row `first` on, (count, 4) float32."""
    if not count:
        return np.zeros((0, 4), np.float32)
    return np.frombuffer(buffer.read(16 * count, offset=16 * first), np.float32).reshape(-1, 4)


def _transmission_arrays(triangles: Triangles, cutouts: Cutouts) -> dict[str, np.ndarray]:
    """Return the tables of shaders/rays/bvh_traversal.glsl; records of surfaces come first."""
    pixels = np.zeros(-(-len(cutouts.pixels) // 2) * 2, np.uint16)
    pixels[: len(cutouts.pixels)] = cutouts.pixels
    tints = tint_palette(cutouts)
    return {
        "surfaces": transmittance_records(cutouts),
        "pixels": pixels,
        "map_uvs": cutouts.uvs.astype(np.float32, copy=False),
        "materials": triangles.material.astype(np.int32, copy=False),
        "tints": np.ones((1, 4), np.float32) if tints is None else tints,
    }


def _set(program: moderngl.ComputeShader, uniforms: Uniforms) -> None:
    """Set the uniforms that the compiler has not optimised away."""
    for name, value in uniforms.items():
        if name in program:
            program[name] = value
