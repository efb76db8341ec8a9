"""The arithmetic of emitters on the device."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device.source import kernel_source
from engine.direct.emitters import EMITTER_SOURCE, BrightTriangles, lamp_records, surface_records
from engine.scene.model import Light
from engine.scene.triangles import Triangles

#: Clips to a plane through the origin; what lies beyond the fifth corner has to stay as it is.
CLIPPING = """
__kernel void clipped(__global const float4 *quads, __global const float4 *normals, __global int *counts,
                      __global float4 *results)
{
    const int i = get_global_id(0);
    float3 corners[4], result[8];
    for (int j = 0; j < 4; ++j)
        corners[j] = quads[4 * i + j].xyz;
    for (int j = 0; j < 8; ++j)
        result[j] = (float3)(NAN);
    counts[i] = clip(corners, 4, normals[i].xyz, result);
    for (int j = 0; j < 8; ++j)
        results[8 * i + j] = (float4)(result[j], 0.0f);
}
"""


def clipped(compute, quads, normals):
    """Return how many corners are left of each quad, (n,), and which, (n, 8, 3), NaN for the others."""
    source = "\n".join([*map(kernel_source, EMITTER_SOURCE), CLIPPING])
    kernel = cl.Kernel(cl.Program(compute.context, source).build(), "clipped")
    padded = [np.zeros((*array.shape[:-1], 4), np.float32) for array in (quads, normals)]
    for target, array in zip(padded, (quads, normals), strict=True):
        target[..., :3] = array
    counts, results = np.zeros(len(quads), np.int32), np.zeros((len(quads), 8, 4), np.float32)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    inputs = [cl.Buffer(compute.context, read, hostbuf=array) for array in padded]
    outputs = [
        cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, array.nbytes) for array in (counts, results)
    ]
    kernel(compute.queue, (len(quads),), None, *inputs, *outputs)
    cl.enqueue_copy(compute.queue, counts, outputs[0])
    cl.enqueue_copy(compute.queue, results, outputs[1])
    return counts, results[..., :3]


#: Triangles of a scene: as float32, the numbers of the last ones would be even.
MANY = 2**24 + 8


def test_the_numbers_of_emissive_triangles_are_exact_however_many_there_are(compute):
    triangles = Triangles(
        np.broadcast_to(np.float32([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), (MANY, 3, 3)),
        *[np.broadcast_to(np.zeros(1, np.float32), (MANY, 3, width)) for width in (3, 2)],
        *[np.broadcast_to(np.zeros(1, np.int32), MANY)] * 3,
    )
    numbers = np.array([0, 1, 2**23 - 1, 2**24 + 1, 2**24 + 3, MANY - 1])
    bright = BrightTriangles(
        numbers, np.ones((6, 3), np.float32), np.ones(6, bool), np.zeros((0, 3), np.float32)
    )
    lamp = Light("Lamp", "area", np.zeros(3), np.eye(3), np.ones(3, np.float32), size=np.ones(2))
    surfaces = surface_records(triangles, bright, np.zeros(1, bool))
    records = np.concatenate([lamp_records(lamp), surfaces])
    source = """
    __kernel void numbers(__global const Emitter *records, __global int *result)
    {
        const int i = get_global_id(0);
        result[i] = records[i].triangle;
    }"""
    kernel = cl.Kernel(
        cl.Program(compute.context, "\n".join([*map(kernel_source, EMITTER_SOURCE), source])).build(),
        "numbers",
    )
    result = np.zeros(len(records), np.int32)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, result.nbytes)
    kernel(compute.queue, (len(records),), None, cl.Buffer(compute.context, read, hostbuf=records), output)
    cl.enqueue_copy(compute.queue, result, output)
    assert result.tolist() == [-1, -1, *numbers]


def area(corners):
    """Return the area of a flat polygon, (k, 3)."""
    fan = np.cross(corners[1:-1] - corners[0], corners[2:] - corners[0])
    return np.linalg.norm(fan.sum(axis=0)) / 2


def test_quads_are_clipped_to_the_half_space_above_a_plane(compute):
    square = np.float32([(0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)])
    normals = np.float32([(0, 0, 1), (0, 0, -1), (-1, 0, 1), (1, 1, -1), (-1, -1, 1), (-1, 0, 0.5)])
    counts, results = clipped(compute, np.tile(square, (len(normals), 1, 1)), normals)
    assert counts.tolist() == [4, 0, 4, 5, 3, 4]
    areas = [area(result[:count]) for count, result in zip(counts, results, strict=True) if count]
    assert areas == pytest.approx([4, 2, 3.5, 0.5, 1], rel=1e-6)


@pytest.mark.parametrize("scale", [1.0, 1e-7])
def test_a_quad_in_the_plane_it_is_clipped_to_has_at_most_five_corners_left(compute, scale):
    """Its heights are but rounding, of any sign: they may change four times, as no convex quad's do.

    So does the quad that is left of a triangle of an ellipse 8 m wide whose plane runs through the receiver.
    """
    signs = np.array([(1, -1, 1, -1), (-1, 1, -1, 1), (1, 1, -1, 1), (-1, -1, 1, 1), (1, 1, 1, 1)])
    quads = np.tile(np.float64([(0, 0, 0), (8, 0, 0), (8, 8, 0), (0, 8, 0)]), (len(signs), 1, 1))
    quads[:, :, 2] = scale * signs
    counts, results = clipped(compute, quads, np.tile(np.float32([0, 0, 1]), (len(signs), 1)))
    assert counts.max() <= 5 and counts[2:].tolist() == [5, 4, 4]
    kept = np.isfinite(results).all(axis=2)
    assert (kept.sum(axis=1) == counts).all()
    assert all(kept[i, : counts[i]].all() for i in range(len(counts)))
