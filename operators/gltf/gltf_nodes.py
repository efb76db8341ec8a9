"""Nodes of a glTF file: their matrices and the box around their meshes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path

import numpy as np


def read_gltf(path: Path) -> dict:
    """Return the JSON of a .glb or .gltf file (glTF 2.0, section 4.4); raises OSError."""
    data = path.read_bytes()
    if data[:4] == b"glTF":
        data = data[20 : 20 + int.from_bytes(data[12:16], "little")]
    return json.loads(data)


def mesh_bounds(gltf: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corner, (3,) float64, of the box around all meshes, in meters, y up."""
    corners = [
        matrix[:3, :3] @ corner + matrix[:3, 3]
        for node, matrix in _placed(gltf)
        for part in (gltf["meshes"][node["mesh"]]["primitives"] if "mesh" in node else ())
        for corner in _corners(gltf["accessors"][part["attributes"]["POSITION"]])
    ]
    return np.min(corners, axis=0), np.max(corners, axis=0)


def _corners(accessor: Mapping) -> Iterator[np.ndarray]:
    """Yield the corners of the box of positions, whose limits glTF requires."""
    for corner in product(*zip(accessor["min"], accessor["max"], strict=True)):
        yield np.array(corner)


def _placed(gltf: Mapping) -> Iterator[tuple[Mapping, np.ndarray]]:
    """Yield the nodes of the shown scene with their matrices, (4, 4) float64, node to world."""
    roots = gltf["scenes"][gltf.get("scene", 0)]["nodes"]
    open_ends = [(number, np.eye(4)) for number in roots]
    while open_ends:
        number, parent = open_ends.pop()
        node = gltf["nodes"][number]
        matrix = parent @ _local(node)
        yield node, matrix
        open_ends += [(child, matrix) for child in node.get("children", ())]


def _local(node: Mapping) -> np.ndarray:
    """Return the matrix of a node in its parent's space, (4, 4) float64."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * node.get("scale", (1, 1, 1))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
