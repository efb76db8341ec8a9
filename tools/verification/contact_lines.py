"""Light beside contact lines: a lightmap and Cycles at the same points."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace

import numpy as np

from tools.headless import MODULE
from tools.verification.contact_scenes import Contacts, Line
from tools.verification.cycles import realised
from tools.verification.run import read_for_bake
from tools.verification.steps import shown

#: Points along a line, and as many across it.
_POINTS = 48

#: How far from a line points lie, texels.
_REACH = 3.0

#: Settings of the lightmap that shows light at texels' centres.
CENTRES = {"texel_samples": 1, "hide_seams": False}


@dataclass(frozen=True)
class Beside:
    """Light beside lines; row k of `_POINTS` lies (k + 1/2) * _REACH / _POINTS texels from the line.

    ours:   (lightmaps, lines, rows, points, 3), of each lightmap
    bakes:  (2, lines, rows, points, 3), of Cycles, with independent noise
    texel:  m, width of texels
    """

    ours: np.ndarray
    bakes: np.ndarray
    texel: float

    def off(self, number: int, low: float, high: float) -> tuple[float, float]:
        """Return mean and RMS difference of a lightmap from Cycles at some distance from lines, texels.

        Both are relative to Cycles' mean there; noise of Cycles is not in the RMS.
        """
        rows = slice(*(round(edge * _POINTS / _REACH) for edge in (low, high)))
        ours, (first, second) = self.ours[number][:, rows], self.bakes[:, :, rows]
        mean = (first + second).mean() / 2
        square = ((ours - first) * (ours - second)).mean()
        return float(ours.mean() / mean - 1), float(np.sqrt(max(square, 0.0)) / mean)


def beside_contacts(context, contacts: Contacts, samples: int) -> Beside:
    """Bake a scene by texel centres and by its settings, and its lines with Cycles."""
    engine = importlib.import_module(f"{MODULE}.engine")
    read, settings = read_for_bake(context)
    lightmaps = [
        engine.finished(engine.bake(read.scene, changed))
        for changed in (replace(settings, **CENTRES), settings)
    ]
    texel = _texel(read.scene, contacts.lines[0], settings.resolution)
    places = [_places(read.scene, line, _REACH * texel) for line in contacts.lines]
    ours = np.array(
        [[shown(each.display, *place).reshape(_POINTS, _POINTS, 3) for place in places] for each in lightmaps]
    )
    with realised(context, read, _POINTS) as reference:
        bakes = [
            reference.bake_strip(line.name, *_frame(line, _REACH * texel), samples, seed)
            for seed in (1, 2)
            for line in contacts.lines
        ]
    shape = (2, len(contacts.lines), _POINTS, _POINTS, 3)
    return Beside(ours, np.array(bakes).reshape(shape), texel)


def _frame(line: Line, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the corner of a strip beside a line, and its two sides, m."""
    return line.start, line.end - line.start, line.away * reach


def _places(scene, line: Line, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return atlas, (p,), and lightmap UV, (p, 2), of points beside a line, row by row away from it."""
    corner, along, away = _frame(line, reach)
    steps = (np.arange(_POINTS) + 0.5) / _POINTS
    points = corner + steps[None, :, None] * along + steps[:, None, None] * away
    mesh = next(mesh for mesh in scene.meshes if mesh.name == line.name)
    positions = mesh.positions.astype(np.float64) + scene.origin
    level = np.abs((positions - line.start) @ line.normal).max(axis=1) < 1e-4
    positions, uvs = positions[level], mesh.uvs[level].astype(np.float64)
    weights = _barycentric(points.reshape(-1, 3), positions)
    inside = weights.min(axis=2)
    triangle = inside.argmax(axis=1)
    if inside.max(axis=1).min() < -1e-3:
        raise SystemExit(f"A strip beside a line leaves the surface of {line.name}.")
    chosen = weights[np.arange(len(triangle)), triangle]
    uv = np.einsum("pk,pkd->pd", chosen, uvs[triangle])
    return np.full(len(uv), mesh.atlas), uv


def _barycentric(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return barycentric weights of points, (p, 3), in triangles, (t, 3, 3): (p, t, 3)."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(first, second)
    square = (normal**2).sum(axis=1)
    offset = points[:, None] - triangles[:, 0]
    v = (np.cross(offset, second) * normal).sum(axis=2) / square
    w = (np.cross(first[None], offset) * normal).sum(axis=2) / square
    return np.stack([1 - v - w, v, w], axis=2)


def _texel(scene, line: Line, resolution: int) -> float:
    """Return the width of texels of the mesh that a line is on, m."""
    mesh = next(mesh for mesh in scene.meshes if mesh.name == line.name)
    corners, uvs = mesh.positions.astype(np.float64), mesh.uvs.astype(np.float64)
    space = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = np.abs(np.cross(uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]))
    return float(np.sqrt(space.sum() / flat.sum()) / resolution)
