"""Rooms of any number of patches, triangles and lamps, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from engine import Light, Mesh, Scene
from tests.analytic.scenes import GAP, Chart, material, quads, rectangle, room_walls

#: Side of the room, m.
ROOM = 2.0

_WHITE, _RED, _GREEN, _LIGHT = range(4)


def cornell_box(resolution: int) -> Scene:
    """Return a closed Cornell box, 17 quads, whose charts fill a lightmap of `resolution` texels a side.

    Six walls, two boxes without bottoms and a light that hangs 0.1 m below the ceiling.
    """
    pieces, materials = _cornell_quads()
    return Scene((charted(pieces, materials, resolution, "Box"),), _materials(15.0))


def panel_box(resolution: int) -> Scene:
    """Return a closed box with a light set into its ceiling and a panel that stands on its floor; 15 quads.

    The back of the light shines on nothing.
    """
    walls = room_walls(ROOM, ROOM, ROOM)
    cuts, ceiling = (0.0, 0.75, 1.25, ROOM), []
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2), (1, 1)):
        across, along = (cuts[i] - cuts[i + 1], 0, 0), (0, cuts[j + 1] - cuts[j], 0)
        ceiling.append(rectangle((cuts[i + 1], cuts[j], ROOM), across, along))
    panel = rectangle((0.5, 0.6, 0), (0.9, 0.4, 0), (0, 0, 1.1))
    pieces = [walls[0], *walls[2:], panel, *ceiling]
    materials = [_WHITE, _RED, _GREEN, _WHITE, _WHITE, _WHITE, *[_WHITE] * 8, _LIGHT]
    return Scene((charted(pieces, materials, resolution, "Box"),), _materials(15.0))


def dark_box(resolution: int, lamps: int) -> Scene:
    """Return the same box without its light, lit by `lamps` point lamps in a grid below the ceiling."""
    pieces, materials = _cornell_quads()
    mesh = charted(pieces[:-1], materials[:-1], resolution, "Box")
    return Scene((mesh,), _materials(0.0), lights=tuple(_lamps(lamps)))


def hilly_room(resolution: int, triangles: int) -> Scene:
    """Return a closed room with a light whose floor is a grid of hills; about `triangles` triangles.

    The floor's chart takes half of the lightmap. With 14 triangles or fewer the floor is flat.
    """
    side = max(1, round(np.sqrt(max(triangles - 12, 2) / 2)))
    pieces = [*room_walls(ROOM, ROOM, ROOM)[1:], _hanging_light()]
    charts = packed([*[(1.0, 1.0)] * 5, (0.25, 0.25)], resolution, (0, resolution // 2))
    walls = quads(
        np.stack(pieces), charts, [_WHITE, _RED, _GREEN, _WHITE, _WHITE, _LIGHT], resolution, "Room"
    )
    return Scene((walls, _hills(side, resolution)), _materials(15.0))


def with_small_box(scene: Scene, resolution: int) -> Scene:
    """Return a room with a box of 0.3 m that floats in it, the last mesh, in a lightmap of its own."""
    pieces = [np.add(piece, (0, 0, 0.5)) for piece in standing_box(0.3, 0.3, (1.4, 1.2), 0.3)]
    charts = packed([(1.0, 1.0)] * len(pieces), resolution // 4, (0, resolution // 4))
    box = quads(np.stack(pieces), charts, [_WHITE] * len(pieces), resolution, "Small box")
    meshes = (*scene.meshes, replace(box, atlas=len(scene.atlases)))
    return replace(scene, meshes=meshes, atlases=(*scene.atlases, "Small box"))


def with_instances(scene: Scene, count: int) -> Scene:
    """Return a room with small boxes without lightmaps at random places, one mesh each."""
    from engine.scene.model import NO_LIGHTMAP

    pieces = standing_box(0.01, 0.01, (0, 0), 0.3)
    charts = packed([(1.0, 1.0)] * len(pieces), 64, (0, 64))
    box = quads(np.stack(pieces), charts, [_WHITE] * len(pieces), 64, "Instance")
    places = np.random.default_rng(5).uniform(0.05, 0.9, (count, 1, 3)).astype(np.float32) * ROOM
    boxes = tuple(
        replace(box, name=f"Instance {index}", positions=box.positions + place, atlas=NO_LIGHTMAP)
        for index, place in enumerate(places)
    )
    return replace(scene, meshes=(*scene.meshes, *boxes))


def _cornell_quads() -> tuple[list[np.ndarray], list[int]]:
    """Return quads and materials; the light is the last."""
    pieces, materials = list(room_walls(ROOM, ROOM, ROOM)), [_WHITE, _WHITE, _RED, _GREEN, _WHITE, _WHITE]
    for size, height, position, turn in ((0.6, 0.6, (1.33, 0.61), -17), (0.6, 1.2, (0.67, 1.27), 18)):
        pieces += standing_box(size, height, position, np.radians(turn))
        materials += [_WHITE] * 5
    return [*pieces, _hanging_light()], [*materials, _LIGHT]


def _hanging_light() -> np.ndarray:
    return rectangle((1.25, 0.75, ROOM - 0.1), (-0.5, 0, 0), (0, 0.5, 0))


def standing_box(size: float, height: float, position: tuple[float, float], turn: float) -> list[np.ndarray]:
    """Return the sides and the top of a box that stands on the floor, turned about its middle."""
    across = size * np.array([np.cos(turn), np.sin(turn), 0])
    along = size * np.array([-np.sin(turn), np.cos(turn), 0])
    up, corner = np.array([0, 0, height]), np.array([*position, 0]) - (across + along) / 2
    return [
        rectangle(corner, across, up),
        rectangle(corner + across, along, up),
        rectangle(corner + across + along, -across, up),
        rectangle(corner + along, -along, up),
        rectangle(corner + up, across, along),
    ]


def charted(pieces: Sequence[np.ndarray], materials: Sequence[int], resolution: int, name: str) -> Mesh:
    """Return a mesh of quads, (4, 3) each, whose charts fill a lightmap."""
    sizes = [tuple(np.linalg.norm(piece[[1, 3]] - piece[0], axis=1)) for piece in pieces]
    charts = packed(sizes, resolution, (0, resolution))
    return quads(np.stack(pieces), charts, materials, resolution, name)


def packed(sizes: Sequence[tuple[float, float]], width: int, rows: tuple[int, int]) -> list[Chart]:
    """Lay out charts of given sizes in m as densely as they fit between two rows of a lightmap."""
    low, high = 0.0, 2.0 * width / min(max(size) for size in sizes)
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if _shelves(sizes, middle, width, rows) else (low, middle)
    charts = _shelves(sizes, low, width, rows)
    if charts is None:
        raise ValueError(f"{len(sizes)} charts do not fit into a lightmap {width} texels wide.")
    return charts


def _shelves(
    sizes: Sequence[tuple[float, float]], density: float, width: int, rows: tuple[int, int]
) -> list[Chart] | None:
    """Lay charts on shelves, the tallest first, GAP texels apart; None if they do not fit."""
    texels = [tuple(max(1, int(density * side)) for side in size) for size in sizes]
    charts: list[Chart] = [(0, 0, 0, 0)] * len(sizes)
    left, bottom, top = 0, rows[0], rows[0]
    for index in sorted(range(len(sizes)), key=lambda index: -texels[index][1]):
        across, up = texels[index]
        if left + across > width:
            left, bottom = 0, top + GAP
        if left + across > width or bottom + up > rows[1]:
            return None
        charts[index] = (left, bottom, across, up)
        left, top = left + across + GAP, max(top, bottom + up)
    return charts


def _hills(side: int, resolution: int) -> Mesh:
    """Return the floor as side x side quads; its chart is the upper half of the lightmap."""
    ticks = np.linspace(0, 1, side + 1)
    x, y = np.meshgrid(ticks, ticks)
    height = 0.1 * (np.sin(9 * x) * np.cos(7 * y) + 0.2 * np.sin(61 * x + 53 * y)) * (side > 1)
    height *= 16 * x * (1 - x) * y * (1 - y)
    points = np.stack([ROOM * x, ROOM * y, height + 0.05 * (side > 1) * 4 * x * (1 - x)], axis=-1)
    first = (resolution + 1) // 2 + GAP
    uvs = np.stack([x * resolution, first + y * (resolution - first)], axis=-1) / resolution
    corner = np.array([[[0, 0], [0, 1], [1, 1]], [[0, 0], [1, 1], [1, 0]]])
    row, column = np.divmod(np.arange(side * side), side)
    i = row[:, None, None] + corner[None, ..., 0]
    j = column[:, None, None] + corner[None, ..., 1]
    positions = points[i, j].reshape(-1, 3, 3)
    normal = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    count = side * side
    return Mesh(
        name="Hills",
        positions=positions.astype(np.float32),
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        uvs=uvs[i, j].reshape(-1, 3, 2).astype(np.float32),
        face=np.repeat(np.arange(count, dtype=np.int32), 2),
        subface=np.tile(np.array([0, 1], np.int32), count),
        material=np.full(2 * count, _WHITE, np.int32),
    )


def _materials(radiance: float) -> tuple:
    white, red, green = (0.73, 0.73, 0.73), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)
    light = (radiance, 0.85 * radiance, 0.65 * radiance)
    return (
        material("White", white),
        material("Red", red),
        material("Green", green),
        material("Light", white, light),
    )


def _lamps(count: int) -> list[Light]:
    """Return point lamps of 10 W/sr in all, in a square grid 0.2 m below the ceiling."""
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    positions = np.stack([(column + 0.5) / side, (row + 0.5) / side, np.full(count, 0.9)], axis=1) * ROOM
    lamp = Light("Lamp", "point", np.zeros(3), np.eye(3), np.full(3, 10 / count, np.float32), radius=0.02)
    return [
        replace(lamp, name=f"Lamp {index}", position=position) for index, position in enumerate(positions)
    ]
