"""Scenes in which surfaces touch or intersect, with their contact lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bmesh
import bpy
import numpy as np

from tools.verification.scenes import material, world
from tools.verification.texel_scenes import block, thin_wall


@dataclass(frozen=True)
class Line:
    """A line of contact on one flat surface.

    name:        of the object whose surface it is
    start, end:  (3,) float64, m
    away:        (3,) float64, unit vector in the surface, across the line to where light falls
    """

    name: str
    start: np.ndarray
    end: np.ndarray
    away: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        """Unit normal of the surface, up to its sign."""
        normal: np.ndarray = np.cross(self.end - self.start, self.away)
        return normal / np.linalg.norm(normal)


@dataclass(frozen=True)
class Contacts:
    """Lines of a scene, and the width of its lightmap, texels."""

    resolution: int
    lines: tuple[Line, ...]


#: Every scene by name.
SCENES: dict[str, Callable[[], Contacts]] = {}

#: Feet of boxes: lower and upper corner, m.
_FEET = tuple(((x, y), (x + 0.47, y + 0.43)) for x, y in ((-0.61, -0.43), (0.37, 0.11)))


def scene(function: Callable[[], Contacts]) -> Callable[[], Contacts]:
    """Register a scene under its function's name."""
    SCENES[function.__name__] = function
    return function


@scene
def sunk() -> Contacts:
    """Boxes 5 cm in the floor."""
    return _boxes(-0.05)


@scene
def standing() -> Contacts:
    """Boxes that stand on the floor."""
    return _boxes(0.0)


@scene
def ceiling_lamp() -> Contacts:
    """A lamp's case at the ceiling."""
    grey, shining = material("Grey"), material("Shining", Emission_Strength=12)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 0.9, 0.8, 1)
    block("Room", (0, 0, 0), (2, 1.6, 1.8), grey, inside=True)
    case = block("Case", (0.73, 0.61, 1.7), (1.26, 1.02, 1.8), grey)
    case.data.materials.append(shining)
    case.data.polygons[0].material_index = 1
    return Contacts(128, _around("Room", (0.73, 0.61), (1.26, 1.02), 1.8))


@scene
def shining_lamp() -> Contacts:
    """A lamp at the ceiling that shines to all sides."""
    grey, shining = material("Grey"), material("Shining", Emission_Strength=12)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 0.9, 0.8, 1)
    block("Room", (0, 0, 0), (2, 1.6, 1.8), grey, inside=True)
    block("Lamp", (0.73, 0.61, 1.7), (1.26, 1.02, 1.8), shining)
    return Contacts(128, _around("Room", (0.73, 0.61), (1.26, 1.02), 1.8))


@scene
def wall() -> Contacts:
    """The lit side of a wall of 2 cm on one floor."""
    thin_wall()
    return Contacts(128, (_line("Room", (0.81, 0.1, 0), (0.81, 0.7, 0), (-1, 0, 0)),))


@scene
def cut_under_wall() -> Contacts:
    """The same, the charts cut along an edge under the middle of the wall."""
    return _cut_wall(0.82)


@scene
def cut_beside_wall() -> Contacts:
    """The same, the charts cut along an edge at its lit side."""
    return _cut_wall(0.81)


def _cut_wall(x: float) -> Contacts:
    """Add the thin wall to a room that has edges at some x, along which its charts end."""
    thin_wall()
    room = bpy.data.objects["Room"]
    mesh = bmesh.new()
    mesh.from_mesh(room.data)
    parts = [*mesh.verts, *mesh.edges, *mesh.faces]
    bmesh.ops.bisect_plane(mesh, geom=parts, plane_co=(x, 0, 0), plane_no=(1, 0, 0))
    mesh.to_mesh(room.data)
    mesh.free()
    room.hemibake.cut_along_walls = True
    return Contacts(128, (_line("Room", (0.81, 0.1, 0), (0.81, 0.7, 0), (-1, 0, 0)),))


def _boxes(bottom: float) -> Contacts:
    """Put boxes on or in a floor, under an even sky."""
    grey = material("Grey")
    block("Floor", (-2, -2, -0.3), (2, 2, 0), grey)
    lines: list[Line] = []
    for index, (low, high) in enumerate(_FEET):
        block(f"Box {index}", (*low, bottom), (*high, 0.5), grey)
        lines += _around("Floor", low, high, 0.0)
        lines.append(_line(f"Box {index}", (low[0], low[1], 0), (high[0], low[1], 0), (0, 0, 1)))
    world((1, 1, 1), 0.9)
    return Contacts(128, tuple(lines))


def _around(name: str, low: tuple[float, float], high: tuple[float, float], z: float) -> tuple[Line, ...]:
    """Return the lines around a box that stands on a level surface, away from the box."""
    sides = (
        ((low[0], low[1]), (high[0], low[1]), (0, -1, 0)),
        ((high[0], low[1]), (high[0], high[1]), (1, 0, 0)),
        ((high[0], high[1]), (low[0], high[1]), (0, 1, 0)),
        ((low[0], high[1]), (low[0], low[1]), (-1, 0, 0)),
    )
    return tuple(_line(name, (*start, z), (*end, z), away) for start, end, away in sides)


def _line(name: str, start, end, away) -> Line:
    return Line(name, *(np.array(point, float) for point in (start, end, away)))
