"""A hall with two arcades of fluted columns, lit by sun and sky through the windows of its aisles."""

from __future__ import annotations

import numpy as np

from benchmarks.surfaces import Surface, charted_surfaces, quad, turned
from engine import Light, Scene
from tests.analytic.scenes import material, rectangle

_STONE, _PLASTER, _FLOOR = range(3)

#: Bays between columns along y, and the length of each, m.
_BAYS, _BAY = 10, 3.0

#: m: width and length of the hall; height of columns, of the arcades, of the walls below the vault.
_WIDTH, _LENGTH = 16.0, _BAYS * _BAY
_COLUMN, _ARCADE, _WALL = 3.2, 5.0, 6.5

#: m: where the columns stand along x, and how thick the arcades above them are.
_ROWS, _THICK = (4.5, 11.5), 0.6

#: m: width of windows, their sill and their head.
_WINDOW, _SILL, _HEAD = 1.4, 1.4, 4.2

#: m: how far the gables reach below the vault.
_BELOW = 0.3

#: Triangles of the hall unless others are asked for, about.
TRIANGLES = 262_144

#: Triangles of the hall over the square of the quads around a column, without those of its flat walls.
_PER_SQUARE = 64

#: Light of the sky at the horizon and above, W/(m^2 sr).
_HORIZON, _ZENITH = (0.5, 0.55, 0.6), (0.25, 0.45, 0.9)

_FLUTES, _DEPTH = 16, 0.04


def hall(resolution: int, triangles: int = TRIANGLES) -> Scene:
    """Return a hall of 16 x 30 m of about so many triangles, with a sun, a sky and four lamps.

    resolution: width of its lightmap, texels; 200 at least, since it has 108 charts.
    """
    fine = max(8, 8 * round(np.sqrt(triangles / _PER_SQUARE) / 8))
    surfaces = [_column(x, _BAY * (bay + 1), fine) for x in _ROWS for bay in range(_BAYS - 1)]
    for bay in range(_BAYS):
        for x in _ROWS:
            surfaces += _arch(x, _BAY * bay, fine)
    surfaces += [_vault(fine), _floor(fine), *_walls()]
    surfaces += [_gable(y, fine) for y in (0.0, _LENGTH)]
    materials = (
        material("Stone", (0.62, 0.58, 0.5)),
        material("Plaster", (0.75, 0.74, 0.7)),
        material("Floor", (0.35, 0.3, 0.27)),
    )
    mesh = charted_surfaces(surfaces, resolution, "Hall")
    return Scene((mesh,), materials, world=_sky(), lights=(_sun(), *_lamps()))


def _column(x: float, y: float, fine: int) -> Surface:
    """Return a column with a base and a capital, fluted between them."""
    t, turn = np.linspace(0, 1, fine + 1)[:, None], 2 * np.pi * np.linspace(0, 1, fine + 1)
    ends = np.exp(-((t / 0.05) ** 2)) + np.exp(-(((1 - t) / 0.06) ** 2))
    flutes = _DEPTH * np.abs(np.sin(_FLUTES / 2 * turn)) * (1 - np.minimum(ends, 1))
    radius = 0.34 - 0.04 * t + 0.14 * ends - flutes
    return turned(radius, _COLUMN * t[:, 0], np.array([x, y, 0]), fine, _STONE)


def _arch(x: float, y: float, fine: int) -> list[Surface]:
    """Return the surfaces above the opening of a bay: the arch from below, and both sides of the wall."""
    angle = np.linspace(0, np.pi, fine + 1)
    along = y + 0.5 * _BAY * (1 - np.cos(angle))
    above = _COLUMN + 0.45 * _BAY * np.sin(angle)
    depth = np.linspace(0.5, -0.5, fine // 4 + 1) * _THICK + x
    below = np.stack(np.broadcast_arrays(depth[None, :], along[:, None], above[:, None]), axis=-1)
    up = np.linspace(0, 1, fine // 8 + 1)[:, None]
    across = np.stack(np.broadcast_arrays(x, along, above + up * (_ARCADE - above)), axis=-1)
    half = np.array([_THICK / 2, 0, 0])
    return [Surface(points, _STONE) for points in (below, across + half, across[:, ::-1] - half)]


def _vault(fine: int) -> Surface:
    """Return the barrel vault above the nave."""
    radius, angle = (_ROWS[1] - _ROWS[0] - _THICK) / 2, np.linspace(np.pi, 0, fine + 1)[:, None]
    y = np.linspace(0, _LENGTH, 2 * fine + 1)
    points = (_WIDTH / 2 + radius * np.cos(angle), y, _WALL + radius * np.sin(angle))
    return Surface(np.stack(np.broadcast_arrays(*points), axis=-1), _PLASTER)


def _floor(fine: int) -> Surface:
    """Return the floor, worn a little."""
    x, y = np.linspace(0, _WIDTH, fine + 1), np.linspace(0, _LENGTH, 2 * fine + 1)[:, None]
    z = -0.01 * np.sin(np.pi * x / _WIDTH) * np.sin(np.pi * y / _LENGTH)
    return Surface(np.stack(np.broadcast_arrays(x, y, z), axis=-1), _FLOOR)


def _gable(y: float, fine: int) -> Surface:
    """Return the half disk of an end of the nave below the vault."""
    radius, angle = (_ROWS[1] - _ROWS[0] - _THICK) / 2, np.linspace(0, np.pi, fine + 1)
    up = np.linspace(0, 1, fine // 8 + 1)[:, None]
    x, z = _WIDTH / 2 + radius * np.cos(angle), _WALL - _BELOW + up * (_BELOW + radius * np.sin(angle))
    points = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return Surface(points if y == 0 else points[:, ::-1], _PLASTER)


def _walls() -> list[Surface]:
    """Return the flat surfaces: walls with windows, roofs of the aisles, the nave above them, both ends."""
    x, y, z = np.diag([_WIDTH, _LENGTH, 1.0])
    rise, top, end = (_WALL - _ARCADE) * z, _ARCADE * z, (_WALL - _BELOW - _ARCADE) * z
    left, right = _ROWS[0] + _THICK / 2, _ROWS[1] - _THICK / 2
    aisle = (_ROWS[0] - _THICK / 2) * np.array([1.0, 0, 0])
    nave = np.array([right - left, 0, 0])
    flat = [
        rectangle(top + aisle, -aisle, y), rectangle(x + top, -aisle, y),
        rectangle((left, 0, _ARCADE), y, rise), rectangle((right, _LENGTH, _ARCADE), -y, rise),
        rectangle(x, -x, top), rectangle(y, x, top),
        rectangle((right, 0, _ARCADE), -nave, end), rectangle((left, _LENGTH, _ARCADE), nave, end),
    ]  # fmt: skip
    flat += _windows(np.zeros(3), y) + _windows(x + y, -y)
    return [quad(corners, _PLASTER) for corners in flat]


def _windows(corner: np.ndarray, along: np.ndarray) -> list[np.ndarray]:
    """Return the parts of a wall around its windows, one in the middle of each bay."""
    z, unit = np.array([0, 0, 1.0]), along / np.linalg.norm(along)
    pier = _BAY - _WINDOW
    starts = [0.0, *(_BAY * bay - pier / 2 for bay in range(1, _BAYS)), _LENGTH - pier / 2]
    widths = [pier / 2, *[pier] * (_BAYS - 1), pier / 2]
    parts = [
        rectangle(corner, along, _SILL * z), rectangle(corner + _HEAD * z, along, (_ARCADE - _HEAD) * z)
    ]  # fmt: skip
    return parts + [
        rectangle(corner + start * unit + _SILL * z, width * unit, (_HEAD - _SILL) * z)
        for start, width in zip(starts, widths, strict=True)
    ]


def _sun() -> Light:
    toward = np.array([0.75, -0.25, 0.6]) / np.linalg.norm([0.75, -0.25, 0.6])
    side = np.cross([0, 0, 1.0], toward)
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(toward, side), toward])
    strength = np.array([4.0, 3.7, 3.2], np.float32)
    return Light("Sun", "sun", np.zeros(3), axes, strength, half_angle=0.0047)


def _lamps() -> list[Light]:
    strength = np.array([2.0, 1.6, 1.1], np.float32)
    return [
        Light(f"Lamp {index}", "point", np.array([_WIDTH / 2, y, 4.6]), np.eye(3), strength, radius=0.1)
        for index, y in enumerate(_LENGTH * (np.arange(4) + 0.5) / 4)
    ]


def _sky() -> np.ndarray:
    """Return the sky, (16, 32, 3) float32: brighter at the horizon, dark below."""
    up = np.sin(np.pi * ((np.arange(16) + 0.5) / 16 - 0.5))[:, None, None]
    sky = np.where(up > 0, (1 - up) * np.array(_HORIZON) + up * np.array(_ZENITH), 0.02)
    return np.broadcast_to(sky, (16, 32, 3)).astype(np.float32)
