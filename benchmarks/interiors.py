"""Interiors: sealed rooms with panels below their ceilings, and a furnished room of 42,000 triangles."""

from __future__ import annotations

import numpy as np

from benchmarks.rooms import charted, standing_box
from benchmarks.surfaces import Surface, charted_surfaces, quad, turned
from engine import Material, Scene
from tests.analytic.scenes import material, rectangle, room_walls

_WHITE, _RED, _WOOD, _LIGHT = range(4)

#: Quads along each side of the chart of a turned thing.
_FINE = 40


def sealed_rooms(resolution: int) -> Scene:
    """Return three closed rooms of 4 x 5 m, 228 triangles, each with six boxes and two panels that shine."""
    pieces: list[np.ndarray] = []
    materials: list[int] = []
    random = np.random.default_rng(0)
    for room in range(3):
        made = [*room_walls(4.0, 5.0, 2.6)]
        materials += [_WHITE, _WHITE, _RED, _WOOD, _WHITE, _WHITE]
        for box in range(6):
            size, height, turn = random.uniform((0.3, 0.3, 0.0), (0.8, 1.6, 1.5))
            made += standing_box(size, height, (0.7 + 1.3 * (box % 3), 1.0 + 2.4 * (box // 3)), turn)
            materials += [int(random.integers(_LIGHT))] * 5
        made += [_panel((2.3, y, 2.55), 0.6) for y in (1.2, 3.2)]
        materials += [_LIGHT] * 2
        pieces += [piece + np.array([5.0 * room, 0, 0]) for piece in made]
    return Scene((charted(pieces, materials, resolution, "Rooms"),), _materials(12.0))


def furnished_room(resolution: int) -> Scene:
    """Return a closed room with a table, chairs, a cupboard, a couch, and vases, balls and rings on them."""
    surfaces = [quad(wall, _WHITE) for wall in room_walls(5.0, 6.0, 2.7)]
    surfaces += [quad(_panel((3.0, y, 2.65), 0.8), _LIGHT) for y in (1.5, 3.5)]
    surfaces += _block((2.5, 3.0, 0.72), (1.8, 1.0, 0.04), _WOOD)
    for x in (-0.8, 0.8):
        for y in (-0.4, 0.4):
            surfaces += _block((2.5 + x, 3.0 + y, 0.001), (0.06, 0.06, 0.718), _WOOD)
    for x, y in ((1.9, 2.2), (3.1, 2.2), (1.9, 3.8), (3.1, 3.8)):
        surfaces += _chair(x, y)
    surfaces += _block((0.4, 4.5, 0.001), (0.6, 1.6, 2.0), _RED)
    surfaces += _block((4.5, 1.2, 0.001), (0.7, 1.8, 0.5), _WOOD)
    places = (
        (2.1, 3.2, 0.761), (2.9, 2.8, 0.761), (2.5, 3.1, 0.761), (4.5, 0.7, 0.502), (4.5, 1.6, 0.502),
        (0.4, 4.1, 2.002), (0.4, 4.8, 2.002), (0.8, 1.0, 0.002), (1.4, 5.3, 0.002), (4.4, 5.4, 0.002),
        (3.3, 5.4, 0.002), (0.7, 2.3, 0.002), (4.4, 3.6, 0.002),
    )  # fmt: skip
    surfaces += [_turned(number % 3, np.array(place)) for number, place in enumerate(places)]
    return Scene((charted_surfaces(surfaces, resolution, "Furnished"),), _materials(14.0))


def _panel(corner: tuple[float, float, float], width: float) -> np.ndarray:
    """Return a rectangle that looks down."""
    return rectangle(corner, (-width, 0, 0), (0, 0.6, 0))


def _chair(x: float, y: float) -> list[Surface]:
    surfaces = _block((x, y, 0.44), (0.42, 0.42, 0.04), _WOOD)
    for leg_x in (-0.18, 0.18):
        for leg_y in (-0.18, 0.18):
            surfaces += _block((x + leg_x, y + leg_y, 0.001), (0.04, 0.04, 0.438), _WOOD)
    back = 0.19 if y > 3 else -0.19
    return surfaces + _block((x, y + back, 0.5), (0.42, 0.04, 0.5), _WOOD)


def _block(
    foot: tuple[float, float, float], size: tuple[float, float, float], material: int
) -> list[Surface]:
    """Return the six sides of a block that stands on the middle of its lower side."""
    x, y, z = np.diag(size)
    c = np.array(foot) - (x + y) / 2
    sides = (
        rectangle(c, x, z), rectangle(c + x, y, z), rectangle(c + x + y, -x, z), rectangle(c + y, -y, z),
        rectangle(c + z, x, y), rectangle(c + y, x, -y),
    )  # fmt: skip
    return [quad(side, material) for side in sides]


def _turned(kind: int, foot: np.ndarray) -> Surface:
    """Return a vase, a ball or a ring, a profile turned about a vertical axis."""
    t = np.linspace(0, 1, _FINE + 1)
    if kind == 0:
        profile = np.stack(
            [0.02 + 0.12 * np.sin(np.pi * (0.15 + 0.8 * t)) * (1 + 0.2 * np.sin(7 * t)), 0.45 * t]
        )
    elif kind == 1:
        angle = np.pi * (t - 0.5)
        profile = 0.14 * np.stack([np.maximum(np.cos(angle), 1e-3), 1 + np.sin(angle)])
    else:
        profile = np.stack([0.15 + 0.06 * np.cos(2 * np.pi * t), 0.06 + 0.06 * np.sin(2 * np.pi * t)])
    radius, height = profile
    return turned(radius[:, None], height, foot, _FINE, kind)


def _materials(radiance: float) -> tuple[Material, ...]:
    return (
        material("White", (0.73, 0.73, 0.73)),
        material("Red", (0.6, 0.2, 0.15)),
        material("Wood", (0.45, 0.3, 0.2)),
        material("Light", (0.7, 0.7, 0.7), (radiance, 0.9 * radiance, 0.8 * radiance)),
    )
