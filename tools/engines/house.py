"""A house of two rooms for tests of engines: windows, a door, a gable roof, and a sun path as states."""

from __future__ import annotations

import math
from collections.abc import Sequence

from .room import box_module

#: Half width (x), half depth (y), height of the walls and of the ridge, m.
_WIDTH, _DEPTH, _WALL, _RIDGE = 3.0, 2.0, 2.4, 3.4

#: Times of the sun path: light states of the house.
TIMES = ("09:00", "15:30")

#: A corner, (x, y, z).
Corner = tuple[float, float, float]


def bake() -> None:
    """Build the house in an empty file, and bake it with its sun path in draft quality."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build()
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution = "draft", 96
    settings.outputs = {"combined", "light_groups"}
    settings.sun_times, settings.sun_latitude, settings.sun_day = " ".join(TIMES), 48.0, 60
    bpy.ops.hemibake.bake()


def build() -> None:
    """Add the house, its lights and a camera to the scene, without a world."""
    import bpy

    box = box_module()
    white, warm, wood = (
        box.material(name, color)
        for name, color in (
            ("Plaster", (0.75, 0.73, 0.7)),
            ("Clay", (0.6, 0.35, 0.25)),
            ("Wood", (0.4, 0.28, 0.18)),
        )
    )
    x, y, top = _WIDTH, _DEPTH, _WALL
    _quads("Floor", wood, [[(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]])
    south = [(-2.4, -0.6, 0.8, 2.0), (0.8, 2.2, 0.8, 2.0)]
    _quads(
        "South", white, [_upright((a, -y), (b, -y), low, high) for a, b, low, high in _pierced(-x, x, south)]
    )
    _quads("North", warm, [_upright((-x, y), (x, y), 0, top)])
    for name, side in (("West", -x), ("East", x)):
        gable = [(side, -y, top), (side, y, top), (side, 0, _RIDGE)]
        _quads(name, white, [_upright((side, -y), (side, y), 0, top), gable])
    door = _pierced(-y, y, [(-0.5, 0.5, 0, 2.0)])
    for name, side in (("Partition", -0.05), ("Partition.back", 0.05)):
        panels = [_upright((side, a), (side, b), low, high) for a, b, low, high in door]
        _quads(name, white, panels, (40 * side, 0, 1.2))
    roof = [[(-x, side, top), (x, side, top), (x, 0, _RIDGE), (-x, 0, _RIDGE)] for side in (-y, y)]
    _quads("Roof", wood, roof)
    for name, turn in (("Table", 0.4), ("Chair", -0.2)):
        box.box(name, wood, (0.9, 0.6, 0.7), (-1.6 if name == "Table" else 1.5, 0.4), turn)
    _lights(box)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (-2.7, -1.6, 1.6), (math.radians(80), 0, math.radians(-58))
    camera.data.lens = 22
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera, scene.world = camera, None


def _lights(box: object) -> None:
    """Add a sun, and a lamp in the back room in a light group of its own."""
    import bpy

    bpy.context.view_layer.lightgroups.add(name="Lamps")
    for name, kind, energy, place in (
        ("Sun", "SUN", 6.0, (0, 0, 5)),
        ("Lamp", "POINT", 40.0, (1.6, -0.4, 2.0)),
    ):
        data = bpy.data.lights.new(name, kind)
        data.energy = energy
        light = bpy.data.objects.new(name, data)
        light.location, light.lightgroup = place, "Lamps" if name == "Lamp" else ""
        bpy.context.scene.collection.objects.link(light)


def _pierced(
    start: float, end: float, openings: Sequence[tuple[float, float, float, float]]
) -> list[tuple[float, float, float, float]]:
    """Return the rectangles of a wall around its openings, all as (from, to, bottom, top), m."""
    parts, at = [], start
    for first, last, low, high in openings:
        parts += [(at, first, 0, _WALL), (first, last, high, _WALL)]
        parts += [(first, last, 0, low)] if low > 0 else []
        at = last
    return [*parts, (at, end, 0, _WALL)]


def _upright(first: tuple[float, float], last: tuple[float, float], low: float, high: float) -> list[Corner]:
    """Return an upright rectangle between two places of the floor."""
    return [(*first, low), (*last, low), (*last, high), (*first, high)]


def _quads(
    name: str, material: object, faces: Sequence[Sequence[Corner]], inside: Corner = (0.0, 0.0, 1.2)
) -> None:
    """Add an object of separate faces that face a place."""
    import bpy
    from mathutils import Vector
    from mathutils.geometry import normal

    def is_turned(face: Sequence[Corner]) -> bool:
        return normal(*(Vector(corner) for corner in face[:3])).dot(Vector(inside) - Vector(face[0])) < 0

    faces = [face[::-1] if is_turned(face) else face for face in faces]
    mesh, corners = bpy.data.meshes.new(name), [corner for face in faces for corner in face]
    numbers = iter(range(len(corners)))
    mesh.from_pydata(corners, [], [[next(numbers) for _ in face] for face in faces])
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))
