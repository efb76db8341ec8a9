"""A level in Blender: a floor with spheres of their own meshes, materials and textures, lamps and a sky."""

from __future__ import annotations

import math

import bpy
import numpy as np

#: Distance between neighbouring spheres, and their radius, m.
_SPACING, _RADIUS = 3.0, 1.1

#: Number of materials; every third one has an image texture of _IMAGE x _IMAGE pixels.
_MATERIALS, _TEXTURED, _IMAGE = 30, 3, 256

#: Number of lamps, and flux of each, W.
_LAMPS, _FLUX = 20, 400.0


def build_level(objects: int, triangles: int, instances: int = 0) -> None:
    """Add a level to the open file.

    objects:    number of spheres, each with a mesh of its own
    triangles:  approximate number of their triangles
    instances:  approximate number of instances of one cube, at the vertices of a grid
    """
    side = math.ceil(math.sqrt(objects))
    random, width = np.random.default_rng(7), side * _SPACING
    materials = [_material(index, random) for index in range(_MATERIALS)]
    floor = _grid(2, width + 2 * _SPACING)
    floor.location = width / 2, width / 2, 0
    floor.data.materials.append(materials[1])
    rings = max(3, round(math.sqrt(triangles / max(objects, 1)) / 2))
    for index in range(objects):
        sphere = _object(f"Sphere {index}", *_sphere(rings))
        sphere.location = index % side * _SPACING, index // side * _SPACING, 1.2
        sphere.rotation_euler = random.random(3) * 6
        sphere.data.materials.append(materials[index % _MATERIALS])
    if instances:
        _instancer(instances)
    for index in range(_LAMPS):
        lamp = bpy.data.objects.new(f"Lamp {index}", bpy.data.lights.new(f"Lamp {index}", "POINT"))
        lamp.data.energy, lamp.location = _FLUX, (*random.random(2) * width, 4)
        bpy.context.scene.collection.objects.link(lamp)
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world.color = 0.5, 0.6, 0.8


def _instancer(count: int) -> None:
    """Add a cube, and a grid that shows an instance of it at each vertex."""
    side = math.ceil(math.sqrt(count))
    grid = _grid(side, 2.0 * side)
    grid.instance_type, grid.location = "VERTS", (0, 0, 6)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32) - 0.5
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    _object("Cube", corners, np.array(faces)).parent = grid


def _grid(side: int, width: float) -> bpy.types.Object:
    """Return a flat square with side x side vertices."""
    steps = np.linspace(-width / 2, width / 2, side, dtype=np.float32)
    x, y = np.meshgrid(steps, steps)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return _object("Floor", points, first + np.array([0, 1, side + 1, side]))


def _sphere(rings: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a bumpy sphere without poles: vertices, (v, 3) float32, and 2 `rings`^2 quads, (q, 4)."""
    around, up = 2 * rings, np.linspace(0.05, math.pi - 0.05, rings + 1)[:, None]
    turn = np.linspace(0, 2 * math.pi, around, endpoint=False)
    radius = _RADIUS * (1 + 0.05 * np.sin(6 * turn) * np.sin(5 * up))
    points = np.stack(
        [radius * np.sin(up) * np.cos(turn), radius * np.sin(up) * np.sin(turn), radius * np.cos(up)], axis=-1
    )
    row, column = np.mgrid[:rings, :around]
    right = (column + 1) % around
    quads = [row * around + column, (row + 1) * around + column, (row + 1) * around + right]
    faces = np.stack([*quads, row * around + right], axis=-1).reshape(-1, 4)
    return points.reshape(-1, 3).astype(np.float32), faces


def _object(name: str, points: np.ndarray, faces: np.ndarray) -> bpy.types.Object:
    """Add an object of quads, (q, 4), to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.ravel().astype(np.int32))
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, faces.shape[1], dtype=np.int32))
    mesh.update(calc_edges=True)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _material(index: int, random: np.random.Generator) -> bpy.types.Material:
    """Return a diffuse material; every third one has a texture."""
    material = bpy.data.materials.new(f"Material {index}")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    base = tree.nodes["Principled BSDF"].inputs["Base Color"]
    base.default_value = (*random.uniform(0.1, 0.8, 3), 1)
    if index % _TEXTURED == 0:
        image = bpy.data.images.new(f"Image {index}", _IMAGE, _IMAGE)
        pixels = np.ones((_IMAGE * _IMAGE, 4), np.float32)
        pixels[:, :3] = random.uniform(0.3, 0.8, (_IMAGE * _IMAGE, 3))
        image.pixels.foreach_set(pixels.ravel())
        image.pack()
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        tree.links.new(node.outputs["Color"], base)
    return material
