"""Functions of kernels/device/pocl_inline.cl agree with NumPy, exactly or within rounding."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.device.source import program_source

#: Of two numbers a, b, and a vector v of a, b and their difference.
EXACT = {
    "min(a, b)": np.minimum,
    "max(a, b)": np.maximum,
    "clamp(a, -1.0f, 1.5f)": lambda a, b: np.clip(a, -1, 1.5),
    "fmin(a, b)": np.fmin,
    "fmax(a, b)": np.fmax,
    "fabs(a)": lambda a, b: np.abs(a),
    "rint(a)": lambda a, b: np.rint(a),
    "floor(a)": lambda a, b: np.floor(a),
    "sqrt(fabs(a))": lambda a, b: np.sqrt(np.abs(a)),
    "max(v, 0.5f).z": lambda a, b: np.maximum(a - b, np.float32(0.5)),
    "fmin(v, v.zxy).x": lambda a, b: np.fmin(a, a - b),
    "fabs(v).z": lambda a, b: np.abs(a - b),
    "fabs((float8)(v, a, b, v)).s4": lambda a, b: np.abs(b),
    "(float)any(v < 0.0f)": lambda a, b: (a < 0) | (b < 0) | (a - b < 0),
}
ROUNDED = {
    "atan2(a, b)": np.arctan2,
    "atan2(v, v.yzx).x": np.arctan2,
    "atan2(v, v.yzx).z": lambda a, b: np.arctan2(a - b, a),
    "sinpi(a)": lambda a, b: np.sin(np.pi * a),
    "cospi(a)": lambda a, b: np.cos(np.pi * a),
    "mix(a, b, 0.25f)": lambda a, b: 0.75 * a + 0.25 * b,
    "length((float2)(a, b))": np.hypot,
    "normalize((float2)(a, b)).x": lambda a, b: a / np.hypot(a, b),
    "rsqrt(fabs(b))": lambda a, b: 1 / np.sqrt(np.abs(b)),
    "dot(v, v.yzx)": lambda a, b: a * b + b * (a - b) + (a - b) * a,
    "cross(v, v.yzx).x": lambda a, b: b * a - (a - b) ** 2,
}


@pytest.fixture(scope="module")
def compute():
    device = ComputeDevice()
    if not (device.processor and device.device.platform.name == "Portable Computing Language"):
        pytest.skip("kernels/device/pocl_inline.cl is for PoCL on a processor")
    return device


def evaluated(compute, formulas, a, b):
    """Return the values of formulas in OpenCL C, (formulas, n) float32."""
    stores = "".join(f"to[{number} * count + i] = {formula};\n" for number, formula in enumerate(formulas))
    kernel = f"""__kernel void evaluate(__global const float *from, __global float *to, const int count)
        {{ const int i = get_global_id(0); if (i >= count) return;
        const float a = from[i], b = from[count + i]; const float3 v = (float3)(a, b, a - b);
        {stores} }}"""
    program = cl.Program(compute.context, program_source(("pocl_inline.cl",)) + kernel).build()
    values = np.empty((len(formulas), len(a)), np.float32)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, values.nbytes)
    program.evaluate(
        compute.queue, a.shape, None, upload(compute, np.stack([a, b])), output, np.int32(len(a))
    )
    cl.enqueue_copy(compute.queue, values, output)
    return dict(zip(formulas, values, strict=True))


def pairs(count=4999):
    """Return pairs of numbers of all sizes, halves, zeros and equal ones."""
    random = np.random.default_rng(7)
    a, b = random.normal(size=(2, count)) * 10 ** random.uniform(-4, 3, (2, count))
    a[::5] = np.round(2 * a[::5]) / 2
    b[::7], b[::11], a[::13] = a[::7], -1e-3, 0
    return a.astype(np.float32), b.astype(np.float32)


def test_values_are_exact(compute):
    a, b = pairs()
    for formula, values in evaluated(compute, EXACT, a, b).items():
        np.testing.assert_array_equal(values, EXACT[formula](a, b).astype(np.float32), formula)


def test_values_are_off_by_rounding(compute):
    a, b = pairs()
    b[b == 0] = 1
    for formula, values in evaluated(compute, ROUNDED, a, b).items():
        exact = ROUNDED[formula](a.astype(float), b.astype(float))
        terms = a.astype(float) ** 2 + b.astype(float) ** 2 if "v" in formula.split("(")[1] else 1.0
        np.testing.assert_allclose(values / terms, exact / terms, rtol=3e-7, atol=5e-7, err_msg=formula)


def test_a_number_wins_against_none(compute):
    a, b = np.array([np.nan, 2, np.nan], np.float32), np.array([1, np.nan, np.nan], np.float32)
    values = evaluated(compute, ["fmin(a, b)", "fmax(a, b)", "fmax(v, 1.0f).x"], a, b)
    np.testing.assert_array_equal(values["fmin(a, b)"], [1, 2, np.nan])
    np.testing.assert_array_equal(values["fmax(a, b)"], [1, 2, np.nan])
    np.testing.assert_array_equal(values["fmax(v, 1.0f).x"], [1, 2, 1])


@pytest.mark.parametrize("size", [1e-30, 1e-19, 1.0, 1e18, 1e30])
def test_lengths_of_all_sizes(compute, size):
    a, b = np.float32([3 * size]), np.float32([-4 * size])
    values = evaluated(compute, ["length((float2)(a, b))", "normalize((float2)(a, b)).y"], a, b)
    np.testing.assert_allclose(values["length((float2)(a, b))"], 5 * size, rtol=1e-6)
    np.testing.assert_allclose(values["normalize((float2)(a, b)).y"], -0.8, rtol=1e-6)


def test_leading_zeros(compute):
    a = np.array([0, 1, 2, 3, 255, 2**20, 2**30], np.float32)
    values = evaluated(compute, ["clz((int)a)", "clz((uint)a)"], a, a)
    for counted in values.values():
        np.testing.assert_array_equal(counted, [32 - int(number).bit_length() for number in a])
