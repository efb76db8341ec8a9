"""A street at night, with light groups for lamps, windows, signs and moon, and light states that mix them."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix

from . import shapes
from .shapes import block, cushion, lathe, material, place, quad

#: Light groups, and their color and strength in each light state.
GROUPS = ("Moon", "Street Lamps", "Windows", "Signs")
STATES = {
    "Evening": {"Moon": ((1.0, 1.0, 1.0), 3.0)},
    "Night": {"Windows": ((1.0, 1.0, 1.0), 0.25), "Signs": ((0.0, 0.0, 0.0), 1.0)},
    "Power Cut": dict.fromkeys(GROUPS[1:], ((0.0, 0.0, 0.0), 1.0)),
}

#: Half the width of the road and of the street between its houses, and half the length, m.
ROAD, STREET, LENGTH = 2.6, 4.6, 13.0


def build() -> None:
    """Add the street, its lights, light groups, light states and camera to the current scene."""
    for name in GROUPS:
        bpy.context.view_layer.lightgroups.add(name=name)
    _ground()
    _houses()
    _street_lamps()
    _furniture()
    moon = shapes.sun((-0.35, 0.5, -0.78), 0.036, (0.6, 0.75, 1.0), 0.5)
    moon.lightgroup = "Moon"
    shapes.sky((0.16, 0.27, 0.6), 0.014)
    bpy.context.scene.world.lightgroup = "Moon"
    _add_states()
    shapes.camera((1.5, -12.2, 1.75), (-0.6, 0.0, 2.1), 22)


def _add_states() -> None:
    """Add STATES if Hemibake is enabled."""
    settings = getattr(bpy.context.scene, "hemibake", None)
    for name, mix in STATES.items() if settings is not None else ():
        state = settings.light_states.add()
        state.name = name
        for group, (color, strength) in mix.items():
            entry = state.groups.add()
            entry.name, entry.color, entry.strength = group, color, strength


def _ground() -> None:
    cobbles = material("Cobbles", image=shapes.painted("Cobbles", _cobbles()))
    slabs = material("Slabs", image=shapes.painted("Slabs", _slabs()))
    quad(
        "Road",
        cobbles,
        [(-ROAD, -LENGTH, 0), (ROAD, -LENGTH, 0), (ROAD, LENGTH, 0), (-ROAD, LENGTH, 0)],
        uv=2.0,
    )
    width = STREET - ROAD
    for side in (-1, 1):
        block(
            "Pavement",
            slabs,
            (width - 0.15, 2 * LENGTH, 0.14),
            (side * (ROAD + 0.075 + width / 2), 0, 0),
            uv=1.6,
        )
        block(
            "Curb",
            material("Curb", (0.3, 0.3, 0.31)),
            (0.15, 2 * LENGTH, 0.15),
            (side * (ROAD + 0.075), 0, 0),
            bevel=0.02,
        )
    back = material("Night Wall", (0.2, 0.16, 0.14))
    block("End Wall", back, (2 * STREET, 0.3, 8.5), (0, -LENGTH - 0.15, 0))


def _houses() -> None:
    """Add houses on both sides; each has a shop, rows of windows and a roof."""
    plaster = (
        (0.5, 0.36, 0.22),
        (0.42, 0.16, 0.11),
        (0.34, 0.38, 0.4),
        (0.52, 0.47, 0.36),
        (0.24, 0.3, 0.24),
        (0.46, 0.27, 0.2),
    )
    random, number = np.random.default_rng(17), 0
    for side in (-1, 1):
        y = -LENGTH
        for width in (6.0, 5.0, 7.5, 7.5) if side < 0 else (7.5, 6.5, 5.5, 6.5):
            floors = int(random.integers(2, 4))
            wall = material(f"Plaster {number % 6 + 1}", plaster[number % 6])
            _house(number, side, y + width / 2, width, floors, wall, random)
            y, number = y + width, number + 1
    for along in (-STREET / 2, STREET / 2):
        before = set(bpy.data.objects)
        wall = material(f"Plaster {number % 6 + 1}", plaster[number % 6])
        _house(number, 1, along, STREET, 3, wall, random)
        _turn_to_end(set(bpy.data.objects) - before)
        number += 1


def _turn_to_end(objects: set[bpy.types.Object]) -> None:
    """Move a house from the side of the street to its far end."""
    bpy.context.view_layer.update()
    move = Matrix.Rotation(math.pi / 2, 4, "Z") @ Matrix.Translation((LENGTH - STREET, 0, 0))
    for obj in objects:
        obj.matrix_world = move @ obj.matrix_world


def _house(number: int, side: int, y: float, width: float, floors: int, wall, random) -> None:
    turn, x, height = 90 * side, side * STREET, 3.3 + 2.7 * floors
    block("House", wall, (width - 0.02, 0.5, height), (x + side * 0.25, y, 0), (0, 0, turn))
    block(
        "Cornice",
        material("Cornice", (0.45, 0.42, 0.37)),
        (width, 0.35, 0.22),
        (x - side * 0.12, y, height),
        (0, 0, turn),
        bevel=0.03,
    )
    block(
        "Ledge",
        material("Cornice"),
        (width - 0.1, 0.16, 0.12),
        (x - side * 0.08, y, 3.15),
        (0, 0, turn),
        bevel=0.02,
    )
    windows = max(2, round(width / 1.9))
    for floor in range(floors):
        for i in range(windows):
            along = y + (i + 0.5 - windows / 2) * width / windows
            _window(x, along, 3.85 + 2.7 * floor, side, lit=random.uniform() < 0.3, warm=random.uniform())
    _shop(number, side, x, y, width)


def _window(x: float, y: float, z: float, side: int, lit: bool, warm: float) -> None:
    turn, frame = 90 * side, material("Window Frame", (0.55, 0.53, 0.48))
    for dy in (-0.5, 0.5):
        block("Window Frame", frame, (0.08, 0.1, 1.5), (x - side * 0.05, y + dy, z), (0, 0, turn))
    block("Window Frame", frame, (1.08, 0.1, 0.08), (x - side * 0.05, y, z + 1.5), (0, 0, turn))
    block("Window Sill", frame, (1.25, 0.2, 0.07), (x - side * 0.1, y, z - 0.07), (0, 0, turn), bevel=0.01)
    block("Window Bar", frame, (0.04, 0.04, 1.5), (x - side * 0.025, y, z), (0, 0, turn))
    dark = material("Dark Window", (0.02, 0.03, 0.045))
    bright = (
        shapes.lamp_material("Warm Window", (1.0, 0.62, 0.25), 0.9)
        if warm < 0.7
        else shapes.lamp_material("Cold Window", (0.55, 0.75, 1.0), 0.6)
    )
    pane = _facing(side, x - side * 0.012, y, z, 0.92, 1.5, "Window Pane", bright if lit else dark)
    if lit:
        pane.lightgroup = "Windows"


def _facing(side: int, x: float, y: float, z: float, width: float, height: float, name: str, surface):
    """Return an upright rectangle that faces the street."""
    corners = [
        (x, y - width / 2, z),
        (x, y + width / 2, z),
        (x, y + width / 2, z + height),
        (x, y - width / 2, z + height),
    ]
    return quad(name, surface, corners if side < 0 else corners[::-1])


def _shop(number: int, side: int, x: float, y: float, width: float) -> None:
    """Add a door and a shop window, with a sign above and an awning at every second house."""
    turn = 90 * side
    wood = material(
        f"Shop Wood {number % 3 + 1}", ((0.09, 0.16, 0.12), (0.2, 0.05, 0.04), (0.06, 0.08, 0.14))[number % 3]
    )
    block(
        "Door", wood, (1.0, 0.08, 2.3), (x - side * 0.04, y - width / 2 + 0.9, 0.14), (0, 0, turn), bevel=0.01
    )
    size, middle = width - 2.6, y + 0.6
    block("Shop Base", wood, (size + 0.3, 0.2, 0.5), (x - side * 0.1, middle, 0.14), (0, 0, turn), bevel=0.01)
    block(
        "Shop Head", wood, (size + 0.3, 0.25, 0.5), (x - side * 0.125, middle, 2.5), (0, 0, turn), bevel=0.01
    )
    for end in (-1, 1):
        block(
            "Shop Post",
            wood,
            (0.15, 0.2, 1.86),
            (x - side * 0.1, middle + end * (size + 0.15) / 2, 0.64),
            (0, 0, turn),
        )
    lit = number % 3 != 1
    pane = _facing(
        side, x - side * 0.015, middle, 0.64, size, 1.86, "Shop Pane",
        _shop_window(number) if lit else material("Dark Window"),
    )  # fmt: skip
    if lit:
        pane.lightgroup = "Windows"
        mesh = pane.data
        for loop, corner in zip(mesh.loops, mesh.uv_layers[0].uv, strict=True):
            _, y, z = mesh.vertices[loop.vertex_index].co
            corner.vector = (y / 3.72, (z - 0.64) / 1.86)
    if number % 2 == 0:
        _awning(number, side, x, middle, size)
    _sign(number, side, x, y - width / 2 + 1.6)


def _shop_window(number: int) -> bpy.types.Material:
    """Return a material that emits the picture of a shop behind glass, 3.72 m wide and 1.86 m high."""
    name = f"Shop Window {number % 2 + 1}"
    known = bpy.data.images.get(name)
    return shapes.lamp_material(
        name, (1, 1, 1), 0.8, known or shapes.painted(name, _shop_picture(number % 2))
    )


def _shop_picture(seed: int) -> np.ndarray:
    """Return shelves with goods in the light of lamps, (256, 512, 3); the image repeats along x."""
    random = np.random.default_rng(40 + seed)
    v, u = np.mgrid[0:256, 0:512] / np.array((256, 512)).reshape(2, 1, 1)
    spot = 0.55 + 0.45 * np.cos(4 * math.pi * u) ** 2 * np.exp(-((v - 0.95) ** 2) / 0.3)
    picture = spot[..., None] * np.array((1.0, 0.72, 0.4))
    for shelf in range(4):
        bottom, left = 0.06 + 0.23 * shelf, 0.01
        picture[np.abs(v - bottom) < 0.012] *= 0.25
        while left < 0.94:
            width, height = random.uniform(0.015, 0.05), random.uniform(0.06, 0.17)
            tall = np.where(
                np.abs(u - left - width / 2) < width * 0.25, height, height * random.uniform(0.6, 1)
            )
            inside = (u > left) & (u < left + width) & (v > bottom) & (v < bottom + tall)
            picture[inside] *= random.uniform(0.03, 0.5, 3)
            left += width + random.uniform(0.004, 0.03)
    return picture * np.clip(8 * np.minimum(v, 1 - v) + 0.3, 0, 1)[..., None]


def _awning(number: int, side: int, x: float, y: float, size: float) -> None:
    colors = ((0.5, 0.08, 0.06), (0.08, 0.25, 0.2), (0.55, 0.4, 0.12), (0.1, 0.14, 0.3))
    fabric = shapes.cloth(f"Awning {number % 4 + 1}", colors[number // 2 % 4], 0.4)
    out, half = x - side * 1.15, size / 2 + 0.1
    corners = [
        (x - side * 0.25, y - half, 2.95),
        (x - side * 0.25, y + half, 2.95),
        (out, y + half, 2.45),
        (out, y - half, 2.45),
        (out, y + half, 2.25),
        (out, y - half, 2.25),
    ]
    faces = [(0, 1, 2, 3), (3, 2, 4, 5)]
    shapes.add("Awning", fabric, corners, faces if side > 0 else [face[::-1] for face in faces])


def _sign(number: int, side: int, x: float, y: float) -> None:
    """Add a sign of light that stands out from the wall."""
    colors = ((1.0, 0.05, 0.25), (0.05, 0.7, 1.0), (1.0, 0.35, 0.03), (0.2, 1.0, 0.3))
    if number % 2:
        return
    iron = material("Iron", (0.05, 0.05, 0.055))
    block("Sign Arm", iron, (0.05, 0.05, 0.05), (x - side * 0.45, y, 4.95), (0, 0, 0))
    block("Sign Box", iron, (0.75, 0.14, 1.5), (x - side * 0.55, y, 3.45), bevel=0.02)
    glow = shapes.lamp_material(f"Neon {number // 2 % 4 + 1}", colors[number // 2 % 4], 3.6)
    for front in (-1, 1):
        for row in range(3):
            z, yy = 3.6 + 0.43 * row, y + front * 0.085
            tube = block(
                "Neon", glow, (0.5, 0.03, 0.06 + 0.16 * (row % 2)), (x - side * 0.55, yy, z), bevel=0.01
            )
            tube.lightgroup = "Signs"


def _street_lamps() -> None:
    """Add lamps of iron with a lantern; all share three meshes and one light."""
    iron, glow = material("Iron"), shapes.lamp_material("Lantern", (1.0, 0.66, 0.32), 5.6)
    post = [
        (0, 0),
        (0.16, 0),
        (0.16, 0.1),
        (0.09, 0.2),
        (0.07, 0.9),
        (0.045, 1.0),
        (0.04, 3.4),
        (0.07, 3.45),
        (0.12, 3.55),
        (0, 3.56),
    ]
    cap = [(0.2, 3.98), (0.17, 4.02), (0.03, 4.16), (0, 4.2)]
    meshes = []
    for name, surface, profile in (
        ("Lamp Post", iron, post),
        ("Lamp Cap", iron, cap),
        ("Lantern", glow, [(0.07, 3.56), (0.13, 3.75), (0.13, 3.96)]),
    ):
        source = lathe(name, surface, profile, (0, 0, 0), segments=12)
        meshes.append((name, source.data))
        bpy.data.objects.remove(source)
    light = bpy.data.lights.new("Street Lamp", "POINT")
    light.energy, light.color, light.shadow_soft_size = 64.0, (1.0, 0.68, 0.35), 0.12
    for x, y in ((3.05, -9.0), (-3.05, -5.0), (3.05, -1.0), (-3.05, 3.0), (3.05, 7.0), (-3.05, 11.0)):
        for name, mesh in meshes:
            part = place(name, mesh, (x, y, 0.14))
            if name == "Lantern":
                part.lightgroup = "Street Lamps"
        lamp = place("Street Lamp", light, (x, y, 3.45))
        lamp.location.x -= math.copysign(0.22, x)
        lamp.lightgroup = "Street Lamps"


def _furniture() -> None:
    """Add benches, bins, planters and cafe tables."""
    wood, iron = material("Slats", (0.26, 0.14, 0.07)), material("Iron")
    for x, y in ((-3.6, -8.2), (3.6, 2.6), (-3.6, 7.5)):
        for i in range(4):
            block(
                "Slat", wood, (0.1, 1.6, 0.03), (x + math.copysign(0.13 * i - 0.2, x), y, 0.58), bevel=0.008
            )
        for i in range(3):
            block(
                "Slat",
                wood,
                (0.03, 1.6, 0.1),
                (x + math.copysign(0.27 + 0.02 * i, x), y, 0.7 + 0.14 * i),
                bevel=0.008,
            )
        for end in (-0.6, 0.6):
            block("Bench Foot", iron, (0.5, 0.05, 0.44), (x, y + end, 0.14))
    for x, y in ((-3.4, -10.4), (3.4, -5.5), (-3.4, 1.2)):
        lathe(
            "Bin",
            iron,
            [(0, 0), (0.2, 0), (0.25, 0.75), (0.22, 0.75), (0.2, 0.4), (0, 0.4)],
            (x, y, 0.14),
            segments=16,
        )
    top, chair = material("Marble", (0.7, 0.68, 0.64)), material("Chair", (0.25, 0.07, 0.05))
    for x, y in ((3.55, -7.3), (3.6, -8.6), (3.5, -6.1)):
        lathe(
            "Cafe Table",
            iron,
            [(0, 0), (0.22, 0), (0.03, 0.04), (0.03, 0.72), (0, 0.72)],
            (x, y, 0.14),
            segments=16,
        )
        lathe("Table Top", top, [(0, 0.72), (0.36, 0.72), (0.36, 0.75), (0, 0.75)], (x, y, 0.14), segments=24)
        for turn in (70, 250):
            a = math.radians(turn)
            at = (x + 0.62 * math.cos(a), y + 0.62 * math.sin(a), 0.14)
            lathe(
                "Stool",
                chair,
                [(0, 0), (0.16, 0), (0.03, 0.03), (0.03, 0.42), (0.18, 0.44), (0.18, 0.48), (0, 0.48)],
                at,
                segments=16,
            )
    leaf = shapes.cloth("Hedge", (0.05, 0.14, 0.04), 0.3)
    for x, y in ((-3.9, -2.9), (-3.9, 0.0), (3.9, 9.2)):
        block("Planter", material("Curb"), (0.6, 1.4, 0.45), (x, y, 0.14), bevel=0.02)
        cushion("Hedge", leaf, (0.6, 1.4, 0.7), (x, y, 0.75), power=3)


def _cobbles() -> np.ndarray:
    """Return rows of rounded stones, (512, 512, 3); the image repeats."""
    size, rows, random = 512, 16, np.random.default_rng(8)
    v, u = np.mgrid[0:size, 0:size] / size
    row = (v * rows).astype(int)
    along = (u + 0.5 / rows * (row % 2)) % 1 * rows
    tint = random.uniform(0.6, 1.2, (rows, rows))[row, along.astype(int)]
    edge = np.maximum(np.abs(v * rows % 1 - 0.5), np.abs(along % 1 - 0.5)) * 2
    shade = np.where(edge > 0.88, 0.4, tint * (1.05 - 0.35 * edge**4)) * (1 + 0.2 * shapes.noise(2, size, 6))
    return shade[..., None] * np.array((0.24, 0.23, 0.23))


def _slabs() -> np.ndarray:
    size, random = 512, np.random.default_rng(9)
    v, u = np.mgrid[0:size, 0:size] / size
    tint = random.uniform(0.85, 1.1, (2, 2))[(v * 2).astype(int), (u * 2).astype(int)]
    joint = (v * 2 % 1 < 0.025) | (u * 2 % 1 < 0.025)
    shade = np.where(joint, 0.5, tint * (1 + 0.2 * shapes.noise(12, size, 7)))
    return shade[..., None] * np.array((0.36, 0.34, 0.32))


if __name__ == "__main__":
    build()
