"""The reference of light probes: Cycles bakes small white spheres, projected to spherical harmonics."""

from __future__ import annotations

import importlib

import bpy
import numpy as np

from tools.headless import MODULE
from tools.verification.cycles import RealisedScene

#: Radius of a sphere, of the distance between the outermost points, and side of its facets, of the radius. A
#: sphere must be much smaller than anything in a scene: 1 mm was too much for a house of 45 cm.
_RADIUS, _SIDE = 1e-4, 0.1

#: Facets of a sphere, one texel each.
_FACETS = 1800

#: Higher bands of E/pi that are fitted with SH L2; the cosine lobe has no odd ones. Without them, band 4
#: leaves up to 1.4 % in band 2 near a small light, since the facets sample it.
_HIGHER = (4, 6, 8)


def bake_probes(reference: RealisedScene, points: np.ndarray, samples: int, seed: int) -> np.ndarray:
    """Return radiance SH L2 at points, (n, 3) in world space, as Cycles bakes it, (n, 9, 3) float64.

    A sphere consists of separate facets in the directions of the engine's quadrature, each of which fills a
    texel. SH are fitted to E/pi, and divided by the factors of the cosine lobe.

    samples:  paths of each facet
    """
    harmonics = importlib.import_module(f"{MODULE}.engine.probes.spherical_harmonics")
    normals = importlib.import_module(f"{MODULE}.engine.probes.sphere_directions").sphere_directions(_FACETS)
    width = len(normals)
    mesh = _facets(points, normals)
    image = bpy.data.images.new("Probes", width, len(points), alpha=True, float_buffer=True)
    light = reference.bake_mesh(mesh, image, samples, seed)[..., :3].astype(np.float64)
    bpy.data.images.remove(image)
    # A band is spanned by Legendre polynomials around any directions of general position.
    axes = importlib.import_module(f"{MODULE}.engine.probes.sphere_directions").sphere_directions(60)
    higher = [np.polynomial.Legendre.basis(band)(normals @ axes.T) for band in _HIGHER]
    functions = np.concatenate([harmonics.basis(normals), *higher], axis=1)
    fitted = np.linalg.pinv(functions)[: len(harmonics.BANDS)]
    return np.einsum("pnc,kn->pkc", light, fitted) / harmonics.IRRADIANCE_FACTORS[:, None]


def _facets(points: np.ndarray, normals: np.ndarray) -> bpy.types.Mesh:
    """Return a mesh with a quad for each point, (n, 3), and normal, (m, 3), by row and column of an image."""
    radius = _RADIUS * np.linalg.norm(points.max(axis=0) - points.min(axis=0))
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0, 1]], [[1.0, 0, 0]])
    across = np.cross(helper, normals)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(normals, across)
    steps = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * _SIDE * radius / 2
    corners = radius * normals[:, None] + steps[:, :1] * across[:, None] + steps[:, 1:] * up[:, None]
    vertices = (points[:, None, None] + corners).reshape(-1, 3)
    mesh = bpy.data.meshes.new("Probes")
    faces = np.arange(len(vertices)).reshape(-1, 4)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    layer = importlib.import_module(f"{MODULE}.operators.scene.materials.shader_bake").LIGHTMAP_UVS
    row, column = np.divmod(np.arange(len(faces)), len(normals))
    place = np.stack([column, row], axis=1)[:, None] + (np.sign(steps) + 1) / 2
    uvs = (place / [len(normals), len(points)]).astype(np.float32)
    mesh.uv_layers.new(name=layer).uv.foreach_set("vector", uvs.reshape(-1))
    return mesh
