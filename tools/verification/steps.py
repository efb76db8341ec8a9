"""Steps of light across chart borders, found independently of the engine by comparing all edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Points on each edge, the distance at which surfaces meet, m, and the cosine from which normals are alike.
_POINTS, _NEAR, _ALIKE = 5, 1e-4, 0.999


@dataclass(frozen=True)
class Border:
    """Points on both sides of borders, each where two charts meet on one smooth surface.

    atlas:   (p, 2) int
    uv:      (p, 2, 2) float64
    run:     (p, 2, 2) float64, UV along the part of the border that a pair stands for, in whose middle it is
    length:  (p,) float64, m, of that part
    """

    atlas: np.ndarray
    uv: np.ndarray
    run: np.ndarray
    length: np.ndarray

    def read(self, resolution: int, atlases: int) -> np.ndarray:
        """Return the texels, (atlases, r, r) bool, that bilinear look-ups along borders read."""
        found = np.zeros((atlases, resolution, resolution), bool)
        pieces = int(np.ceil(np.abs(self.run).max(initial=0) * resolution)) * 2 + 1
        for part in np.linspace(-0.5, 0.5, pieces):
            for side in (0, 1):
                place = (self.uv[:, side] + part * self.run[:, side]) * resolution - 0.5
                column, row = np.floor(place).astype(int).T
                for right, up in ((0, 0), (1, 0), (0, 1), (1, 1)):
                    texel = (np.clip(line, 0, resolution - 1) for line in (row + up, column + right))
                    found[(self.atlas[:, side], *texel)] = True
        return found

    def steps(self, images: np.ndarray) -> np.ndarray:
        """Return the difference of the light on both sides, (p,), relative to the mean light of all borders.

        images: (atlases, h, w, 3) float32, shown with bilinear interpolation
        """
        sides = [shown(images, self.atlas[:, side], self.uv[:, side]) for side in (0, 1)]
        steps: np.ndarray = np.abs(sides[0] - sides[1]).mean(axis=1) / np.mean(sides)
        return steps


def shown(images: np.ndarray, atlas: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Return lightmap values at UVs, (p, 3), as a renderer displays them: bilinear interpolation."""
    height, width = images.shape[1:3]
    place = uv * (width, height) - 0.5
    low = np.floor(place).astype(int)
    total = np.zeros((len(uv), 3))
    for right, up in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.clip(low[:, 0] + right, 0, width - 1), np.clip(low[:, 1] + up, 0, height - 1)
        weights = np.abs(1 - np.array([right, up]) - (place - low)).prod(axis=1)
        total += weights[:, None] * images[atlas, row, column]
    return total


def find_border(scene) -> Border:
    """Return where charts of an engine's scene meet."""
    ends, normals, uvs, atlas = _outlines(scene)
    along = (np.arange(_POINTS) + 0.5) / _POINTS
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    first, other, where, there = [], [], [], []
    for edge in range(len(ends)):
        points = ends[edge, 0] + along[:, None] * (ends[edge, 1] - ends[edge, 0])
        normal = normals[edge, 0] + along[:, None] * (normals[edge, 1] - normals[edge, 0])
        run = ends[:, 1] - ends[:, 0]
        t = np.clip(np.einsum("pod,od->po", points[:, None] - ends[:, 0], run) / length**2, 0, 1)
        apart = np.linalg.norm(points[:, None] - (ends[:, 0] + t[..., None] * run), axis=2)
        facing = normals[:, 0] + t[..., None] * (normals[:, 1] - normals[:, 0])
        cosine = np.einsum("pd,pod->po", normal, facing)
        cosine /= np.linalg.norm(normal, axis=1)[:, None] * np.linalg.norm(facing, axis=2)
        point, met = np.nonzero((apart < _NEAR) & (cosine > _ALIKE) & (np.arange(len(ends)) > edge))
        first.append(np.full(len(met), edge)), other.append(met)
        where.append(along[point]), there.append(t[point, met])
    pair = np.stack([np.concatenate(first), np.concatenate(other)], axis=1)
    place = np.stack([np.concatenate(where), np.concatenate(there)], axis=1)[..., None]
    uv = uvs[pair, 0] + place * (uvs[pair, 1] - uvs[pair, 0])
    own, met = (ends[pair[:, side], 1] - ends[pair[:, side], 0] for side in (0, 1))
    pace = np.stack([np.ones(len(pair)), (own * met).sum(axis=1) / length[pair[:, 1]] ** 2], axis=1)
    run = pace[..., None] * (uvs[pair, 1] - uvs[pair, 0]) / _POINTS
    apart = (np.abs(uv[:, 0] - uv[:, 1]).max(axis=1) > 1e-4) | (atlas[pair[:, 0]] != atlas[pair[:, 1]])
    return Border(atlas[pair][apart], uv[apart], run[apart], length[pair[apart, 0]] / _POINTS)


def _outlines(scene) -> tuple[np.ndarray, ...]:
    """Return ends (e, 2, 3), normals (e, 2, 3), uvs (e, 2, 2) and atlas (e,) of edges that end a chart."""
    found: dict[tuple, list] = {}
    for mesh in scene.meshes:
        if mesh.atlas < 0:
            continue
        for position, normal, uv in zip(mesh.positions, mesh.normals, mesh.uvs, strict=True):
            for start, end in ((0, 1), (1, 2), (2, 0)):
                chosen = [start, end]
                corners = sorted((*position[k].tolist(), *uv[k].tolist()) for k in chosen)
                entry = position[chosen], normal[chosen], uv[chosen], mesh.atlas
                found.setdefault((mesh.atlas, *corners), []).append(entry)
    alone = [entries[0] for entries in found.values() if len(entries) == 1]
    arrays = [np.array([entry[k] for entry in alone], float) for k in range(3)]
    return *arrays, np.array([entry[3] for entry in alone])
