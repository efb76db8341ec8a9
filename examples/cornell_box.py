"""A Cornell box, built in the current scene.

Run it in Blender's text editor, or import it and call `build`. The room is 2 m wide and closed; the
light fills a hole in the ceiling, so no surface lies behind another. There are no lightmap UVs: the
bake makes them.
"""

from __future__ import annotations

import math

import bpy
from mathutils import Euler, Matrix, Vector

#: Side of the room, side of the light and radiance of the light.
ROOM, LIGHT, RADIANCE = 2.0, 0.5, 15.0

WHITE = (0.73, 0.73, 0.73)
RED = (0.63, 0.065, 0.05)
GREEN = (0.14, 0.45, 0.091)

#: Width, depth, height, location on the floor and turn of each box, after the measured original (m, degrees).
BOXES = {
    "Short Box": (0.6, 0.6, 0.6, (0.33, -0.39), -17.0),
    "Tall Box": (0.6, 0.6, 1.2, (-0.33, 0.27), 18.0),
}


def build() -> None:
    """Add the room, its camera and a black world to the current scene."""
    white, red, green = material("White", WHITE), material("Red", RED), material("Green", GREEN)
    half = ROOM / 2
    wall("Floor", white, (0, 0, 0), (0, 0, 0))
    wall("Back Wall", white, (0, half, half), (math.pi / 2, 0, 0))
    wall("Left Wall", red, (-half, 0, half), (0, math.pi / 2, 0))
    wall("Right Wall", green, (half, 0, half), (0, -math.pi / 2, 0))
    wall("Front Wall", white, (0, -half, half), (-math.pi / 2, 0, 0)).visible_camera = False
    ceiling("Ceiling", white)
    light("Light", material("Light", WHITE, RADIANCE))
    for name, (width, depth, height, location, turn) in BOXES.items():
        box(name, white, (width, depth, height), location, math.radians(turn))
    camera()
    bpy.context.scene.world = None


def material(name: str, colour: tuple[float, float, float], radiance: float = 0.0) -> bpy.types.Material:
    """Return a purely diffuse Principled material that may emit."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    principled = result.node_tree.nodes["Principled BSDF"]
    principled.inputs["Base Color"].default_value = (*colour, 1.0)
    principled.inputs["Roughness"].default_value = 1.0
    principled.inputs["Specular IOR Level"].default_value = 0.0
    principled.inputs["Emission Color"].default_value = (1.0, 0.85, 0.65, 1.0)
    principled.inputs["Emission Strength"].default_value = radiance
    result.diffuse_color = (*colour, 1.0)
    return result


def mesh_object(name: str, surface: bpy.types.Material, vertices: list, faces: list) -> bpy.types.Object:
    """Return a new object of the scene's collection."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(surface)
    result = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(result)
    return result


def wall(name: str, surface: bpy.types.Material, location: tuple, turn: tuple) -> bpy.types.Object:
    """Return a square wall; turned by nothing it is a floor that faces up."""
    half = ROOM / 2
    corners = [Vector((x, y, 0)) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    move = Matrix.Translation(location) @ Euler(turn).to_matrix().to_4x4()
    return mesh_object(name, surface, [move @ corner for corner in corners], [(0, 1, 2, 3)])


def ceiling(name: str, surface: bpy.types.Material) -> bpy.types.Object:
    """Return the ceiling: a grid of 3 x 3 cells without the middle one, facing down."""
    ticks = (-ROOM / 2, -LIGHT / 2, LIGHT / 2, ROOM / 2)
    vertices = [(x, y, ROOM) for y in ticks for x in ticks]
    cells = [(row, column) for row in range(3) for column in range(3) if (row, column) != (1, 1)]
    corners = [4 * row + column for row, column in cells]
    return mesh_object(name, surface, vertices, [(i, i + 4, i + 5, i + 1) for i in corners])


def light(name: str, surface: bpy.types.Material) -> bpy.types.Object:
    """Return the square that fills the hole of the ceiling, facing down."""
    half = LIGHT / 2
    vertices = [(-half, -half, ROOM), (-half, half, ROOM), (half, half, ROOM), (half, -half, ROOM)]
    return mesh_object(name, surface, vertices, [(0, 1, 2, 3)])


def box(
    name: str, surface: bpy.types.Material, size: tuple, location: tuple, turn: float
) -> bpy.types.Object:
    """Return a box without a bottom that stands on the floor."""
    width, depth, height = size
    x, y = width / 2, depth / 2
    outline = [(-x, -y), (x, -y), (x, y), (-x, y)]
    vertices = [(x, y, z) for z in (0, height) for x, y in outline]
    sides = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    result = mesh_object(name, surface, vertices, [*sides, (4, 5, 6, 7)])
    result.location, result.rotation_euler = (*location, 0), (0, 0, turn)
    return result


def camera() -> bpy.types.Object:
    """Return the camera, in front of the room and looking through its front wall."""
    data = bpy.data.cameras.new("Camera")
    data.angle = math.radians(38.2)
    result = bpy.data.objects.new("Camera", data)
    result.location, result.rotation_euler = (0, -3.88, ROOM / 2), (math.pi / 2, 0, 0)
    bpy.context.scene.collection.objects.link(result)
    bpy.context.scene.camera = result
    return result


if __name__ == "__main__":
    build()
