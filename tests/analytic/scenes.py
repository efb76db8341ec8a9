"""Scenes whose radiosity is known, built without Blender; charts end on texel borders, 2 texels apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine import Material, Mesh, Scene

#: Texels between two charts.
GAP = 2

#: A chart in texels: x and y of its lower left corner, width, height.
Chart = tuple[int, int, int, int]


def quads(
    corners: np.ndarray,
    charts: Sequence[Chart],
    materials: Sequence[int],
    resolution: int,
    name: str = "Quads",
) -> Mesh:
    """Return a mesh of flat-shaded quads, each with a chart of its own.

    corners:     (q, 4, 3) float, counter-clockwise from the front; the first two span the chart's x
    charts:      q rectangles in texels
    materials:   q indices into the scene's materials
    resolution:  width and height of the lightmap, texels
    """
    uvs = np.array([_chart_corners(chart) for chart in charts], np.float32) / resolution
    split = np.array([[0, 1, 2], [0, 2, 3]])
    positions = np.asarray(corners, np.float32)[:, split].reshape(-1, 3, 3)
    normal = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Mesh(
        name=name,
        positions=positions,
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        uvs=uvs[:, split].reshape(-1, 3, 2),
        face=np.repeat(np.arange(len(corners), dtype=np.int32), 2),
        subface=np.tile(np.array([0, 1], np.int32), len(corners)),
        material=np.repeat(np.asarray(materials, np.int32), 2),
    )


#: A grey, or an RGB triple.
Colour = float | Sequence[float]


def material(name: str, reflectance: Colour, emission: Colour = 0.0) -> Material:
    """Return a material; one number stands for grey."""
    grey = np.ones(3, np.float32)
    return Material(name, np.asarray(reflectance, np.float32) * grey, np.asarray(emission, np.float32) * grey)


def rectangle(corner: Sequence[float], edge_u: Sequence[float], edge_v: Sequence[float]) -> np.ndarray:
    """Return the corners of a rectangle whose front is on the side of edge_u x edge_v, (4, 3) float64."""
    p, u, v = (np.asarray(values, float) for values in (corner, edge_u, edge_v))
    return np.stack([p, p + u, p + u + v, p + v])


def room_walls(width: float, depth: float, height: float) -> np.ndarray:
    """Return floor, ceiling, left, right, front and back wall of a box from the origin, facing inwards.

    Shape (6, 4, 3) float64, metres. Each wall's u axis is horizontal.
    """
    x, y, z = np.diag([width, depth, height])
    return np.stack(
        [
            rectangle((0, 0, 0), x, y),
            rectangle(x + z, -x, y),
            rectangle((0, 0, 0), y, z),
            rectangle(x + y, -y, z),
            rectangle(x, -x, z),
            rectangle(y, x, z),
        ]
    )


def furnace(reflectance: float, emission: float, side: int = 8) -> Scene:
    """Return a closed unit cube of one material, `side` x `side` texels a wall, in a 32-texel lightmap."""
    charts = _grid([(side, side)] * 6, columns=3)
    mesh = quads(room_walls(1, 1, 1), charts, [0] * 6, 32, "Furnace")
    return Scene((mesh,), (material("Furnace", reflectance, emission),))


def facing_squares(perpendicular: bool, side: int = 16) -> Scene:
    """Return a black unit square (face 0, the floor) and one of radiance 1 (face 1) in a 64-texel lightmap.

    They are parallel at distance 1, or perpendicular with a common edge: the area mean of E/pi on the
    floor is the form factor.
    """
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    ceiling = rectangle((1, 0, 1), (-1, 0, 0), (0, 1, 0))
    wall = rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1))
    corners = np.stack([floor, wall if perpendicular else ceiling])
    mesh = quads(corners, _grid([(side, side)] * 2, columns=2), [0, 1], 64, "Squares")
    return Scene((mesh,), (material("Receiver", 0.0), material("Emitter", 0.0, 1.0)))


def sphere(cells: int = 8, seed: int = 1) -> Scene:
    """Return a unit sphere seen from inside, of random emission and reflectance, in a 64-texel lightmap.

    Six charts of cells x cells quads, each quad 2 x 2 texels with a material of its own. Flat normals:
    the facets close the view, tilted smooth normals would look past the horizon.
    """
    random = np.random.default_rng(seed)
    angle = np.tan(np.linspace(-np.pi / 4, np.pi / 4, cells + 1))
    corners, charts = [], []
    for (x, y, *_), axes in zip(_grid([(2 * cells, 2 * cells)] * 6, columns=3), _cube_axes(), strict=True):
        for row in range(cells):
            for column in range(cells):
                charts.append((x + 2 * column, y + 2 * row, 2, 2))
                square = [(column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1)]
                corners.append([np.array([angle[i], angle[j], -1.0]) @ axes for i, j in square])
    points = np.array(corners)
    points /= np.linalg.norm(points, axis=2, keepdims=True)
    mesh = quads(points, charts, range(len(charts)), 64, "Sphere")
    reflectances = random.uniform(0.1, 0.9, (len(charts), 3))
    emissions = random.uniform(0, 2, (len(charts), 3))
    tints = enumerate(zip(reflectances, emissions, strict=True))
    return Scene((mesh,), tuple(material(f"Facet {i}", rho, e) for i, (rho, e) in tints))


def light_room() -> Scene:
    """Return a unit-cube room with a small bright light, the hard case, in a 64-texel lightmap.

    Black walls of constant radiance 0.15 ... 0.7 (faces 0-4: floor, left, right, front, back; faces
    5-12: the ceiling) round a ceiling light of 0.24 x 0.24 m and radiance 20 (face 13).
    """
    walls, cuts, texels = room_walls(1, 1, 1), (0.0, 0.38, 0.62, 1.0), (6, 4, 6)
    ceiling, sizes = [], []
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2), (1, 1)):
        edges = (cuts[i] - cuts[i + 1], 0, 0), (0, cuts[j + 1] - cuts[j], 0)
        ceiling.append(rectangle((cuts[i + 1], cuts[j], 1), *edges))
        sizes.append((texels[i], texels[j]))
    charts = _grid([(16, 16)] * 5, columns=3) + _grid(sizes, columns=7, bottom=2 * (16 + GAP))
    mesh = quads(np.stack([walls[0], *walls[2:], *ceiling]), charts, [0, 1, 2, 3, 4, *[5] * 8, 6], 64, "Room")
    radiances = (0.7, 0.15, 0.55, 0.7, 0.7, 0.7, 20.0)
    names = ("Floor", "Left", "Right", "Front", "Back", "Ceiling", "Light")
    return Scene((mesh,), tuple(material(name, 0.0, e) for name, e in zip(names, radiances, strict=True)))


def nine_quad_room() -> Scene:
    """Return the paper's kind of scene: nine quads, 10,700 patches in a 128-texel lightmap.

    A closed room of 4.1 x 4.1 x 3.6 m (floor, ceiling, left red, right green, front, back), two panels
    that stand free on the floor at an angle to the walls, and a light that hangs 0.3 m below the
    ceiling. A texel is 0.1 m wide everywhere.
    """
    pieces = [
        *room_walls(4.1, 4.1, 3.6),
        _panel((0.5, 0.6), 3.2, 2.0, np.radians(75)),
        _panel((3.6, 3.5), 3.2, 2.0, np.radians(250)),
        rectangle((2.75, 1.5, 3.3), (-1.4, 0, 0), (0, 1.1, 0)),
    ]
    sizes = [(41, 41)] * 2 + [(41, 36)] * 4 + [(32, 20)] * 2 + [(14, 11)]
    mesh = quads(np.stack(pieces), _grid(sizes, columns=3), [0, 0, 1, 2, 0, 0, 3, 4, 5], 128, "Room")
    materials = (
        material("White", (0.725, 0.71, 0.68)),
        material("Red", (0.63, 0.065, 0.05)),
        material("Green", (0.14, 0.45, 0.091)),
        material("Blue panel", (0.2, 0.3, 0.7)),
        material("Yellow panel", (0.7, 0.6, 0.2)),
        material("Light", 0.0, (17.0, 12.0, 4.0)),
    )
    return Scene((mesh,), materials)


def _panel(foot: Sequence[float], width: float, height: float, angle: float) -> np.ndarray:
    """Return an upright rectangle whose lower edge starts at `foot` and runs at `angle` to the x axis."""
    along = width * np.array([np.cos(angle), np.sin(angle), 0])
    return rectangle((*foot, 0), along, (0, 0, height))


def _cube_axes() -> list[np.ndarray]:
    """Return rows u, v, n of the six faces of a cube, u x v = n; the face lies at -n, its front towards n."""
    turns = [np.roll(np.eye(3), k, axis=0) for k in range(3)]
    return turns + [np.stack([turn[1], turn[0], -turn[2]]) for turn in turns]


def _chart_corners(chart: Chart) -> list[tuple[int, int]]:
    """Return the corners of a chart in the order of a quad's corners, texels."""
    x, y, width, height = chart
    return [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]


def _grid(sizes: Sequence[tuple[int, int]], columns: int, bottom: int = 0) -> list[Chart]:
    """Lay charts out row by row from the bottom up, GAP texels apart."""
    charts: list[Chart] = []
    for first in range(0, len(sizes), columns):
        row, left = sizes[first : first + columns], 0
        for width, height in row:
            charts.append((left, bottom, width, height))
            left += width + GAP
        bottom += max(height for _, height in row) + GAP
    return charts
