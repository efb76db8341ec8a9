"""Reads the triangles of an evaluated mesh, with one read per attribute array."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bmesh
import bpy
import numpy as np

from ....engine.progress import finished
from ....engine.scene.degenerate import is_degenerate
from ..slice_timer import Slices, row_slices

#: Name of the UV map for evaluated textures: a copy of the object's lightmap UVs from its own layer.
LIGHTMAP_UVS = "Hemibake lightmap UVs"


@dataclass(frozen=True)
class Corners:
    """Triangles of a mesh in object space, without zero-area triangles.

    positions:    (t, 3, 3) float32, positions of the corners
    normals:      (t, 3, 3) float32, normals at the corners
    uvs:          (t, 3, 2) float32, lightmap UVs of the mesh; None if it has none
    texture_uvs:  (t, 3, 2) float32 by name of each UV map that textures use
    face:         (t,) int32, polygon of each triangle
    subface:      (t,) int32, index of the triangle within its polygon
    slot:         (t,) int32, material slot of each triangle
    dropped:      number of triangles without area
    """

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    texture_uvs: dict[str, np.ndarray]
    face: np.ndarray
    subface: np.ndarray
    slot: np.ndarray
    dropped: int


def read_array(
    collection: bpy.types.bpy_prop_collection, attribute: str, width: int, dtype: type
) -> np.ndarray:
    """Return an attribute of all items of a Blender collection, (n, width) of the given type."""
    values: np.ndarray = np.empty(len(collection) * width, dtype)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width)


def read_topology(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertex and edge of each loop, (l,) int32, and the vertices of each edge, (e, 2) int32.

    Attributes are copied as arrays, which takes a hundredth of the time of reading single loops.
    """
    return (
        read_corner_vertices(mesh),
        _read_attribute(mesh, ".corner_edge", "value", 1, np.int32)[:, 0],
        _read_attribute(mesh, ".edge_verts", "value", 2, np.int32),
    )


def read_uvs(layer: bpy.types.MeshUVLoopLayer) -> np.ndarray:
    """Return the UVs of a layer at the loops of its mesh, (l, 2) float32; in edit mode as edited."""
    mesh = layer.id_data
    if mesh.is_editmode:
        edited = bmesh.from_edit_mesh(mesh)
        key = edited.loops.layers.uv[layer.name]
        uvs = [loop[key].uv[:] for face in edited.faces for loop in face.loops]
        return np.array(uvs, np.float32).reshape(-1, 2)
    return read_array(layer.uv, "vector", 2, np.float32)


def read_corner_vertices(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertex of each loop of a mesh, (l,) int32; meshes in edit mode have no attributes."""
    if mesh.is_editmode:
        return read_array(mesh.loops, "vertex_index", 1, np.int32)[:, 0]
    return _read_attribute(mesh, ".corner_vert", "value", 1, np.int32)[:, 0]


def read_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the vertex positions of a mesh, (v, 3) float32, object space."""
    return _read_attribute(mesh, "position", "vector", 3, np.float32)


def _read_attribute(mesh: bpy.types.Mesh, name: str, field: str, width: int, dtype: type) -> np.ndarray:
    """Return an attribute of a mesh, (n, width); 0 rows if the mesh has no elements."""
    attribute = mesh.attributes.get(name)
    return (
        np.empty((0, width), dtype) if attribute is None else read_array(attribute.data, field, width, dtype)
    )


@dataclass(frozen=True)
class MeshArrays:
    """Arrays of a Blender mesh, unchanged, in object space.

    positions:  (v, 3) float32, vertex positions
    corners:    (l,) int32, vertex of each loop
    normals:    (l, 3) float32, normal of each loop
    loops:      (t, 3) int32, loops of each triangle
    sizes:      (p,) int32, number of loops of each polygon
    slot:       (p,) int32, material slot of each polygon
    uvs:        (l, 2) float32, lightmap UVs; None without any
    maps:       (l, 2) float32 by name of each UV map that textures use; None for maps that the mesh lacks
    """

    positions: np.ndarray
    corners: np.ndarray
    normals: np.ndarray
    loops: np.ndarray
    sizes: np.ndarray
    slot: np.ndarray
    uvs: np.ndarray | None
    maps: dict[str, np.ndarray | None]


def read_mesh(mesh: bpy.types.Mesh, uv_layer: str | None, uv_maps: Mapping[str, str]) -> MeshArrays:
    """Read the arrays of an evaluated mesh, with lightmap UVs from a layer if one is given.

    uv_maps:  layer of each UV map that textures use; "" is the one active for rendering
    """
    mesh.calc_loop_triangles()
    starts = read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0]
    return MeshArrays(
        positions=read_positions(mesh),
        corners=read_corner_vertices(mesh),
        normals=read_array(mesh.corner_normals, "vector", 3, np.float32),
        loops=read_array(mesh.loop_triangles, "loops", 3, np.int32),
        sizes=np.diff(np.r_[starts, len(mesh.loops)]).astype(np.int32),
        slot=read_slots(mesh),
        uvs=None if uv_layer is None else _uvs(mesh.uv_layers.get(uv_layer)),
        maps={name: _uvs(_layer(mesh, layer)) for name, layer in uv_maps.items()},
    )


def read_corners(mesh: bpy.types.Mesh, uv_layer: str | None, uv_maps: Mapping[str, str]) -> Corners:
    """Return the triangles of an evaluated mesh, with lightmap UVs from a layer if one is given."""
    return finished(make_corners(read_mesh(mesh, uv_layer, uv_maps)))


def make_corners(mesh: MeshArrays) -> Slices[Corners]:
    """Return the triangles of a mesh; UV maps that it lacks are 0, as in Cycles."""
    face = np.repeat(np.arange(len(mesh.sizes), dtype=np.int32), np.maximum(mesh.sizes - 2, 0))
    subface, parts = subfaces(face), []
    for rows in row_slices(len(mesh.loops), 27):
        parts.append(_part(mesh, mesh.loops[rows], face[rows], subface[rows]))
        yield rows.stop / len(mesh.loops)
    return _joined(parts) if parts else _part(mesh, mesh.loops, face, subface)


def _part(mesh: MeshArrays, loops: np.ndarray, face: np.ndarray, subface: np.ndarray) -> Corners:
    """Return a range of triangles."""
    positions = mesh.positions[mesh.corners[loops]]
    keep = ~is_degenerate(positions)
    if not keep.all():
        loops, positions, face, subface = loops[keep], positions[keep], face[keep], subface[keep]
    return Corners(
        positions=positions,
        normals=mesh.normals[loops],
        uvs=None if mesh.uvs is None else mesh.uvs[loops],
        texture_uvs={
            name: np.zeros((*loops.shape, 2), np.float32) if uvs is None else uvs[loops]
            for name, uvs in mesh.maps.items()
        },
        face=face,
        subface=subface,
        slot=mesh.slot[face],
        dropped=int(np.sum(~keep)),
    )


def _joined(parts: Sequence[Corners]) -> Corners:
    """Concatenate ranges of triangles."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    return Corners(
        positions=joined("positions"),
        normals=joined("normals"),
        uvs=None if first.uvs is None else joined("uvs"),
        texture_uvs={
            name: np.concatenate([part.texture_uvs[name] for part in parts]) for name in first.texture_uvs
        },
        face=joined("face"),
        subface=joined("subface"),
        slot=joined("slot"),
        dropped=sum(part.dropped for part in parts),
    )


def read_slots(mesh: bpy.types.Mesh) -> np.ndarray:
    """Return the material slot of each polygon, (p,) int32; 0 without the attribute."""
    attribute = mesh.attributes.get("material_index")
    if attribute is None:
        return np.zeros(len(mesh.polygons), np.int32)
    return read_array(attribute.data, "value", 1, np.int32)[:, 0]


def _layer(mesh: bpy.types.Mesh, name: str) -> bpy.types.MeshUVLoopLayer | None:
    """Return a UV layer by name; "" is the one active for rendering."""
    if name:
        return mesh.uv_layers.get(name)
    return next((layer for layer in mesh.uv_layers if layer.active_render), None)


def _uvs(layer: bpy.types.MeshUVLoopLayer | None) -> np.ndarray | None:
    return None if layer is None else read_uvs(layer)


def subfaces(face: np.ndarray) -> np.ndarray:
    """Return the index of each triangle within its polygon, (t,) int32; `face` must be ascending."""
    index = np.arange(len(face), dtype=np.int32)
    starts = np.r_[True, face[1:] != face[:-1]][: len(face)]
    return index - np.maximum.accumulate(np.where(starts, index, 0)).astype(np.int32)
