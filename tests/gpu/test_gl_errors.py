"""OpenGL errors end the bake with a message that names the failed task."""

import dataclasses

import pytest

from engine import DeviceError, Settings, finished
from engine.device import devices
from engine.device.gl_context import GraphicsContext
from engine.session import Session
from tests.analytic.scenes import furnace
from tests.no_compute import NoCompute

QUICK = Settings(resolution=32, hemicube=8, max_bounces=2, tolerance=0, visibility="raster")
PAPER = dataclasses.replace(QUICK, method="paper")

#: An invalid call of OpenGL, which leaves all its state as it was.
INVALID = "glActiveTexture", 0


def refused(monkeypatch, program):
    """Let OpenGL refuse something whenever a shader program of a name is asked for."""
    for maker in ("program", "compute_program"):
        original = getattr(GraphicsContext, maker)

        def failing(graphics, name, *arguments, original=original):
            if name == program:
                graphics.raw(*INVALID)
            return original(graphics, name, *arguments)

        monkeypatch.setattr(GraphicsContext, maker, failing)


@pytest.mark.parametrize(
    ("program", "settings", "task"),
    [
        ("patches", QUICK, "drawing lightmap UVs"),
        ("conservative_coverage", QUICK, "drawing lightmap UVs"),
        ("hemicube", QUICK, "making room for hemicubes"),
        ("hemicube", PAPER, "making room for hemicubes"),
        ("integrate", PAPER, "drawing hemicubes"),
    ],
)
def test_what_opengl_refuses_is_told(monkeypatch, program, settings, task):
    session = Session()
    with monkeypatch.context() as patched:
        refused(patched, program)
        with pytest.raises(DeviceError, match=f"GL_INVALID_ENUM: {task} failed. Update"):
            finished(session.bake(furnace(0.5, 1.0), settings))
    assert finished(session.bake(furnace(0.5, 1.0), settings)).image.any()
    session.close()


@pytest.mark.parametrize(
    ("settings", "compute"), [(PAPER, devices.ComputeDevice), (QUICK, NoCompute)], ids=["paper", "cached"]
)
def test_what_compute_shaders_refuse_is_told(monkeypatch, settings, compute):
    """Nothing is summed if a buffer is not where the shader looks for it."""
    monkeypatch.setattr(devices, "ComputeDevice", compute)
    session = Session()
    with monkeypatch.context() as patched:
        patched.setattr("engine.gather.compute_shader._FRAMES", 1 << 20)
        with pytest.raises(DeviceError, match="GL_INVALID_VALUE: summing hemicubes failed"):
            finished(session.bake(furnace(0.5, 1.0), settings))
    assert finished(session.bake(furnace(0.5, 1.0), settings)).image.any()
    session.close()


def test_memory_that_is_not_enough_is_told(graphics):
    """Twelve layers of 16384 x 16128 texels of 16 bytes."""
    if "llvmpipe" not in graphics.name:
        pytest.skip("a graphics card may hold 50 GiB")
    large = dataclasses.replace(PAPER, hemicube=256, array_size=(16384, 16128, 12))
    session = Session()
    with pytest.raises(DeviceError, match="memory of .* is full: preparing to draw failed. Lower"):
        finished(session.bake(furnace(0.5, 1.0), large))
    session.close()
