"""Receiver records of patches for kernels: position, normals, texel steps and ray offset."""

from __future__ import annotations

import math

import numpy as np

from ...array_ops import take_rows
from ...device.buffers import upload, upload_once, write
from ...device.cl_device import ComputeDevice
from ...device.device_rows import device_rows
from ...device.device_struct import DeviceStruct
from ...device.kernel import Kernel
from ...device.opencl import cl
from ...patches.geometry import PatchGeometry, TexelSteps, scaled
from ...patches.patch_list import PatchList
from ..views.viewpoints import OF_COORDINATE, OF_DIAGONAL, OF_TEXEL

#: Patch as a receiver of light, on its triangle. Metres from `Triangles.origin`.
RECEIVER = DeviceStruct(
    "ReceiverRecord",
    ("float[3]", "at", "m, centre of the texel"),
    ("float", "height", "m, of the start of rays above the surface"),
    ("float[3]", "normal", "unit, of the smooth surface"),
    ("float", "lifted", "factor of `smooth_offset` in receiver.cl, 0 to 1: 0 on flat surfaces"),
    ("float[3]", "geometric", "unit, of the flat triangle"),
    ("float[3]", "edge_u", "m, step of a texel along u"),
    ("float[3]", "edge_v", "m, step of a texel along v"),
    ("float[3]", "corner", "m, first corner of the triangle"),
    ("float[3]", "edge1", "m, from there to the second corner"),
    ("float[3]", "edge2", "m, from there to the third corner"),
    ("float[3]", "normal1", "of the smooth surface at the first corner"),
    ("float[3]", "normal2", "at the second corner"),
    ("float[3]", "normal3", "at the third corner"),
    (
        "int",
        "rank",
        "along a Hilbert curve through texels (pack_receivers.cl), times 2; + 1 if a face crosses its own",
    ),
)

#: Number of triangles whose records are converted at once (chosen).
_CONVERTED = 1 << 16

#: Largest part of all triangles for which arrays of the triangles with patches alone are uploaded, and the
#: least number of triangles (chosen): arrays of all triangles are uploaded once for all receivers.
_FEW, _MANY = 0.25, 1 << 16

#: Texel steps, normal and area that all patches of a triangle share.
TEXEL_STEP = DeviceStruct(
    "TexelStep",
    ("float[3]", "edge_u", "m, step of a texel along u"),
    ("float[3]", "edge_v", "m, step of a texel along v"),
    ("float[3]", "geometric", "unit normal"),
    ("float", "area", "m^2, of a texel"),
)


def pack_receivers(
    compute: ComputeDevice, pack: Kernel, patches: PatchList, geometry: PatchGeometry
) -> cl.Buffer:
    """Return the records of patches on the device; sample points of one texel are consecutive.

    pack: the kernel of pack_receivers.cl
    """
    triangles, count = geometry.triangles, len(geometry.triangle_rows)
    triangle, *of_triangles = _used_triangles(compute, geometry)
    inputs = triangle, device_rows(compute, geometry.barycentric_rows), *of_triangles
    heights = (OF_TEXEL, OF_DIAGONAL * triangles.diagonal, OF_COORDINATE)
    records = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, RECEIVER.dtype.itemsize * count)
    origin = cl.cltypes.make_float4(*triangles.origin, 0)
    texels = (
        device_rows(compute, patches.index.texel_rows),
        np.int32(patches.resolution),
        np.int32(points_of_texels(patches)),
    )
    compute.run(pack, count, *inputs, *map(np.float32, heights), origin, *texels, records, np.int32(count))
    return records


def uploaded_triangles(triangles: int, used: int) -> int:
    """Return the number of triangles whose positions, normals and texel steps are uploaded.

    used: number of triangles with patches
    """
    return used if triangles >= _MANY and used <= _FEW * triangles else triangles


def _used_triangles(compute: ComputeDevice, geometry: PatchGeometry) -> tuple[cl.Buffer, ...]:
    """Return the triangle index of each patch, and positions, normals and texel steps of triangles.

    If few triangles have patches, the arrays contain these triangles alone, and are not kept.
    """
    triangles, steps = geometry.triangles, geometry.steps
    if len(triangles.mesh) >= _MANY:
        chosen = np.flatnonzero(geometry.on_triangle)
        count = len(triangles.mesh)
        if uploaded_triangles(count, len(chosen)) < count:
            number = np.empty(count, np.int32)
            number[chosen] = np.arange(len(chosen), dtype=np.int32)
            normals = triangles.normals.take(chosen, axis=0)
            arrays = number[geometry.triangle], triangles.positions[chosen], normals
            records = _upload_steps(compute, steps, geometry.width, chosen)
            return *(upload(compute, array) for array in arrays), records
    return (
        device_rows(compute, geometry.triangle_rows),
        upload_once(compute, triangles.positions),
        upload_once(compute, triangles.all_normals),
        compute.shared.of(
            steps.area, f"steps {geometry.width}", lambda: _upload_steps(compute, steps, geometry.width)
        ),
    )


def _upload_steps(
    compute: ComputeDevice, steps: TexelSteps, width: float, chosen: np.ndarray | None = None
) -> cl.Buffer:
    """Upload the records of triangles, (t,) TEXEL_STEP; converts some at a time to save host memory.

    width:   of a patch, texels
    chosen:  (k,) int64, triangles; None for all
    """
    count, size = len(steps.area) if chosen is None else len(chosen), TEXEL_STEP.dtype.itemsize
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size * max(count, 1))
    for first in range(0, count, _CONVERTED):
        block = slice(first, min(first + _CONVERTED, count))
        some = block if chosen is None else chosen[block]
        edge_u, edge_v = steps.of(some)
        records = TEXEL_STEP.array(
            block.stop - first,
            edge_u=scaled(edge_u, width),
            edge_v=scaled(edge_v, width),
            geometric=take_rows(steps.geometric, some),
            area=scaled(take_rows(steps.area, some), width**2),
        )
        write(compute, buffer, records, size * first)
    return buffer


def points_of_texels(patches: PatchList) -> int:
    """Return the maximum number of points in a texel: 1 for patches, more for texel samples."""
    # A run of equal texels ends where the lightmap changes too: the last texel of one lightmap and the first
    # of the next may have the same index.
    starts = (patches.texel[1:] != patches.texel[:-1]) | (patches.atlas[1:] != patches.atlas[:-1])
    runs = 1 + np.count_nonzero(starts)
    return math.ceil(len(patches) / runs)
