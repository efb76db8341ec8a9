"""Whole rooms: one made here, the demo's, and scenes that nobody here made, where their files are present."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import bpy

from tools.headless import ROOT

from .stage import add, box, lamp, material, world_image

_WORLD = "spiaggia_di_mondello_1k.hdr"


def closed_room() -> None:
    """Walls all around: many bounces."""
    walls = add("Room", bpy.ops.mesh.primitive_cube_add, material("Walls", (0.7, 0.7, 0.65)), size=3,
                location=(0, 0, 1.5))  # fmt: skip
    walls.data.flip_normals()
    box()
    lamp("AREA", location=(0, 0, 2.8), aim=(0, 0.001, 0), energy=60, shape="SQUARE", size=0.8)


def cornell_box() -> None:
    """The room of `make demo`."""
    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box as example

    example.build()


def open_blend(path: Path) -> Callable[[], None]:
    """Return what opens a .blend file."""
    return lambda: bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)


def import_glb(path: Path) -> Callable[[], None]:
    """Return what opens a .glb file under the sky of the folder."""

    def build() -> None:
        bpy.ops.import_scene.gltf(filepath=str(path))
        world_image(bpy.data.images.load(str(path.parent / _WORLD)))

    return build
