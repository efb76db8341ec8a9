"""Converts an object or instance to an engine.Mesh in world axes."""

from __future__ import annotations

import numpy as np

from ...engine.scene.model import Mesh
from .objects.meshes import LIGHTMAP_UVS
from .scene_objects import ReadObject
from .slice_timer import Slices, row_slices
from .uv_transform import UvTransform, takes_textures


def world_mesh(
    reading: ReadObject, origin: np.ndarray, atlas: int, place: UvTransform | None
) -> Slices[Mesh]:
    """Transform an object's triangles to world axes, and its UVs to its place in the atlas.

    origin:  (3,) float64 in world space; positions are relative to it
    atlas:   index of the atlas in the scene
    place:   place in the atlas; None for an occluder
    """
    corners, matrix = reading.mesh.corners, reading.matrix
    linear, shift = matrix[:3, :3].T, matrix[:3, 3] - origin
    turned = bool(np.linalg.det(matrix[:3, :3]) < 0)
    normal = _normal_matrix(matrix[:3, :3], turned).T.astype(np.float32)
    order = [0, 2, 1] if turned else [0, 1, 2]
    positions, normals = np.empty_like(corners.positions), np.empty_like(corners.normals)
    uvs = np.zeros((len(positions), 3, 2), np.float32)
    for rows in row_slices(len(positions), 9):
        positions[rows] = (corners.positions[rows] @ linear + shift)[:, order]
        normals[rows] = _unit(corners.normals[rows] @ normal)[:, order]
        if place is not None and corners.uvs is not None:
            uvs[rows] = place.apply(corners.uvs[rows])[:, order]
        yield rows.stop / len(positions)
    texture_uvs = dict(corners.texture_uvs)
    if LIGHTMAP_UVS in texture_uvs and place is not None and takes_textures(reading, place):
        texture_uvs[LIGHTMAP_UVS] = place.apply(texture_uvs[LIGHTMAP_UVS])
    return Mesh(
        name=reading.name,
        positions=positions,
        normals=normals,
        uvs=uvs,
        face=corners.face,
        subface=corners.subface,
        material=reading.mesh.slots,
        atlas=atlas,
        texture_uvs={
            name: np.ascontiguousarray(values[:, order]) if turned else values
            for name, values in texture_uvs.items()
        },
        light_group=reading.light_group,
    )


def _normal_matrix(matrix: np.ndarray, turned: bool) -> np.ndarray:
    """Return the matrix that transforms normals: the inverse transpose up to a positive factor.

    It is the cofactor matrix with the sign of the determinant, which also exists for singular matrices.

    turned: True if the determinant is negative
    """
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    cofactors = np.array([
        [e * i - f * h, f * g - d * i, d * h - e * g],
        [h * c - i * b, i * a - g * c, g * b - h * a],
        [b * f - c * e, c * d - a * f, a * e - b * d],
    ])  # fmt: skip
    return -cofactors if turned else cofactors


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))
    return vectors / np.where(length > 0, length, 1)
