"""Test rays of back faces, traced by compute shaders for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Generator

import moderngl
import numpy as np

from ..back_rays import BackRays, marks_of
from ..receiver_records import RECEIVER
from .shader_tables import reserve_storage, storage_buffer
from .shader_tracer import RESULTS, ShaderTracer

#: Storage blocks of shaders/visibility/visible_backs.comp.
_CORNERS, _ENDS, _ENCLOSED = 4, 5, 6


class ShaderBackRays:
    """Test rays traced by a compute shader; see `back_rays.CastRays`."""

    def __init__(self, tracer: ShaderTracer, corners: moderngl.Buffer, rays: BackRays) -> None:
        """Upload the rays; corners: (t, 3, 3) float32, m, of all triangles."""
        self._tracer, self._again = tracer, False
        self._buffers = {
            _CORNERS: corners,
            _ENDS: storage_buffer(tracer.graphics, rays.ends),
            _ENCLOSED: storage_buffer(tracer.graphics, np.zeros(rays.words, np.uint32)),
        }
        self._rays = rays

    def hit_backs(self, known: np.ndarray) -> Generator[None, None, np.ndarray]:
        """Return the result of `CastRays.hit_backs`."""
        size, rays = 4 * len(known), self._rays
        marks = reserve_storage(self._tracer.graphics, size, marks_of(known).astype(np.uint32).tobytes())
        uniforms = {
            "triangle_count": len(known), "side": rays.side, "height": rays.height, "again": int(self._again),
        }  # fmt: skip
        buffers = self._buffers | {RESULTS: marks}
        for _ in self._tracer.run("visible_backs", rays.count, buffers, uniforms, records=(RECEIVER,)):
            yield
        self._again = True
        return np.frombuffer(marks.read(size), np.uint32) == 1
