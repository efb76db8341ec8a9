"""Devices that are opened in a thread, and what starts kernels."""

import importlib
import mmap
import os
import sys
import threading

import numpy as np
import pyopencl as cl
import pytest

from engine import DeviceError
from engine.device.cl_device import ComputeDevice
from engine.device.cl_library import start_drivers
from engine.device.devices import AsyncOpen, Devices
from engine.device.planned_program import PlannedProgram


def test_a_device_waits_for_its_programs_and_nothing_else_does():
    asked, programs = (
        threading.Event(),
        [PlannedProgram(("float4_rows.cl",)), PlannedProgram(("a.cl",), ("-DX",))],
    )

    def open_device(ahead):
        asked.set()
        return list(ahead)

    opening = AsyncOpen(open_device)
    assert asked.wait(60)
    opening.build_ahead(programs)
    assert opening.compute() == programs


@pytest.mark.skipif(sys.platform != "linux", reason="Linux tells files in memory as bytes.")
def test_drivers_start_beside_files_whose_names_are_no_text(tmp_path):
    path = os.fsencode(tmp_path) + b"/fa\xe9.bin"
    with open(path, "w+b") as file:
        file.write(b"here")
        file.flush()
        with mmap.mmap(file.fileno(), 4):
            start_drivers()


@pytest.mark.parametrize("told", [False, True])
def test_an_error_leaves_nothing_open(told):
    released = threading.Event()

    class Device:
        def __init__(self, ahead):
            assert list(ahead) == ([1] if told else [])

        release = staticmethod(released.set)

    def failing():
        with AsyncOpen(Device) as opening:
            if told:
                opening.build_ahead([1])
            raise ImportError

    with pytest.raises(ImportError):
        failing()
    assert released.is_set()


def test_who_asks_for_a_device_is_told_why_there_is_none():
    opening = Devices.begin_opening(None, "No such device")
    opening.build_ahead([])
    with pytest.raises(DeviceError, match="There is no OpenCL device 'No such device'"):
        Devices(None, "No such device", opening)


def test_kernels_that_share_what_starts_them_keep_their_own_arguments():
    """They differ in their names; others in the types of their arguments, too."""
    source = """
    __kernel void twice(__global float *x, const int number) { x[get_global_id(0)] = 2 * number; }
    __kernel void thrice(__global float *x, const int number) { x[get_global_id(0)] = 3 * number; }
    __kernel void halved(__global float *x, const float number) { x[get_global_id(0)] = number / 2; }
    __kernel void summed(__global float *x, const int4 all) { x[get_global_id(0)] = all.x + all.y + all.w; }
    """
    compute = ComputeDevice()
    made = importlib.import_module("pyopencl.invoker").invoker_cache._made
    made.clear()
    program = cl.Program(compute.context, source).build()
    arguments = {
        "twice": np.int32(5), "thrice": np.int32(7), "halved": np.float32(0.5),
        "summed": np.array([1, 2, 4, 8], np.int32),
    }  # fmt: skip
    kernels = {name: cl.Kernel(program, name) for name in arguments}
    assert len(made) == 1
    for typed in (False, True):
        for name, expected in {"twice": 10, "thrice": 21, "halved": 0.25, "summed": 11}.items():
            value, found = arguments[name], np.zeros(4, np.float32)
            buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, found.nbytes)
            if typed:
                types = [None, value.dtype if value.ndim == 0 else np.dtype((np.void, 16))]
                kernels[name].set_arg_types(types)
            kernels[name](compute.queue, (4,), (1,), buffer, value)
            cl.enqueue_copy(compute.queue, found, buffer)
            assert (found == expected).all(), name

    # Those of any arguments, then of an int, a float and a vector.
    assert len(made) == 1 + 3
