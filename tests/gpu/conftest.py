from collections.abc import Iterator

import pytest

from engine.device.compute import Compute
from engine.device.graphics import Graphics
from tests.gpu.graphics_card import GraphicsCard


@pytest.fixture(scope="module")
def graphics() -> Iterator[Graphics]:
    """One OpenGL context a module; no call of a test may leave an OpenGL error behind."""
    device = Graphics()
    yield device
    device.release()


@pytest.fixture(scope="module", params=[Compute, GraphicsCard], ids=["processor", "card"])
def compute(request: pytest.FixtureRequest) -> Compute:
    """The OpenCL device as it is, and taken for a graphics card."""
    device: Compute = request.param()
    return device


@pytest.fixture(autouse=True)
def no_gl_error(request: pytest.FixtureRequest) -> Iterator[None]:
    yield
    if "graphics" in request.fixturenames:
        assert request.getfixturevalue("graphics").context.error == "GL_NO_ERROR"
