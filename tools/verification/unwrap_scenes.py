"""Scenes that are hard to unwrap or to pack. Each is built in an empty file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import bpy
import numpy as np

from tests.tools.levels import level as level_mesh
from tools.verification.scenes import open_glb

#: Every scene by name; each returns the width of its lightmaps, texels.
SCENES: dict[str, Callable[[], int]] = {}

#: Objects of the crowd, each of about 10,000 faces.
_CROWD = 100


def scene(function: Callable[[], int]) -> Callable[[], int]:
    """Register a scene under its function's name."""
    SCENES[function.__name__] = function
    return function


@scene
def crowd() -> int:
    """100 objects of 10,000 faces: rough balls, terrain, dented tori, levels, rubble."""
    random = np.random.default_rng(14)
    for index in range(_CROWD):
        obj = _CROWD_KINDS[index % len(_CROWD_KINDS)](random)
        obj.name = f"{obj.name} {index}"
        obj.location = (8 * (index % 10), 8 * (index // 10), 0)
    return 4096


@scene
def level() -> int:
    """A level of 30,000 faces in one mesh."""
    made = level_mesh(30_000, seed=1)
    _object("Level", made.positions, made.corners.reshape(-1, 4))
    return 2048


@scene
def cubes() -> int:
    """20 cubes and a plane."""
    bpy.ops.mesh.primitive_plane_add(size=12)
    random = np.random.default_rng(5)
    for index in range(20):
        place = (2.2 * (index % 5) - 4.4, 2.5 * (index // 5) - 3.7, 1)
        turn = (0, 0, random.uniform(0, np.pi))
        bpy.ops.mesh.primitive_cube_add(size=1, location=place, rotation=turn)
    return 512


@scene
def demo() -> int:
    """The Cornell box of the examples."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
    import_module("cornell_box").build()
    return 256


def register_files(folder: Path) -> None:
    """Register the scenes of a folder that are there."""
    if (folder / "house.glb").exists():

        @scene
        def house() -> int:
            """A house of 10,497 triangles."""
            open_glb(folder / "house.glb", folder)
            return 1024


def _rough_ball(random: np.random.Generator) -> bpy.types.Object:
    """Add a ball with a radius of its own for each vertex."""
    points, quads = _lattice(100, 100)
    around, up = 2 * np.pi * points[:, 0], np.pi * (points[:, 1] - 0.5)
    radius = 1 + 0.02 * random.normal(size=len(points)) + 0.3 * _waves(random, points)
    ball = np.stack([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)], axis=1)
    return _object("Ball", ball * radius[:, None], quads)


def _terrain(random: np.random.Generator) -> bpy.types.Object:
    """Add hills with gravel."""
    points, quads = _lattice(100, 100)
    height = 1.5 * _waves(random, points) + 0.02 * random.normal(size=len(points))
    return _object("Terrain", np.column_stack([6 * points, height]), quads)


def _torus(random: np.random.Generator) -> bpy.types.Object:
    """Add a torus with dents."""
    points, quads = _lattice(144, 70)
    around, tube = 2 * np.pi * points.T
    radius = 0.5 + 0.15 * _waves(random, points) + 0.02 * random.normal(size=len(points))
    ring = 1.5 + radius * np.cos(tube)
    return _object(
        "Torus",
        np.stack([ring * np.cos(around), ring * np.sin(around), radius * np.sin(tube)], axis=1),
        quads,
    )


def _level_part(random: np.random.Generator) -> bpy.types.Object:
    """Add rooms with walls, doors, stairs and props."""
    made = level_mesh(10_000, seed=int(random.integers(1 << 30)))
    return _object("Rooms", made.positions, made.corners.reshape(-1, 4))


def _rubble(random: np.random.Generator) -> bpy.types.Object:
    """Add 417 stones of 24 faces that stick in one another."""
    count, (corners, sides) = 417, _stone()
    size = np.exp(random.normal(-1.7, 0.6, (count, 1, 3)))
    stones = (corners + 0.1 * random.normal(size=(count, len(corners), 3))) * size
    turns = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    points = stones @ turns + random.uniform(-2, 2, (count, 1, 3))
    quads = np.arange(count)[:, None, None] * len(corners) + sides
    return _object("Rubble", points.reshape(-1, 3), quads.reshape(-1, 4))


def _stone() -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of a cube, (v, 3), whose sides are four quads each, (q, 4)."""
    points, quads = _lattice(2, 2)
    sides = []
    for axis in range(3):
        for level in (-1.0, 1.0):
            side = np.insert(2 * points - 1, axis, level, axis=1)
            # Rows and columns are exchanged where the side would be seen from inside.
            turned = side.reshape(3, 3, 3).swapaxes(0, 1).reshape(-1, 3)
            sides.append(side if (level > 0) == (axis != 1) else turned)
    corners, number = np.unique(np.concatenate(sides), axis=0, return_inverse=True)
    first = np.arange(len(sides))[:, None, None] * len(points)
    return corners, number.reshape(-1)[quads + first].reshape(-1, 4)


_CROWD_KINDS = (_rough_ball, _terrain, _torus, _level_part, _rubble)


def _lattice(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return places of a grid from 0 to 1, (v, 2), and its quads, (q, 4)."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    quads = np.stack([first, first + 1, first + columns + 2, first + columns + 1], axis=1)
    return np.stack([u.reshape(-1), v.reshape(-1)], axis=1), quads


def _waves(random: np.random.Generator, points: np.ndarray) -> np.ndarray:
    """Return a sum of waves of random directions and ever shorter lengths at some places, (v,)."""
    total = np.zeros(len(points))
    for octave in range(4):
        direction = 2 * np.pi * 2**octave * random.normal(size=2)
        total += np.sin(points @ direction + random.uniform(0, 7)) / 2**octave
    return total / 2


def _object(name: str, positions: np.ndarray, quads: np.ndarray) -> bpy.types.Object:
    """Add a mesh of quads."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(positions.tolist(), [], quads.tolist())
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj
