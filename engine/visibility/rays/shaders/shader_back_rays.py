"""Test rays of back faces, traced by compute shaders for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Generator

import moderngl
import numpy as np

from ..back_rays import BackRays
from ..receiver_records import RECEIVER
from .shader_tables import reserve_storage, storage_buffer
from .shader_tracer import RESULTS, ShaderTracer

#: Storage blocks of shaders/visibility/visible_backs.comp.
_CORNERS, _ENDS = 4, 5


def backs_met_by_shader(
    tracer: ShaderTracer, corners: moderngl.Buffer, rays: BackRays
) -> Generator[None, None, np.ndarray]:
    """Return a mask of triangles whose unknown back face some ray hits, (t,) bool; yield after each dispatch.

    corners: (t, 3, 3) float32, m, of all triangles
    """
    size = 4 * len(rays.ends)
    marks = reserve_storage(tracer.graphics, size, rays.marks.astype(np.uint32).tobytes())
    buffers = {
        _CORNERS: corners,
        _ENDS: storage_buffer(tracer.graphics, rays.ends),
        RESULTS: marks,
    }
    launch = {"triangle_count": len(rays.ends), "side": rays.side, "height": rays.height}
    for _ in tracer.run("visible_backs", rays.count, buffers, launch, records=(RECEIVER,)):
        yield
    return np.frombuffer(marks.read(size), np.uint32) == 1
