"""A game level: the courtyard of a temple with arcades, built from few meshes that many objects share."""

from __future__ import annotations

import math

import bpy
import numpy as np

from . import shapes
from .shapes import block, lathe, material, place, quad

#: Half the width of the courtyard between its columns, width of the arcade, and height of the columns.
HALF, ARCADE, HEIGHT = 7.0, 3.0, 3.2

#: Distance of the columns.
STEP = 2.0


def build() -> None:
    """Add the courtyard, its lights and its camera to the current scene."""
    _materials()
    _ground()
    _arcades()
    _fountain()
    _props()
    _plants()
    _torches()
    shapes.sun((0.62, 0.42, -0.72), 4.0, (1.0, 0.84, 0.64), 1.0)
    shapes.sky((0.45, 0.65, 1.0), 0.4)
    shapes.camera((-6.6, -6.7, 2.3), (1.6, 2.4, 1.55), 19)


def _materials() -> None:
    grain = shapes.noise(4, 512, 6)[..., None]
    material("Stone", image=shapes.painted("Stone", (1 + 0.3 * grain) * np.array((0.5, 0.42, 0.32))))
    material("Wall", image=shapes.painted("Bricks", _bricks((0.56, 0.4, 0.27), 8, 4, 9)))
    material("Paving", image=shapes.painted("Paving", _bricks((0.46, 0.4, 0.33), 6, 6, 3)))
    material("Roof", image=shapes.painted("Roof Tiles", _bricks((0.5, 0.16, 0.08), 10, 10, 5)))
    material("Crate", image=shapes.painted("Boards", _bricks((0.38, 0.22, 0.1), 5, 1, 8)))
    material("Iron", (0.12, 0.12, 0.13))


def _ground() -> None:
    outer = HALF + ARCADE
    quad("Courtyard", material("Paving"), _square(HALF, 0.0), uv=2.4)
    stone = material("Stone")
    for side in range(4):
        turn = 90 * side
        block(
            "Arcade Floor",
            stone,
            (2 * outer if side % 2 else 2 * HALF, ARCADE, 0.18),
            _turned(0, HALF + ARCADE / 2, turn),
            (0, 0, turn),
            uv=2,
        )
        block("Step", stone, (2 * HALF, 0.35, 0.09), _turned(0, HALF - 0.175, turn), (0, 0, turn), uv=2)


def _square(half: float, z: float) -> list[tuple[float, float, float]]:
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def _turned(x: float, y: float, turn: float, z: float = 0.0) -> tuple[float, float, float]:
    a = math.radians(turn)
    return (x * math.cos(a) - y * math.sin(a), x * math.sin(a) + y * math.cos(a), z)


def _arcades() -> None:
    """Add columns, arches, walls and roofs; all columns share one mesh, and so do all arches."""
    column, arch = _column_mesh(), _arch_mesh()
    outer, count = HALF + ARCADE, round(2 * HALF / STEP)
    for side in range(4):
        turn = 90 * side
        for i in range(count):
            along = -HALF + i * STEP
            place("Column", column, _turned(along, HALF + 0.25, turn, 0.18), (0, 0, turn))
            place("Arch", arch, _turned(along + STEP / 2, HALF + 0.25, turn, 0.18 + HEIGHT), (0, 0, turn))
        block(
            "Wall",
            material("Wall"),
            (2 * outer + 0.4, 0.4, 5.4),
            _turned(0, outer + 0.2, turn),
            (0, 0, turn),
            uv=2.4,
        )
        _roof(turn)


def _column_mesh() -> bpy.types.Mesh:
    profile = [
        (0.3, 0),
        (0.3, 0.12),
        (0.24, 0.2),
        (0.25, 0.26),
        (0.2, 0.34),
        (0.17, 2.75),
        (0.2, 2.8),
        (0.19, 2.86),
        (0.27, 3.0),
        (0.3, 3.02),
        (0.3, HEIGHT),
    ]
    source = lathe("Column", material("Stone"), profile, (0, 0, 0), segments=16)
    return _detached(source)


def _arch_mesh() -> bpy.types.Mesh:
    """Return a wall of width STEP above a half circle, open at the bottom."""
    radius, top, depth, segments = STEP / 2 - 0.28, 1.25, 0.46, 10
    angles = [math.pi * i / segments for i in range(segments + 1)]
    curve = [(radius * math.cos(a), radius * math.sin(a) * 1.05) for a in angles]
    edge = [
        (
            STEP / 2
            if math.cos(a) > 0.7
            else -STEP / 2
            if math.cos(a) < -0.7
            else STEP / 2 * math.cos(a) / 0.7,
            top if abs(math.cos(a)) <= 0.7 else top * math.sin(a) / math.sin(math.acos(0.7)),
        )
        for a in angles
    ]
    n, vertices, faces = segments + 1, [], []
    for y in (-depth / 2, depth / 2):
        vertices += [(x, y, z) for x, z in curve] + [(x, y, z) for x, z in edge]
    for i in range(segments):
        faces.append((i, i + n, i + n + 1, i + 1))
        faces.append((2 * n + i, 2 * n + i + 1, 3 * n + i + 1, 3 * n + i))
        faces.append((i, i + 1, 2 * n + i + 1, 2 * n + i))
    faces += [(0, 2 * n, 3 * n, n), (n - 1, 2 * n - 1, 4 * n - 1, 3 * n - 1)]
    return _detached(shapes.add("Arch", material("Stone"), vertices, faces, uv=2))


def _detached(source: bpy.types.Object) -> bpy.types.Mesh:
    """Return the mesh of an object that is removed."""
    mesh = source.data
    bpy.data.objects.remove(source)
    return mesh


def _roof(turn: float) -> None:
    """Add the roof of one side, which falls toward the courtyard, and its ceiling."""
    low, high, outer, inner = HEIGHT + 0.18 + 1.25, HEIGHT + 0.18 + 2.2, HALF + ARCADE, HALF - 0.2
    top = [
        _turned(x, y, turn, z)
        for x, y, z in (
            (inner, inner, low),
            (-inner, inner, low),
            (-outer, outer, high),
            (outer, outer, high),
        )
    ]
    bottom = [(x, y, z - 0.12) for x, y, z in top]
    faces = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4)]
    shapes.add("Roof", material("Roof"), [*top, *bottom], faces, uv=2)


def _fountain() -> None:
    stone, water = material("Stone"), material("Water", (0.05, 0.2, 0.22))
    rim = [(1.55, 0), (1.6, 0.5), (1.66, 0.55), (1.66, 0.62), (1.35, 0.62), (1.35, 0.35)]
    lathe("Basin", stone, rim, (0, 0, 0), segments=32)
    lathe("Water", water, [(1.36, 0.42), (0, 0.42)], (0, 0, 0), segments=32)
    lathe(
        "Fountain",
        stone,
        [
            (0.28, 0.3),
            (0.16, 0.5),
            (0.12, 1.2),
            (0.55, 1.4),
            (0.6, 1.5),
            (0.5, 1.48),
            (0.1, 1.42),
            (0.08, 1.8),
            (0, 1.85),
        ],
        (0, 0, 0),
    )


def _props() -> None:
    """Add crates, barrels, pots and benches, of one mesh each."""
    random = np.random.default_rng(21)
    crate = _detached(block("Crate", material("Crate"), (0.8, 0.8, 0.8), (0, 0, 0), bevel=0.02, uv=0.8))
    for x, y, z, turn in (
        (-5.9, -3.2, 0, 8),
        (-5.0, -3.5, 0, -14),
        (-5.5, -3.3, 0.8, 30),
        (-6.0, -2.2, 0, -4),
        (4.9, 5.8, 0, 20),
        (5.8, 5.6, 0, -9),
        (5.3, 5.7, 0.8, 3),
        (-8.6, 3.0, 0.18, 5),
        (-8.7, 4.1, 0.18, -20),
        (8.7, -2.2, 0.18, 10),
        (8.6, -1.2, 0.18, 45),
        (-1.5, 8.7, 0.18, 12),
    ):
        place("Crate", crate, (x, y, z), (0, 0, turn))
    profile = [
        (0, 0),
        (0.26, 0),
        (0.33, 0.25),
        (0.35, 0.45),
        (0.33, 0.65),
        (0.26, 0.9),
        (0.24, 0.88),
        (0, 0.86),
    ]
    barrel = _detached(
        lathe("Barrel", material("Barrel", (0.3, 0.17, 0.08)), profile, (0, 0, 0), segments=16)
    )
    for x, y, z in (
        (-4.2, -4.3, 0),
        (-4.9, -4.5, 0),
        (-4.4, -5.1, 0),
        (3.9, 5.5, 0),
        (8.5, 2.5, 0.18),
        (8.6, 3.3, 0.18),
        (-8.5, -1.5, 0.18),
        (2.6, 8.6, 0.18),
        (3.4, 8.7, 0.18),
    ):
        place("Barrel", barrel, (x, y, z), (0, 0, random.uniform(0, 90)))
    profile = [
        (0, 0),
        (0.2, 0),
        (0.36, 0.3),
        (0.34, 0.55),
        (0.18, 0.72),
        (0.22, 0.8),
        (0.16, 0.8),
        (0.15, 0.7),
    ]
    amphora = _detached(
        lathe("Amphora", material("Clay", (0.55, 0.24, 0.12)), profile, (0, 0, 0), segments=16)
    )
    for i in range(40):
        size, (side, row) = random.uniform(0.7, 1.0), divmod(i, 10)
        place("Amphora", amphora, _turned(-6.0 + 1.33 * row, 9.4, 90 * side, 0.18), scale=(size, size, size))
    bench = _detached(block("Bench", material("Stone"), (1.8, 0.5, 0.12), (0, 0, 0), bevel=0.02))
    foot = _detached(block("Bench Foot", material("Stone"), (0.16, 0.4, 0.36), (0, 0, 0)))
    for side in range(4):
        x, y, _ = _turned(0, 3.6, 90 * side)
        place("Bench", bench, (x, y, 0.36), (0, 0, 90 * side))
        for end in (-0.6, 0.6):
            place("Bench Foot", foot, _turned(end, 3.6, 90 * side), (0, 0, 90 * side))


def _plants() -> None:
    """Add four planters with small trees."""
    planter = _detached(block("Planter", material("Wall"), (1.3, 1.3, 0.6), (0, 0, 0), bevel=0.03, uv=1.2))
    soil = _detached(quad("Soil", material("Soil", (0.1, 0.06, 0.04)), _square(0.56, 0.605)))
    trunk = _detached(
        lathe(
            "Trunk",
            material("Bark", (0.2, 0.13, 0.08)),
            [(0.11, 0.6), (0.07, 1.2), (0.05, 2.3)],
            (0, 0, 0),
            segments=8,
        )
    )
    crown = _crown_mesh()
    for x, y in ((-4.6, 4.6), (4.6, -4.6), (-4.6, -1.0), (4.6, 1.0)):
        for name, mesh in (("Planter", planter), ("Soil", soil), ("Trunk", trunk), ("Crown", crown)):
            place(name, mesh, (x, y, 0), (0, 0, 40 * x))


def _crown_mesh() -> bpy.types.Mesh:
    """Return 260 leaves on a sphere around the top of a trunk."""
    random, vertices, faces = np.random.default_rng(6), [], []
    for _ in range(260):
        out = random.normal(size=3)
        out /= np.linalg.norm(out)
        middle = np.array((0, 0, 2.35)) + out * random.uniform(0.45, 0.95)
        side = np.cross(out, random.normal(size=3))
        side /= np.linalg.norm(side)
        up = np.cross(out, side) + 0.5 * out
        first = len(vertices)
        vertices += [
            tuple(middle + 0.09 * side),
            tuple(middle + 0.3 * up),
            tuple(middle - 0.09 * side),
            tuple(middle - 0.06 * up),
        ]
        faces.append((first, first + 1, first + 2, first + 3))
    return _detached(shapes.add("Crown", shapes.cloth("Leaf", (0.14, 0.3, 0.05), 0.4), vertices, faces))


def _torches() -> None:
    """Add torches with lamps at the walls of the arcades."""
    iron, flame = material("Iron"), shapes.lamp_material("Flame", (1.0, 0.45, 0.12), 13.0)
    holder = _detached(
        lathe("Torch", iron, [(0, 0), (0.03, 0.05), (0.07, 0.35), (0.06, 0.35)], (0, 0, 0), segments=10)
    )
    fire = _detached(lathe("Flame", flame, [(0.05, 0.35), (0.07, 0.43), (0, 0.62)], (0, 0, 0), segments=8))
    outer = HALF + ARCADE
    for side in range(4):
        for along in (-5, 0, 5):
            at = _turned(along, outer - 0.12, 90 * side, 1.9)
            place("Torch", holder, at)
            place("Flame", fire, at)


def _bricks(color: tuple[float, float, float], rows: int, columns: int, seed: int) -> np.ndarray:
    """Return courses of bricks with joints, (512, 512, 3); the image repeats."""
    size, random = 512, np.random.default_rng(seed)
    v, u = np.mgrid[0:size, 0:size] / size
    row = (v * rows).astype(int)
    along = (u + 0.5 / columns * (row % 2)) % 1 * columns
    tint = random.uniform(0.75, 1.15, (rows, columns))[row, along.astype(int)]
    width = 0.03
    joint = (v * rows % 1 < width) | (along % 1 < width * columns / rows)
    shade = np.where(joint, 0.55, tint * (1 + 0.25 * shapes.noise(seed, size, 6)))
    return shade[..., None] * np.array(color)


if __name__ == "__main__":
    build()
