"""The arithmetic of emitters on the device."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device.source import program_source
from engine.direct.emitters import EMITTER_RECORDS, SampledTriangles, lamp_records, surface_records
from engine.scene.model import Light
from engine.scene.triangles import Triangles

#: The program to which each test adds a kernel.
_SOURCE = program_source((*EMITTER_RECORDS, "emitters.cl"))

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
    """Return the number of corners of each clipped quad, (n,), and the corners, (n, 8, 3), NaN beyond."""
    source = _SOURCE + CLIPPING
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
    bright = SampledTriangles(
        numbers,
        *2 * [np.ones((6, 3), np.float32)],
        np.ones(6, bool),
        *2 * [np.zeros((0, 3), np.float32)],
        np.zeros(MANY, bool),
    )
    lamp = Light("Lamp", "area", np.zeros(3), np.eye(3), np.ones(3, np.float32), size=np.ones(2))
    surfaces = surface_records(triangles, bright)
    records = np.concatenate([lamp_records(lamp), surfaces])
    source = """
    __kernel void numbers(__global const Emitter *records, __global int *result)
    {
        const int i = get_global_id(0);
        result[i] = records[i].triangle;
    }"""
    kernel = cl.Kernel(
        cl.Program(compute.context, _SOURCE + source).build(),
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


#: Directions into spherical triangles of three unit vectors, for each of `count` points of the unit square.
DIRECTIONS = """
__kernel void directions(__global const float4 *corners, __global const float2 *points, const int count,
                         __global float4 *results)
{
    const int i = get_global_id(0), j = get_global_id(1);
    float angle;
    const float3 direction = in_spherical_triangle(
        corners[3 * i].xyz, corners[3 * i + 1].xyz, corners[3 * i + 2].xyz, points[j], &angle);
    results[count * i + j] = (float4)(direction, angle);
}
"""


def sampled_directions(compute, corners, points):
    """Return directions into spherical triangles, (t, m, 3), and their solid angles, (t,).

    corners: (t, 3, 3) unit vectors; points: (m, 2) of the unit square
    """
    source = _SOURCE + DIRECTIONS
    kernel = cl.Kernel(cl.Program(compute.context, source).build(), "directions")
    padded = np.zeros((len(corners), 3, 4), np.float32)
    padded[..., :3] = corners
    results = np.zeros((len(corners), len(points), 4), np.float32)
    read = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    inputs = [cl.Buffer(compute.context, read, hostbuf=array) for array in (padded, np.float32(points))]
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, results.nbytes)
    kernel(compute.queue, results.shape[:2], None, *inputs, np.int32(len(points)), output)
    cl.enqueue_copy(compute.queue, results, output)
    return results[..., :3].astype(float), results[:, 0, 3].astype(float)


def exact_triangles(corners):
    """Return solid angles (L'Huilier 1812) and mean directions (Lambert 1760) of spherical triangles."""
    following = np.roll(corners, -1, axis=1)
    normals = np.cross(corners, following)
    sides = np.arctan2(np.linalg.norm(normals, axis=2), (corners * following).sum(axis=2))
    half = sides.sum(axis=1) / 2
    product = np.tan(half / 2) * np.tan((half[:, None] - sides) / 2).prod(axis=1)
    angles = 4 * np.arctan(np.sqrt(product))
    vectors = (sides / np.linalg.norm(normals, axis=2))[..., None] * normals / 2
    return angles, vectors.sum(axis=1) / angles[:, None]


@pytest.mark.parametrize("mirrored", [False, True])
def test_directions_fill_spherical_triangles_evenly_however_small_thin_or_wide(compute, mirrored):
    around = np.radians([(0, 118, 243), (7, 41, 59), (10, 130, 250), (0, 1.5, 90), (200, 203, 206)])
    height = np.array([1e-2, 1.0, 30.0, 0.4, 3.0])
    corners = np.stack(
        [np.cos(around), np.sin(around), np.repeat(height[:, None], 3, axis=1) * (1, 1.07, 0.93)], axis=2
    )
    corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    corners = corners @ np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))[0]
    corners = corners[:, ::-1] if mirrored else corners
    steps = np.arange(2999)[:, None] * (0.754877666, 0.569840291) % 1
    directions, angles = sampled_directions(compute, corners, steps)
    exact, means = exact_triangles(corners)
    assert angles == pytest.approx(exact, rel=2e-5)
    assert np.linalg.norm(directions, axis=2) == pytest.approx(1, abs=1e-5)

    # All are within; evenly spread ones have the mean of the triangle.
    normals = np.cross(corners, np.roll(corners, -1, axis=1))
    turning = np.sign((normals[:, 0] * corners[:, 2]).sum(axis=1))[:, None, None]
    inside = turning * np.einsum("tmk,tsk->tms", directions, normals)
    assert inside.min() > -1e-5
    extents = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    off = np.linalg.norm(directions.mean(axis=1) - turning[:, 0] * means, axis=1)
    assert (off < 2e-3 * extents).all()
