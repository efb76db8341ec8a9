"""Removes faces that lie exactly on another face: they darken each other in Cycles, by a random amount."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np

#: Corners this near to each other, relative to the size of their mesh, are equal.
_NEAR = 1e-6


def remove_doubled_faces() -> int:
    """Remove all but one of the faces of each mesh that have the same corners; return how many."""
    return sum(_remove_from(mesh) for mesh in bpy.data.meshes if mesh.polygons)


def _remove_from(mesh: bpy.types.Mesh) -> int:
    """Remove the doubled faces of a mesh; return how many."""
    edited = bmesh.new()
    edited.from_mesh(mesh)
    corners = np.array([tuple(vertex.co) for vertex in edited.verts])
    places = np.round(corners / (_NEAR * max(np.ptp(corners, axis=0).max(), 1e-30))).astype(np.int64)
    known: set[tuple] = set()
    doubled = []
    for face in edited.faces:
        key = tuple(sorted(tuple(places[vertex.index].tolist()) for vertex in face.verts))
        if key in known:
            doubled.append(face)
        known.add(key)
    bmesh.ops.delete(edited, geom=doubled, context="FACES_ONLY")
    edited.to_mesh(mesh)
    edited.free()
    return len(doubled)
