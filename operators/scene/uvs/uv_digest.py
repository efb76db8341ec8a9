"""Digests of UV layers: they tell whether lightmap UVs are those of before."""

from __future__ import annotations

import hashlib

import bpy
import numpy as np

from ..objects.meshes import read_uvs


def layer_uvs(mesh: bpy.types.Mesh, name: str) -> np.ndarray:
    """Return a UV layer of a mesh, (l, 2) float32."""
    return read_uvs(mesh.uv_layers[name])


def digest_of(uvs: np.ndarray) -> str:
    """Return a text that tells UVs, (l, 2) float32, from others."""
    return hashlib.sha256(np.ascontiguousarray(uvs, np.float32).tobytes()).hexdigest()
