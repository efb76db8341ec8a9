"""Blender with Hemibake enabled, and engines that display its exports."""

from collections.abc import Iterator

import pytest

from tools.engines import three
from tools.headless import blender


@pytest.fixture(scope="session")
def engine():
    """Return a renderer of exported files with three.js."""
    missing = three.missing()
    if missing:
        pytest.skip(f"{missing}: exports are not shown with three.js")
    three.install()
    return three


@pytest.fixture(scope="session")
def hemibake() -> Iterator[None]:
    with blender():
        yield
