"""The corners of an evaluated mesh, by whole-array reads only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy
import numpy as np

#: UV map of textures that were made over lightmap UVs, whichever layer of an object holds these.
LIGHTMAP_UVS = "Hemibake lightmap UVs"

#: A triangle is degenerate if twice its area is below this times its longest edge squared.
_ZERO_AREA = 1e-7


@dataclass(frozen=True)
class Corners:
    """The triangle corners of a mesh in object space, without zero-area triangles.

    positions    (t, 3, 3) float32
    normals      (t, 3, 3) float32
    uvs          (t, 3, 2) float32, lightmap UV of the mesh; None if it has none
    texture_uvs  (t, 3, 2) float32 of each UV map that textures need
    face         (t,) int32, polygon of each triangle
    subface      (t,) int32, number of the triangle within its polygon
    slot         (t,) int32, material slot of each triangle
    dropped      number of triangles without an area
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    texture_uvs: dict[str, np.ndarray]
    face: np.ndarray
    subface: np.ndarray
    slot: np.ndarray
    dropped: int


def read_array(collection, attribute: str, width: int, dtype) -> np.ndarray:
    """Return an attribute of every item of a Blender collection, (n, width) of the given type."""
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width)


def read_topology(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertex and edge of each loop of a mesh, (l,), and the vertices of each edge, (e, 2), all int32.

    Attributes are copied as they are, which takes a hundredth of what reading the loops one by one does.
    """
    attributes = mesh.attributes
    return (
        read_array(attributes[".corner_vert"].data, "value", 1, np.int32)[:, 0],
        read_array(attributes[".corner_edge"].data, "value", 1, np.int32)[:, 0],
        read_array(attributes[".edge_verts"].data, "value", 2, np.int32),
    )


def read_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertices of a mesh, (v, 3) float32, object space."""
    return read_array(mesh.attributes["position"].data, "vector", 3, np.float32)


def read_corners(mesh: bpy.types.Mesh, uv_layer: str | None, uv_maps: Mapping[str, str]) -> Corners:
    """Return the corners of an evaluated mesh, with its lightmap UVs from a layer, if that is named.

    uv_maps  the layer of each UV map that textures need; "" is the one that renders use. One that the mesh
             does not have is 0 everywhere, as in Cycles
    """
    mesh.calc_loop_triangles()
    triangles = mesh.loop_triangles
    loops = read_array(triangles, "loops", 3, np.int32)
    vertices = read_array(triangles, "vertices", 3, np.int32)
    polygons = read_array(triangles, "polygon_index", 1, np.int32)[:, 0]
    positions = read_array(mesh.vertices, "co", 3, np.float32)[vertices]
    keep = ~is_degenerate(positions)
    loops, polygon = loops[keep], polygons[keep]
    return Corners(
        positions=positions[keep],
        normals=read_array(mesh.corner_normals, "vector", 3, np.float32)[loops],
        uvs=None if uv_layer is None else _uvs(mesh.uv_layers.get(uv_layer), loops),
        texture_uvs={name: _uvs(_layer(mesh, layer), loops) for name, layer in uv_maps.items()},
        face=polygon,
        subface=subfaces(polygons)[keep],
        slot=read_array(mesh.polygons, "material_index", 1, np.int32)[polygon, 0],
        dropped=int(np.sum(~keep)),
    )


def _layer(mesh: bpy.types.Mesh, name: str) -> bpy.types.MeshUVLoopLayer | None:
    """Return a UV map by name; "" is the one that renders use."""
    if name:
        return mesh.uv_layers.get(name)
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)


def _uvs(layer: bpy.types.MeshUVLoopLayer | None, loops: np.ndarray) -> np.ndarray:
    """Return a UV map at the triangles' corners, (t, 3, 2) float32."""
    if layer is None:
        return np.zeros((*loops.shape, 2), np.float32)
    return read_array(layer.uv, "vector", 2, np.float32)[loops]


def subfaces(face: np.ndarray) -> np.ndarray:
    """Return the index of each triangle within its polygon, (t,) int32, for ascending polygons."""
    index = np.arange(len(face), dtype=np.int32)
    starts = np.r_[True, face[1:] != face[:-1]][: len(face)]
    return index - np.maximum.accumulate(np.where(starts, index, 0)).astype(np.int32)


def is_degenerate(positions: np.ndarray) -> np.ndarray:
    """Return which triangles, (t, 3, 3), have no area, (t,) bool; not those whose coordinates are none."""
    edges = (positions - np.roll(positions, 1, axis=1)).astype(np.float64)
    longest = np.max(np.sum(edges**2, axis=2), axis=1)
    doubled = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return doubled <= _ZERO_AREA * longest
