"""A living room in daylight: the sun shines through glass and a curtain, and a sky lights the rest.

A toy robot is a dynamic object: light probes light it, in the sun beside the window or in the shade.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix

from . import shapes
from .shapes import block, cushion, lathe, material, place, quad, sheet

#: Half the width, half the depth, and the height of the room.
X, Y, Z = 2.7, 2.2, 2.7

#: Window in the wall x = -X: range along y, and along z, and depth of its reveal.
WINDOW_Y, WINDOW_Z, REVEAL = (-1.0, 1.2), (0.45, 2.35), 0.25

#: The robot, and its places in the sun and in the shade.
ROBOT, SUN, SHADE = "Robot", (-1.35, 0.35, 0.0), (0.85, -0.45, 0.0)


def build() -> None:
    """Add the room, its lights and its camera to the current scene."""
    _room()
    _window()
    _sofa((-0.4, 1.62, 0.0))
    _armchair((-1.55, -1.3, 0.0), 125)
    _table((-0.4, 0.15, 0.0))
    _shelf((1.9, 2.03, 0.0))
    _plant((-2.2, 1.75, 0.0))
    _lamp((0.95, 1.85, 0.0))
    _pictures((-1.2, -0.4, 0.4))
    _robot()
    _probes()
    shapes.sun((0.74, 0.24, -0.62), 5.6, (1.0, 0.86, 0.7))
    shapes.sky((0.55, 0.75, 1.0), 1.2)
    shapes.camera((2.3, -1.95, 1.4), (-0.75, 1.0, 0.95), 18)


def _room() -> None:
    wall, white = material("Wall", (0.72, 0.69, 0.64)), material("White", (0.82, 0.81, 0.78))
    accent = material("Accent Wall", (0.23, 0.31, 0.28))
    wood = material("Floor", (0.36, 0.22, 0.12), image=shapes.painted("Planks", _planks()))
    quad("Floor", wood, [(-X, -Y, 0), (X, -Y, 0), (X, Y, 0), (-X, Y, 0)], uv=2.0)
    quad("Ceiling", white, [(-X, -Y, Z), (-X, Y, Z), (X, Y, Z), (X, -Y, Z)])
    quad("Back Wall", accent, [(-X, Y, 0), (X, Y, 0), (X, Y, Z), (-X, Y, Z)])
    quad("Right Wall", wall, [(X, Y, 0), (X, -Y, 0), (X, -Y, Z), (X, Y, Z)])
    quad("Front Wall", wall, [(X, -Y, 0), (-X, -Y, 0), (-X, -Y, Z), (X, -Y, Z)])
    inner_x, inner_y = X - 0.01, Y - 0.01
    skirting = (
        (0, inner_y, 0, 2 * X),
        (0, -inner_y, 180, 2 * X),
        (inner_x, 0, 90, 2 * Y),
        (-inner_x, 0, -90, 2 * Y),
    )
    for number, (x, y, turn, length) in enumerate(skirting):
        block(f"Skirting {number + 1}", white, (length, 0.02, 0.09), (x, y, 0), (0, 0, turn))


def _window() -> None:
    """Add the wall with the window, its frame, its panes and its curtain."""
    wall, white = material("Wall"), material("White")
    (y0, y1), (z0, z1) = WINDOW_Y, WINDOW_Z
    ys, zs = (-Y, y0, y1, Y), (0, z0, z1, Z)
    cells = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    vertices = [(-X, y, z) for z in zs for y in ys]
    faces = [(4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4, 4 * j + i)[::-1] for i, j in cells]
    shapes.add("Window Wall", wall, vertices, [face[::-1] for face in faces])
    outline = [(y0, z0), (y1, z0), (y1, z1), (y0, z1)]
    vertices = [(x, y, z) for x in (-X, -X - REVEAL) for y, z in outline]
    shapes.add("Reveal", white, vertices, [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4)[::-1] for i in range(4)])
    block("Sill", white, (0.2, y1 - y0 + 0.1, 0.03), (-X + 0.06, (y0 + y1) / 2, z0 - 0.03), bevel=0.006)
    outer = -X - REVEAL + 0.04
    for y in (y0 + 0.03, (y0 + y1) / 2, y1 - 0.03):
        block("Frame", white, (0.06, 0.06, z1 - z0), (outer, y, z0))
    for z in (z0, z1 - 0.06, z0 + 1.25):
        block("Frame", white, (0.05, y1 - y0, 0.06), (outer, (y0 + y1) / 2, z))
    block("Pane", shapes.glass("Glass"), (0.008, y1 - y0, z1 - z0), (outer, (y0 + y1) / 2, z0))
    curtain = shapes.cloth("Curtain", (0.78, 0.72, 0.62), 0.5)
    for name, start, width in (("Curtain Left", y0 - 0.3, 0.75), ("Curtain Right", y1 - 0.15, 0.45)):
        sheet(name, curtain, _folds(start, width), 72, 6)
    rod = lathe("Curtain Rod", material("Brass", (0.45, 0.33, 0.16)), [(0.012, 0), (0.012, 3.0)], (0, 0, 0))
    rod.location, rod.rotation_euler = (-X + 0.12, -1.4, 2.5), (math.radians(-90), 0, 0)


def _folds(start: float, width: float):
    """Return the shape of a curtain that hangs beside the wall from the rod to the floor."""

    def point(u: float, v: float) -> tuple[float, float, float]:
        depth = 0.045 * math.sin(2 * math.pi * 9 * width * u) * (1.15 - 0.3 * v)
        return (-X + 0.12 + depth, start + width * u + 0.02 * math.sin(7 * u + 3 * v), 0.03 + 2.47 * v)

    return point


def _sofa(at: tuple[float, float, float]) -> None:
    x, y, z = at
    fabric, legs = material("Sofa", (0.42, 0.45, 0.48)), material("Dark Wood", (0.12, 0.07, 0.04))
    block("Sofa Base", fabric, (2.3, 0.92, 0.2), (x, y, z + 0.13), bevel=0.03)
    for side in (-1, 1):
        block("Sofa Arm", fabric, (0.2, 0.92, 0.5), (x + side * 1.05, y, z + 0.13), bevel=0.05)
        cushion("Sofa Seat", fabric, (0.94, 0.8, 0.24), (x + side * 0.47, y - 0.06, z + 0.42), power=5)
        cushion("Sofa Back", fabric, (0.94, 0.26, 0.56), (x + side * 0.47, y + 0.3, z + 0.72), (-12, 0, 0), 4)
    block("Sofa Rear", fabric, (2.3, 0.16, 0.72), (x, y + 0.42, z + 0.13), bevel=0.05)
    for side, front in ((-1, -1), (1, -1), (-1, 1), (1, 1)):
        lathe(
            "Sofa Leg", legs, [(0.02, 0), (0.03, 0.14)], (x + side * 1.05, y + front * 0.38, z), segments=12
        )
    mustard, rust = material("Mustard", (0.68, 0.38, 0.06)), material("Rust", (0.5, 0.14, 0.07))
    cushion("Cushion", mustard, (0.46, 0.17, 0.46), (x - 0.78, y + 0.08, z + 0.74), (-18, 8, 12), 3)
    cushion("Cushion", rust, (0.42, 0.16, 0.42), (x + 0.72, y + 0.06, z + 0.72), (-20, -6, -16), 3)


def _armchair(at: tuple[float, float, float], turn: float) -> None:
    fabric, legs = material("Armchair", (0.16, 0.26, 0.3)), material("Dark Wood")
    parts = [
        block("Armchair Base", fabric, (0.78, 0.74, 0.16), (0, 0, 0.2), bevel=0.03),
        cushion("Armchair Seat", fabric, (0.6, 0.66, 0.22), (0, -0.03, 0.44), power=4.5),
        cushion("Armchair Back", fabric, (0.62, 0.22, 0.6), (0, 0.29, 0.74), (-14, 0, 0), 4),
        block("Armchair Left", fabric, (0.12, 0.74, 0.4), (-0.37, 0, 0.2), bevel=0.04),
        block("Armchair Right", fabric, (0.12, 0.74, 0.4), (0.37, 0, 0.2), bevel=0.04),
    ]
    for x, y in ((-0.3, -0.28), (0.3, -0.28), (-0.3, 0.28), (0.3, 0.28)):
        parts.append(lathe("Armchair Leg", legs, [(0.018, 0), (0.025, 0.2)], (x, y, 0), segments=12))
    holder = place("Armchair", None, at, (0, 0, turn))
    for part in parts:
        part.parent = holder


def _table(at: tuple[float, float, float]) -> None:
    x, y, z = at
    oak = material("Oak", image=shapes.painted("Oak Grain", _grain((0.5, 0.33, 0.18), 3)))
    rug = material("Rug", image=shapes.painted("Rug", _rug()))
    sheet("Rug", rug, lambda u, v: (x + 2.6 * (u - 0.5), y + 1.8 * (v - 0.5), z + 0.012), 1, 1)
    uvs = bpy.data.objects["Rug"].data.uv_layers[0].uv
    for loop, corner in zip(uvs, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        loop.vector = corner
    block("Table Top", oak, (1.15, 0.6, 0.035), (x, y, z + 0.4), bevel=0.008)
    block("Table Shelf", oak, (1.0, 0.48, 0.02), (x, y, z + 0.16))
    for side, front in ((-1, -1), (1, -1), (-1, 1), (1, 1)):
        block("Table Leg", oak, (0.045, 0.045, 0.388), (x + side * 0.5, y + front * 0.23, z + 0.012))
    vase = [(0.0, 0), (0.055, 0.0), (0.085, 0.06), (0.08, 0.13), (0.04, 0.2), (0.035, 0.25), (0.045, 0.27)]
    lathe("Vase", material("Ceramic", (0.75, 0.73, 0.7)), vase, (x - 0.3, y + 0.08, z + 0.435))
    bowl = [
        (0, 0.01),
        (0.05, 0),
        (0.06, 0),
        (0.13, 0.05),
        (0.15, 0.09),
        (0.142, 0.09),
        (0.12, 0.055),
        (0, 0.015),
    ]
    lathe("Bowl", material("Blue Glaze", (0.06, 0.13, 0.3)), bowl, (x + 0.28, y - 0.05, z + 0.435))
    for i, (dx, dy) in enumerate(((0.0, 0.0), (0.065, 0.035), (-0.05, 0.05))):
        fruit = material("Orange" if i else "Apple", (0.75, 0.28, 0.03) if i else (0.5, 0.06, 0.04))
        cushion("Fruit", fruit, (0.085, 0.085, 0.08), (x + 0.28 + dx, y - 0.05 + dy, z + 0.505), power=2)
    for i, (color, width) in enumerate(
        (((0.5, 0.48, 0.42), 0.26), ((0.1, 0.2, 0.25), 0.23), ((0.6, 0.2, 0.1), 0.2))
    ):
        book = material(f"Magazine {i + 1}", color)
        block(
            "Magazine",
            book,
            (width, width * 0.75, 0.018),
            (x + 0.05, y, z + 0.18 + 0.0185 * i),
            (0, 0, 9 * i - 6),
        )


def _shelf(at: tuple[float, float, float]) -> None:
    """Add shelves with books on the back wall."""
    x, y, z = at
    oak, random = material("Oak"), np.random.default_rng(5)
    for side in (-1, 1):
        block("Shelf Side", oak, (0.03, 0.32, 2.1), (x + side * 0.65, y, z))
    for level in range(6):
        block("Shelf Board", oak, (1.27, 0.31, 0.025), (x, y, z + 0.02 + level * 0.41))
    colors = [
        (0.55, 0.1, 0.07),
        (0.1, 0.2, 0.34),
        (0.66, 0.58, 0.42),
        (0.12, 0.28, 0.16),
        (0.6, 0.42, 0.1),
        (0.2, 0.2, 0.2),
    ]
    for level in range(5):
        left, end = x - 0.62, x + (0.05, 0.5, -0.1, 0.55, 0.2)[level]
        while left < end:
            width, height = random.uniform(0.022, 0.05), random.uniform(0.2, 0.33)
            index = int(random.integers(len(colors)))
            book = material(f"Book {index + 1}", colors[index])
            block(
                "Book",
                book,
                (width - 0.002, 0.2, height),
                (left + width / 2, y - 0.03, z + 0.046 + level * 0.41),
            )
            left += width
    jar = [(0, 0), (0.07, 0), (0.1, 0.08), (0.09, 0.16), (0.05, 0.21), (0.055, 0.23)]
    lathe("Jar", material("Terracotta", (0.5, 0.2, 0.1)), jar, (x + 0.42, y, z + 0.046 + 0.82))


def _plant(at: tuple[float, float, float]) -> None:
    x, y, z = at
    pot = [(0, 0.02), (0.13, 0), (0.17, 0.3), (0.18, 0.34), (0.16, 0.34), (0.15, 0.3), (0, 0.29)]
    lathe("Pot", material("Terracotta"), pot, at)
    leaf, stem = shapes.cloth("Leaf", (0.08, 0.26, 0.05), 0.4), material("Stem", (0.2, 0.22, 0.06))
    random = np.random.default_rng(11)
    for i in range(15):
        turn, tilt = 137.5 * i, random.uniform(12, 42) + i
        length, width = random.uniform(0.5, 0.8), random.uniform(0.15, 0.22)
        height = 0.25 + 0.5 * (1 - i / 15) * random.uniform(0.8, 1.1)
        lathe("Stalk", stem, [(0.008, 0.0), (0.006, height)], (x, y, z + 0.3), (0, tilt * 0.4, turn), 6)
        tip = np.array([math.sin(math.radians(tilt * 0.4)), 0, math.cos(math.radians(tilt * 0.4))]) * height
        a = math.radians(turn)
        base = (x + tip[0] * math.cos(a), y + tip[0] * math.sin(a), z + 0.3 + tip[2])
        sheet("Leaf", leaf, _blade(length, width, tilt), 6, 10, base, (0, 0, turn))


def _blade(length: float, width: float, tilt: float):
    """Return the shape of a leaf that grows along x and bends down."""

    def point(u: float, v: float) -> tuple[float, float, float]:
        half = width / 2 * math.sin(math.pi * (0.04 + 0.93 * v)) ** 0.8
        across, bend = (2 * u - 1) * half, math.radians(75 - tilt - 85 * v)
        middle = length * v
        return (
            middle * math.cos(math.radians(40)),
            across,
            middle * math.sin(bend) * 0.8 + 0.25 * abs(across),
        )

    return point


def _lamp(at: tuple[float, float, float]) -> None:
    """Add a floor lamp, whose bulb is off."""
    brass = material("Brass", (0.45, 0.33, 0.16))
    lathe("Lamp Foot", brass, [(0, 0), (0.15, 0), (0.15, 0.015), (0.012, 0.03), (0.01, 1.5), (0, 1.5)], at)
    shade = shapes.cloth("Shade", (0.8, 0.72, 0.58), 0.5)
    lathe("Lamp Shade", shade, [(0.22, 1.3), (0.15, 1.62)], at, segments=32)


def _pictures(places: tuple[float, float, float]) -> None:
    """Add three framed pictures on the back wall."""
    frame, board = material("Dark Wood"), material("Passe-partout", (0.8, 0.79, 0.75))
    for number, (x, width, height) in enumerate(zip(places, (0.5, 0.7, 0.5), (0.7, 0.7, 0.7), strict=True)):
        art = material(f"Art {number + 1}", image=shapes.painted(f"Art {number + 1}", _art(number)))
        bottom = 1.75 - height / 2
        block("Picture Frame", frame, (width, 0.03, height), (x, Y - 0.016, bottom))
        block("Mount", board, (width - 0.05, 0.004, height - 0.05), (x, Y - 0.034, bottom + 0.025))
        w, h, y = width / 2 - 0.1, height - 0.2, Y - 0.0385
        picture = quad(
            "Art",
            art,
            [
                (x - w, y, bottom + 0.1),
                (x + w, y, bottom + 0.1),
                (x + w, y, bottom + 0.1 + h),
                (x - w, y, bottom + 0.1 + h),
            ],
        )
        for loop, corner in zip(picture.data.uv_layers[0].uv, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
            loop.vector = corner


def _robot() -> None:
    """Add a toy robot of one mesh with the role Dynamic, if Hemibake is enabled."""
    shell, joint = material("Robot Shell", (0.75, 0.72, 0.66)), material("Robot Joint", (0.1, 0.1, 0.11))
    trim, face = material("Robot Trim", (0.7, 0.2, 0.04)), material("Robot Face", (0.02, 0.03, 0.04))
    parts = [
        cushion("Body", shell, (0.34, 0.28, 0.36), (0, 0, 0.38), power=4),
        cushion("Belt", trim, (0.36, 0.3, 0.07), (0, 0, 0.34), power=4),
        lathe("Neck", joint, [(0.05, 0), (0.05, 0.1)], (0, 0, 0.53)),
        cushion("Head", shell, (0.32, 0.26, 0.24), (0, 0, 0.7), power=5),
        cushion("Visor", face, (0.26, 0.04, 0.13), (0, -0.12, 0.71), power=5),
        lathe("Aerial", joint, [(0.008, 0), (0.008, 0.12)], (0.08, 0.02, 0.8), segments=8),
        cushion("Aerial Tip", trim, (0.05, 0.05, 0.05), (0.08, 0.02, 0.94), power=2),
    ]
    for side in (-1, 1):
        x = side * 0.2
        parts += [
            cushion("Eye", trim, (0.045, 0.03, 0.06), (side * 0.06, -0.135, 0.715), power=2),
            cushion("Shoulder", joint, (0.08, 0.1, 0.1), (x, 0, 0.48), power=2),
            cushion("Arm", shell, (0.08, 0.1, 0.26), (side * 0.23, -0.03, 0.37), (-12, 0, 0), 4),
            lathe(
                "Wheel",
                joint,
                [(0, 0), (0.12, 0), (0.12, 0.09), (0, 0.09)],
                (x * 0.6, 0, 0.12),
                (0, 90 * side, 0),
            ),
            cushion("Hub", trim, (0.03, 0.1, 0.1), (x * 0.6 + side * 0.09, 0, 0.12), power=2),
        ]
    with bpy.context.temp_override(active_object=parts[0], selected_editable_objects=parts):
        bpy.ops.object.join()
    robot = parts[0]
    robot.name = robot.data.name = ROBOT
    centre = robot.location.copy()
    robot.data.transform(Matrix.Translation(centre))
    robot.location, robot.rotation_euler = SUN, (0, 0, math.radians(50))
    if settings := getattr(robot, "hemibake", None):
        settings.role = "DYNAMIC"


def _probes() -> None:
    """Add a Light Probe Volume that fills the room."""
    data = bpy.data.lightprobes.new("Room", "VOLUME")
    data.resolution_x, data.resolution_y, data.resolution_z = 20, 16, 10
    volume = place("Room", data, (0, 0, Z / 2))
    volume.scale = (X, Y, Z / 2)


def _planks() -> np.ndarray:
    """Return boards of four shades with grain along x; the image repeats."""
    size, rows, random = 1024, 14, np.random.default_rng(3)
    grain = shapes.noise(1, size, 6, stretch=16)
    row = np.arange(size) * rows // size
    shift, tint = random.integers(0, size, rows), random.uniform(0.72, 1.12, (rows, 3))
    along = (np.arange(size)[None, :] + shift[row][:, None]) % size
    board = along * 3 // size
    shade = tint[row[:, None], board] * (1 + 0.28 * grain)
    gap = ((np.arange(size) * rows % size) < 20)[:, None] | (along * 3 % size < 8)
    return (shade * np.where(gap, 0.35, 1))[..., None] * np.array((0.40, 0.23, 0.12))


def _grain(color: tuple[float, float, float], seed: int) -> np.ndarray:
    grain = shapes.noise(seed, 512, 5, stretch=12)
    return (1 + 0.25 * grain)[..., None] * np.array(color)


def _rug() -> np.ndarray:
    """Return a rug with a border and rows of diamonds."""
    v, u = np.mgrid[0:512, 0:768] / np.array((512, 768)).reshape(2, 1, 1)
    diamond = (np.abs((u * 9) % 1 - 0.5) + np.abs((v * 6) % 1 - 0.5)) * 2
    pattern = np.select([diamond < 0.35, diamond < 0.55, diamond < 0.8], [0, 1, 2], 3)
    edge = np.minimum(np.minimum(u * 1.5, (1 - u) * 1.5), np.minimum(v, 1 - v))
    pattern = np.where(edge < 0.035, 1, np.where(edge < 0.05, 3, pattern))
    colors = np.array([(0.5, 0.13, 0.06), (0.1, 0.14, 0.2), (0.55, 0.36, 0.14), (0.62, 0.56, 0.46)])
    return colors[pattern] * (1 + 0.15 * np.random.default_rng(2).uniform(-1, 1, (512, 768, 1)))


def _art(number: int) -> np.ndarray:
    """Return an abstract picture: hills below a sun in one of three palettes."""
    palettes = (
        ((0.75, 0.5, 0.3), (0.45, 0.16, 0.08), (0.16, 0.08, 0.1), (0.85, 0.72, 0.4)),
        ((0.6, 0.72, 0.75), (0.12, 0.3, 0.36), (0.04, 0.12, 0.17), (0.9, 0.6, 0.3)),
        ((0.8, 0.74, 0.6), (0.35, 0.4, 0.2), (0.1, 0.16, 0.08), (0.7, 0.22, 0.1)),
    )
    above, middle, below, disc = (np.array(color) for color in palettes[number])
    v, u = np.mgrid[0:256, 0:256] / 256
    picture = np.broadcast_to(above, (256, 256, 3)).copy()
    picture[(u - 0.35 - 0.15 * number) ** 2 + (v - 0.68) ** 2 < 0.02] = disc
    picture[v < 0.5 + 0.09 * np.sin(5 * u + number)] = middle
    picture[v < 0.3 + 0.07 * np.sin(8 * u + 2 + number)] = below
    return picture


if __name__ == "__main__":
    build()
