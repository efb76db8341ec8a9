"""Walls that texels cannot part: light shows through to the other side, which the report tells."""

from __future__ import annotations

import numpy as np

from ..object_message import object_message
from ..patches.patch_scene import PatchScene
from ..scene.model import Scene
from ..sorted_runs import run_starts
from .push_off import PushOffs
from .texel_samples import TexelSamples

#: Light on both sides that differs by more than this part shows through.
_DIFFERS = 0.25

#: A wall that is at least this many texels thick parts both sides: none is interpolated on both.
_PARTING = 2.0


def in_thin_walls(
    parts: PatchScene, samples: TexelSamples, ways: PushOffs, visible: np.ndarray, light: np.ndarray
) -> np.ndarray:
    """Return the samples, (k,) int64, inside of things thinner than two texels with other light behind them.

    visible  (s,) bool, samples that somebody sees
    light    (s,) float32, E/pi, sum of the channels
    """
    thin = np.flatnonzero(np.isfinite(ways.thickness) & (ways.wall >= 0))
    outside = np.flatnonzero(visible & (ways.wall < 0))
    if not len(thin) or not len(outside):
        return thin[:0]
    keys, resolution = samples.keys(parts.patches.resolution), parts.patches.resolution
    texels, number = np.unique(keys[thin], return_inverse=True)
    least, most = _extremes_around(texels, keys[outside], light[outside], resolution)
    shows = thin[(most - least > _DIFFERS * most)[number]]
    return shows[ways.thickness[shows] < _PARTING * _texel(parts, samples, shows)]


def warn_thin_walls(
    scene: Scene, parts: PatchScene, samples: TexelSamples, ways: PushOffs, inside: np.ndarray
) -> list[str]:
    """Return a warning that names the walls that samples, (k,) int64, are inside of; see `in_thin_walls`."""
    if not len(inside):
        return []
    meshes = np.unique(parts.triangles.mesh[ways.wall[inside]])

    # The density that parts both sides, of each wall where it is thinnest.
    units = 1 / scene.metres_per_unit
    density = units * float((_PARTING / np.maximum(ways.thickness[inside], 1e-6)).max())
    now = units / float(_texel(parts, samples, inside).max())
    sentence = (
        "{}: thinner than two texels of what they stand on, so light is wrong up to a texel beside them. "
        f"{_rounded(density)} texels per metre would part both sides, now there are {_rounded(now)}; "
        "or cut the lightmap UVs along them."
    )
    return [object_message(sentence, [scene.meshes[mesh].name for mesh in meshes], "cut_along_walls")]


def _texel(parts: PatchScene, samples: TexelSamples, chosen: np.ndarray) -> np.ndarray:
    """Return how wide the texels of chosen samples are, (k,), m."""
    width: np.ndarray = np.sqrt(parts.geometry.steps.area[samples.triangle[chosen]])
    return width


def _rounded(density: float) -> str:
    """Return a density with at least two digits, such as 1,234 or 0.017."""
    return f"{density:,.0f}" if density >= 10 else f"{density:.2g}"


def _extremes_around(
    texels: np.ndarray, keys: np.ndarray, light: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest light of samples within a texel of each texel, (k,) float32 each.

    Where there are no samples these are inf and 0.

    texels  (k,) int64, atlas * r * r + texel
    keys    (c,) int64, ascending, those of the samples
    light   (c,) float32, of the samples, one at least
    """
    starts = run_starts(keys)
    steps, found = _steps_around(keys[starts], texels, resolution), []
    for extreme, without in ((np.minimum, np.inf), (np.maximum, 0)):
        of_texel, around = extreme.reduceat(light, starts), np.full(len(texels), without, np.float32)
        for there, here in steps:
            around[here] = extreme(around[here], of_texel[there])
        found.append(around)
    return found[0], found[1]


def _steps_around(
    texels: np.ndarray, around: np.ndarray, resolution: int
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return, for each of 3 x 3 steps, the numbers of texels that lie a step beside others, and of these.

    texels  (n,) int64, ascending, atlas * r * r + texel
    around  (m,) int64, the others
    """
    found = []
    row, column = np.divmod(around % resolution**2, resolution)
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            key = around + up * resolution + right
            number = np.minimum(np.searchsorted(texels, key), max(len(texels) - 1, 0))
            inside = (row + up >= 0) & (row + up < resolution) & (column + right >= 0)
            inside &= column + right < resolution
            there = np.flatnonzero(inside & (texels[number] == key)) if len(texels) else row[:0]
            found.append((number[there], there))
    return found
