"""Patches as kernels want them: where they receive light, and where their rays start."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ...device.buffers import upload
from ...device.compute import Compute
from ...patches.geometry import PatchGeometry
from ..views.viewpoints import OF_COORDINATE, OF_DIAGONAL, OF_TEXEL

#: float4 a record, see kernels/receiver.cl.
RECORD = 9


def pack_receivers(compute: Compute, geometry: PatchGeometry, origin: np.ndarray) -> cl.Buffer:
    """Return the records of patches on the device; positions relative to origin, (3,) float64, metres."""
    triangles, steps, count = geometry.triangles, geometry.steps, len(geometry.triangle)
    corners = (triangles.positions - origin).astype(np.float32)
    step = np.concatenate([steps.edge_u, steps.edge_v, steps.geometric, steps.area[:, None]], axis=1)
    arrays = (geometry.triangle, geometry.barycentric, corners, triangles.normals, step)
    inputs = [upload(compute, array) for array in arrays]
    heights = cl.cltypes.make_float4(OF_TEXEL, OF_DIAGONAL * triangles.diagonal, OF_COORDINATE, 0)
    records = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * RECORD * count)
    (pack,) = compute.kernels(("receiver.cl", "pack.cl"), "pack")
    place = cl.cltypes.make_float4(*origin, 0)
    compute.run(pack, count, *inputs, heights, place, records, np.int32(count))
    return records
