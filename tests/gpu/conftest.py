from collections.abc import Iterator

import numpy as np
import pyopencl as cl
import pytest

from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from tests.gpu.graphics_card import GraphicsCard


@pytest.fixture(scope="module")
def graphics() -> Iterator[GraphicsContext]:
    """One OpenGL context a module; no call of a test may leave an OpenGL error behind."""
    device = GraphicsContext()
    yield device
    device.release()


@pytest.fixture(scope="module", params=[ComputeDevice, GraphicsCard], ids=["processor", "card"])
def compute(request: pytest.FixtureRequest) -> ComputeDevice:
    """The OpenCL device as it is, and taken for a graphics card."""
    device: ComputeDevice = request.param()
    return device


@pytest.fixture(autouse=True)
def no_empty_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCL has no commands that copy or fill nothing; PoCL 3 lets them pass, others refuse them."""
    copy, fill = cl.enqueue_copy, cl.enqueue_fill_buffer

    def copied(queue, dest, src, **options):
        sizes = [part.nbytes for part in (dest, src) if isinstance(part, np.ndarray)]
        assert all(sizes), "a copy of nothing"
        return copy(queue, dest, src, **options)

    def filled(queue, mem, pattern, offset, size, *more, **options):
        assert size, "a fill of nothing"
        return fill(queue, mem, pattern, offset, size, *more, **options)

    monkeypatch.setattr(cl, "enqueue_copy", copied)
    monkeypatch.setattr(cl, "enqueue_fill_buffer", filled)


@pytest.fixture(autouse=True)
def no_gl_error(request: pytest.FixtureRequest) -> Iterator[None]:
    yield
    if "graphics" in request.fixturenames:
        assert request.getfixturevalue("graphics").context.error == "GL_NO_ERROR"
