"""Scenes with seams on smooth surfaces. Each is built in an empty file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps

import bmesh
import bpy

from tools.verification.scenes import add, box, floor, lamp, material, world

#: Every scene by name.
SCENES: dict[str, Callable[[], None]] = {}


def scene(function: Callable[[], None]) -> Callable[[], None]:
    """Register a scene under its function's name; all have the same light and surface."""

    @wraps(function)
    def built() -> None:
        function()
        grey = material("Grey")
        for obj in bpy.context.scene.objects:
            obj.data.materials.clear()
            obj.data.materials.append(grey)
        world((0.2, 0.25, 0.3), 0.5)
        lamp("POINT", (-1.5, -2.2, 3.0), energy=300, shadow_soft_size=0.3)

    SCENES[function.__name__] = built
    return built


@scene
def sphere() -> None:
    """A UV sphere."""
    floor()
    smooth(add("Sphere", bpy.ops.mesh.primitive_uv_sphere_add, location=(0, 0, 1)))


@scene
def cylinder() -> None:
    """A cylinder with hard rims."""
    floor()
    smooth(add("Cylinder", bpy.ops.mesh.primitive_cylinder_add, location=(0, 0, 1.01)), math.radians(40))


@scene
def suzanne() -> None:
    """Suzanne."""
    floor()
    smooth(add("Suzanne", bpy.ops.mesh.primitive_monkey_add, location=(0, 0, 1.2)))


@scene
def torus() -> None:
    """A finely tessellated torus."""
    floor()
    options = {"major_segments": 96, "minor_segments": 48, "rotation": (0.5, 0, 0), "location": (0, 0, 0.6)}
    smooth(add("Torus", bpy.ops.mesh.primitive_torus_add, **options))


@scene
def tiles() -> None:
    """Two tiles side by side, and a larger one along both."""
    for name, size, x, y in (("Left", 2, -1, 0), ("Right", 2, 1, 0), ("Behind", 4, 0.7, 3)):
        add(name, bpy.ops.mesh.primitive_plane_add, size=size, location=(x, y, 0))
    box(location=(0.2, 0.2, 0.8))


@scene
def halves() -> None:
    """A sphere in two objects, with the normals of the whole."""
    floor()
    for name, side in (("Left", -1), ("Right", 1)):
        half = add(name, bpy.ops.mesh.primitive_uv_sphere_add, location=(0, 0, 1))
        cut(half, lambda face, side=side: face.calc_center_median().x * side > 0)
        smooth(half)
        normals = [vertex.co.normalized() for vertex in half.data.vertices]
        half.data.normals_split_custom_set_from_vertices(normals)


def smooth(obj: bpy.types.Object, sharp: float = math.pi) -> None:
    """Shade a mesh smooth, but for edges whose faces meet at a larger angle, rad."""
    with edited(obj) as mesh:
        for face in mesh.faces:
            face.smooth = True
        for edge in mesh.edges:
            edge.smooth = len(edge.link_faces) != 2 or edge.calc_face_angle() <= sharp


def cut(obj: bpy.types.Object, goes: Callable[[bmesh.types.BMFace], bool]) -> None:
    """Delete some faces of a mesh."""
    with edited(obj) as mesh:
        bmesh.ops.delete(mesh, geom=[face for face in mesh.faces if goes(face)], context="FACES")


@contextmanager
def edited(obj: bpy.types.Object) -> Iterator[bmesh.types.BMesh]:
    """Give a mesh as a BMesh, and write it back."""
    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    yield mesh
    mesh.to_mesh(obj.data)
    mesh.free()
