"""Evaluated mesh -> engine.Mesh, by whole-array reads only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.scene import Mesh

#: A triangle is degenerate if twice its area is below this times its longest edge squared.
_ZERO_AREA = 1e-7


@dataclass(frozen=True)
class Corners:
    """The triangle corners of a mesh in object space.

    positions, normals  (t, 3, 3) float64
    uvs                 (t, 3, 2) float32
    face, slot          (t,) int32, polygon and material slot of each triangle
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    face: np.ndarray
    slot: np.ndarray


def read_array(collection, attribute: str, width: int, dtype) -> np.ndarray:
    """Return an attribute of every item of a Blender collection, (n, width) of the given type."""
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width)


def read_corners(obj: bpy.types.Object, mesh: bpy.types.Mesh, uv_layer: str) -> Corners:
    """Return the corners of an evaluated mesh; raises SceneError if it has no such UV layer."""
    layer = mesh.uv_layers.get(uv_layer)
    if layer is None:
        raise SceneError(
            f"Object '{obj.name}' loses its UV layer '{uv_layer}' in its modifiers. "
            "Let them keep it, apply them, or hide the object from the viewport."
        )
    mesh.calc_loop_triangles()
    triangles = mesh.loop_triangles
    loops = read_array(triangles, "loops", 3, np.int32)
    vertices = read_array(triangles, "vertices", 3, np.int32)
    polygons = read_array(triangles, "polygon_index", 1, np.int32)[:, 0]
    return Corners(
        positions=read_array(mesh.vertices, "co", 3, np.float32).astype(np.float64)[vertices],
        normals=read_array(mesh.corner_normals, "vector", 3, np.float32).astype(np.float64)[loops],
        uvs=read_array(layer.uv, "vector", 2, np.float32)[loops],
        face=polygons,
        slot=read_array(mesh.polygons, "material_index", 1, np.int32)[polygons, 0],
    )


def middle(objects: Sequence[bpy.types.Object]) -> np.ndarray:
    """Return the middle of the objects' bounding box, (3,) float64, world space; 0 if that is not finite.

    float32 positions relative to it keep their digits however far from the origin the scene is.
    """
    corners = [_in_world(obj, np.array(obj.bound_box, np.float64)) for obj in objects]
    points = np.concatenate(corners) if corners else np.zeros((1, 3))
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre if np.isfinite(centre).all() else np.zeros(3)


def _in_world(obj: bpy.types.Object, points: np.ndarray) -> np.ndarray:
    """Return points, (..., 3) float64, from object space to world space."""
    matrix = np.array(obj.matrix_world, np.float64)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def world_mesh(
    obj: bpy.types.Object, corners: Corners, origin: np.ndarray, slots: Sequence[int], notes: list[str]
) -> Mesh:
    """Return an object's corners along the world's axes, without zero-area triangles.

    origin  (3,) float64, world space: what the positions are relative to
    slots   index into `Scene.materials` of each material slot
    """
    matrix = np.array(obj.matrix_world, np.float64)
    positions = _in_world(obj, corners.positions) - origin
    normals = _unit(corners.normals @ _normal_matrix(matrix[:3, :3]).T)
    order = [0, 2, 1] if np.linalg.det(matrix[:3, :3]) < 0 else [0, 1, 2]
    keep = ~_zero_area(positions)
    if not keep.all():
        notes.append(f"Object '{obj.name}': {np.sum(~keep)} zero-area triangles were left out.")
    slot = np.clip(corners.slot, 0, len(slots) - 1)
    return Mesh(
        name=obj.name,
        positions=positions[keep][:, order].astype(np.float32),
        normals=normals[keep][:, order].astype(np.float32),
        uvs=np.ascontiguousarray(corners.uvs[keep][:, order]),
        face=corners.face[keep],
        subface=subfaces(corners.face)[keep],
        material=np.asarray(slots, np.int32)[slot][keep],
    )


def subfaces(face: np.ndarray) -> np.ndarray:
    """Return the index of each triangle within its polygon, (t,) int32, for ascending polygons."""
    index = np.arange(len(face), dtype=np.int32)
    starts = np.r_[True, face[1:] != face[:-1]][: len(face)]
    return index - np.maximum.accumulate(np.where(starts, index, 0)).astype(np.int32)


def _normal_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the matrix normals transform by: the inverse transpose up to a positive factor.

    The cofactor matrix, with the sign of the determinant, also exists for flattened objects.
    """
    cofactors = np.stack([np.cross(matrix[(i + 1) % 3], matrix[(i + 2) % 3]) for i in range(3)])
    return -cofactors if np.linalg.det(matrix) < 0 else cofactors


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def _zero_area(positions: np.ndarray) -> np.ndarray:
    """Return which triangles have no area, (t,) bool; False where a coordinate is not a number."""
    edges = positions - np.roll(positions, 1, axis=1)
    longest = np.max(np.sum(edges**2, axis=2), axis=1)
    doubled = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return doubled <= _ZERO_AREA * longest
