"""Reads the glTF files that an export has written."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import unquote

import numpy as np

_DTYPES = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class GltfFile:
    """A .glb or .gltf file.

    json  what it says
    """

    def __init__(self, path: Path) -> None:
        self._folder, data = path.parent, path.read_bytes()
        if data[:4] == b"glTF":
            length = int.from_bytes(data[12:16], "little")
            self.json = json.loads(data[20 : 20 + length])
            self._buffer = data[28 + length :]
        else:
            self.json = json.loads(data)
            self._buffer = (self._folder / unquote(self.json["buffers"][0]["uri"])).read_bytes()

    def nodes(self, name: str) -> list[dict]:
        """Return the nodes of a name that have a mesh."""
        return [node for node in self.json["nodes"] if node.get("name") == name and "mesh" in node]

    def primitives(self, node: dict) -> list[dict]:
        return self.json["meshes"][node["mesh"]]["primitives"]

    def values(self, number: int) -> np.ndarray:
        """Return the values of an accessor, (n, width)."""
        accessor = self.json["accessors"][number]
        dtype, width = _DTYPES[accessor["componentType"]], _WIDTHS[accessor["type"]]
        data = self._view(accessor["bufferView"])
        return np.frombuffer(data, dtype, accessor["count"] * width).reshape(-1, width)

    def corners(self, node: dict, uv_set: int = 1) -> np.ndarray:
        """Return position and UV of all vertices, (n, 5), in Blender's axes, sorted, each once."""
        parts = []
        for primitive in self.primitives(node):
            sets = primitive["attributes"]
            x, y, z = self.values(sets["POSITION"]).T
            u, v = self.values(sets[f"TEXCOORD_{uv_set}"]).T
            parts.append(np.stack([x, -z, y, u, 1 - v], axis=1))
        return unique_rows(np.concatenate(parts))

    def lightmap(self, material: int) -> tuple[dict, dict]:
        """Return the extension of a material, and the image that it leads to."""
        extension = self.json["materials"][material]["extensions"]["MOZ_lightmap"]
        texture = self.json["textures"][extension["index"]]
        source = (
            texture["source"] if "source" in texture else texture["extensions"]["MOZ_texture_rgbe"]["source"]
        )
        return extension, self.json["images"][source]

    def image_bytes(self, image: dict) -> bytes:
        if "uri" in image:
            return (self._folder / unquote(image["uri"])).read_bytes()
        return self._view(image["bufferView"])

    def _view(self, number: int) -> bytes:
        view = self.json["bufferViews"][number]
        start = view.get("byteOffset", 0)
        return self._buffer[start : start + view["byteLength"]]


def unique_rows(rows: np.ndarray) -> np.ndarray:
    """Return rows sorted, each once, in steps of 1e-5."""
    return np.unique(np.round(rows.astype(np.float64), 5) + 0.0, axis=0)
