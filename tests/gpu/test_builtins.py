"""Replacements of built-in functions for drivers that cannot link a fused multiply-add."""

import numpy as np
import pytest

from engine.device import driver_options
from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.device.opencl import cl
from engine.device.program_cache import ProgramCache
from engine.device.source import program_source
from engine.plan.common_programs import common_programs
from engine.settings import Settings
from tests.analytic.scenes import furnace

KERNEL = """
__kernel void evaluate(__global const float *a, __global const float *b, __global const float *c,
                       __global float *to)
{
    const int i = get_global_id(0);
    to[6 * i] = fma(a[i], b[i], c[i]);
    const float2 two = fma((float2)(b[i], a[i]), (float2)(a[i]), (float2)(c[i], -b[i]));
    to[6 * i + 1] = two.x;
    to[6 * i + 2] = two.y;
    to[6 * i + 3] = sin(a[i]);
    to[6 * i + 4] = cos(a[i]);
    to[6 * i + 5] = tan(a[i]);
}
"""


@pytest.fixture
def lacking(monkeypatch):
    """Let the driver fail to build a fused multiply-add that is not replaced, as rusticl does."""
    build = driver_options.build

    def build_without_fma(context, source, *more):
        if "fma(" in source and "#define fma" not in source:
            raise cl.RuntimeError("Internal compilation error: nir_shader not fully linked")
        return build(context, source, *more)

    monkeypatch.setattr(driver_options, "build", build_without_fma)


def test_driver_that_lacks_built_ins_gets_replacements(lacking):
    source = ComputeDevice()._text(("images.cl",))
    assert "#define fma own_fma" in source and "kernel" in source


def test_programs_that_are_built_ahead_begin_with_the_replacements(lacking, monkeypatch):
    begun, settings = [], Settings(resolution=32)
    monkeypatch.setattr(ProgramCache, "begin", lambda self, programs: begun.append([*programs]) or set())
    compute = ComputeDevice(ahead=common_programs(furnace(0.5, 1.0), settings))
    assert all("#define fma" in program.source for program in begun[-1])
    assert len(begun) == 2 and len(begun[0]) == len(begun[1]) > 20
    assert len(compute._planned) == len(begun[1])


def test_driver_that_has_all_built_ins_gets_none():
    assert "own_fma" not in ComputeDevice()._text(("images.cl",))


def test_driver_that_builds_nothing_is_told_by_its_own_error(monkeypatch):
    def fail(context, source, *more):
        raise cl.RuntimeError("error: no target" if "#define fma" not in source else "error: other")

    monkeypatch.setattr(driver_options, "build", fail)
    with pytest.raises(cl.Error, match="no target"):
        driver_options.needed_replacements(None)


def test_replacements_agree_with_numpy():
    """Products that nearly cancel: the exact remainder is far below the rounding of the product."""
    compute, random = ComputeDevice(), np.random.default_rng(3)
    a, b = random.uniform(-7, 7, (2, 4999)).astype(np.float32)
    c = np.where(np.arange(4999) % 3 > 0, -a * b, random.normal(size=4999)).astype(np.float32)
    program = cl.Program(compute.context, program_source(("own_builtins.cl",)) + KERNEL).build()
    values = np.empty((4999, 6), np.float32)
    output = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, values.nbytes)
    inputs = [upload(compute, array) for array in (a, b, c)]
    program.evaluate(compute.queue, a.shape, None, *inputs, output)
    cl.enqueue_copy(compute.queue, values, output)
    x, y, z = (array.astype(np.float64) for array in (a, b, c))
    for found, exact in zip(values.T[:3], (x * y + z, x * y + z, x * x - y), strict=True):
        np.testing.assert_allclose(found, exact, rtol=1.3e-7, atol=1e-30)
    for found, exact in zip(values.T[3:5], (np.sin(x), np.cos(x)), strict=True):
        np.testing.assert_allclose(found, exact, atol=1e-6)
    finite = np.abs(np.cos(x)) > 0.1
    np.testing.assert_allclose(values[finite, 5], np.tan(x)[finite], rtol=1e-5, atol=1e-6)
