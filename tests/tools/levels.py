"""Meshes as levels of games have them, made by lot: tiled rooms, walls with doors, stairs, pillars, props."""

from __future__ import annotations

import numpy as np

from engine.unwrap.polygon_mesh import PolygonMesh

#: Width and height of a cell, metres; a room has one or several.
_CELL, _HEIGHT = 6.0, 3.0

#: Corners of a box's sides, of the corners (x, y, z) in binary, counter-clockwise from outside.
_SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


class _Parts:
    """Quads that are collected part by part; vertices of a part are its own."""

    def __init__(self) -> None:
        self.positions: list[np.ndarray] = []
        self.quads: list[np.ndarray] = []
        self._count = 0

    def add(self, positions: np.ndarray, quads: np.ndarray) -> None:
        """Add vertices, (v, 3), and quads of them, (q, 4)."""
        self.positions.append(positions)
        self.quads.append(np.asarray(quads) + self._count)
        self._count += len(positions)

    def sheet(self, points: np.ndarray) -> None:
        """Add a grid of points, (rows, columns, 3), as one surface."""
        rows, columns = points.shape[:2]
        first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
        around = np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)
        self.add(points.reshape(-1, 3), around)

    def rectangle(self, corner: np.ndarray, right: np.ndarray, up: np.ndarray, step: float) -> None:
        """Add a rectangle in squares of about `step` metres."""
        across, along = (max(1, round(float(np.linalg.norm(side)) / step)) for side in (right, up))
        u, v = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(0, 1, along + 1))
        self.sheet(np.asarray(corner) + u[..., None] * np.asarray(right) + v[..., None] * np.asarray(up))

    def box(self, centre: np.ndarray, size: np.ndarray, turn: float) -> None:
        """Add a box that stands on a point, turned about the vertical."""
        unit = np.array([(x - 0.5, y - 0.5, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
        c, s = np.cos(turn), np.sin(turn)
        self.add((unit * size) @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)]) + centre, _BOX)

    def tube(self, centre: np.ndarray, radius: float, height: float, sides: int, rows: int) -> None:
        """Add a round pillar, a little thicker in its middle."""
        angle, z = np.meshgrid(np.linspace(0, 2 * np.pi, sides + 1), np.linspace(0, height, rows + 1))
        width = radius * (1 + 0.2 * np.sin(np.pi * z / height))
        self.sheet(centre + np.stack([width * np.cos(angle), width * np.sin(angle), z], axis=2))


#: Sides of a box whose vertices are ordered x, y, z with z fastest.
_BOX = np.array([[(bit & 1) * 4 + (bit >> 1 & 1) * 2 + (bit >> 2) for bit in side] for side in _SIDES])


def level(faces: int, seed: int = 0) -> PolygonMesh:
    """Return a level as one mesh of about `faces` quads."""
    random, parts = np.random.default_rng(seed), _Parts()
    side = 1
    while _estimate(side) < faces:
        side += 1
    for row in range(side):
        for column in range(side):
            _add_cell(parts, np.array([column * _CELL, row * _CELL, 0.0]), random)
    return _mesh(parts, faces)


def _moved(point: np.ndarray, *offset: float) -> np.ndarray:
    return point + np.array(offset)


def _estimate(side: int) -> int:
    return 220 * side**2


def _add_cell(parts: _Parts, corner: np.ndarray, random: np.random.Generator) -> None:
    """Add a room, or a part of one: tiled floor, walls here and there, and what stands in it."""
    parts.rectangle(corner, (_CELL, 0, 0), (0, _CELL, 0), 1.0)
    parts.rectangle(_moved(corner, 0, 0, _HEIGHT), (0, _CELL, 0), (_CELL, 0, 0), 1.5)
    for right, out in (((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0))):
        if random.random() < 0.7:
            _add_wall(parts, corner, np.array(right, float), np.array(out, float), random)
    for _ in range(random.integers(2, 7)):
        place = _moved(corner, *random.uniform(0.5, _CELL - 0.5, 2), 0)
        parts.box(place, random.uniform(0.1, 1.2, 3), random.uniform(0, np.pi))
    if random.random() < 0.5:
        parts.tube(_moved(corner, 1, 1, 0), random.uniform(0.15, 0.4), _HEIGHT, 12, 5)
    if random.random() < 0.3:
        _add_stairs(parts, _moved(corner, 2, 3, 0), int(random.integers(5, 13)))
    if random.random() < 0.2:
        _add_rubble(parts, _moved(corner, 1, 1, 0.02), random)


def _add_wall(parts: _Parts, corner, right, out, random: np.random.Generator) -> None:
    """Add a wall 20 cm thick with a door of random place and width."""
    left, width = random.uniform(1, 3), random.uniform(0.8, 1.6)
    up, thick = np.array((0, 0, _HEIGHT)), 0.2 * out
    for start, end in ((0.0, left), (left + width, _CELL)):
        begin, length = corner + start * right, (end - start) * right
        parts.rectangle(begin, length, up, 0.75)
        parts.rectangle(begin + thick + length, -length, up, 0.75)
        parts.rectangle(begin + length, thick, up, 0.75)
        parts.rectangle(begin + thick, -thick, up, 0.75)
    lintel, low = corner + left * right + (0, 0, 2.1), np.array((0, 0, _HEIGHT - 2.1))
    parts.rectangle(lintel, width * right, low, 0.75)
    parts.rectangle(lintel + thick + width * right, -width * right, low, 0.75)
    parts.rectangle(lintel + thick, width * right, -thick, 0.75)


def _add_stairs(parts: _Parts, foot: np.ndarray, steps: int) -> None:
    """Add a flight of stairs as one folded surface."""
    tread = np.repeat(np.arange(steps + 1), 2)
    profile = np.stack([0 * tread, tread * 0.28, np.roll(tread, -1) * 0.17], axis=1)[:-1]
    parts.sheet(foot + profile[:, None] + np.array([(0, 0, 0), (1.2, 0, 0)]))


def _add_rubble(parts: _Parts, corner: np.ndarray, random: np.random.Generator) -> None:
    """Add a heap: a bumpy sheet."""
    x, y = np.meshgrid(np.linspace(0, 2.5, 13), np.linspace(0, 2.5, 13))
    z = 0.6 * np.exp(-((x - 1.2) ** 2) - (y - 1.3) ** 2) + random.uniform(0, 0.12, x.shape)
    parts.sheet(corner + np.stack([x, y, z], axis=2))


def _mesh(parts: _Parts, faces: int) -> PolygonMesh:
    quads = np.concatenate(parts.quads)[:faces]
    count = len(quads)
    loops = np.arange(0, 4 * count, 4)[:, None]
    return PolygonMesh(
        name=f"Level of {count:,}",
        positions=np.concatenate(parts.positions),
        corners=quads.reshape(-1).astype(np.int32),
        starts=np.arange(0, 4 * count + 1, 4, dtype=np.int32),
        triangles=(loops[:, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3).astype(np.int32),
        polygon=np.repeat(np.arange(count, dtype=np.int32), 2),
    )
