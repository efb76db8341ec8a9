"""Blender with Hemibake enabled, once a run, and an empty scene for each test."""

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from tools.headless import blender

collect_ignore_glob = [] if find_spec("bpy") else ["test_*.py"]


@pytest.fixture(scope="session")
def hemibake() -> Iterator[None]:
    with blender():
        yield


@pytest.fixture(autouse=True)
def empty_scene(hemibake: None) -> None:
    """Start from an empty, unsaved file; reading one keeps the add-on enabled."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.hemicube = "high", 32, "16"
