"""Walls that texels cannot part: light shows through to the other side, which the report tells."""

from __future__ import annotations

import numpy as np

from ..naming import naming
from ..patches.subdivision import Subdivision
from ..scene.model import Scene
from .display_samples import DisplaySamples
from .push_out import WaysOut

#: Light on both sides that differs by more than this part shows through.
_DIFFERS = 0.25

#: Texels within the thickness of a wall from which on no texel is shown on both of its sides.
_PARTING = 2.0


def note_thin_walls(
    scene: Scene,
    parts: Subdivision,
    samples: DisplaySamples,
    ways: WaysOut,
    visible: np.ndarray,
    light: np.ndarray,
) -> list[str]:
    """Return a warning that names objects thinner than two texels through which light shows.

    visible  (s,) bool, samples that somebody sees
    light    (s, 3) float32, E/pi
    """
    thin = np.flatnonzero(np.isfinite(ways.thickness) & (ways.wall >= 0))
    outside = np.flatnonzero(visible & (ways.wall < 0))
    if not len(thin) or not len(outside):
        return []
    least, most = _extremes_around(parts.patches.resolution, samples, outside, light.sum(axis=1)[outside])
    key = _keys(samples, parts.patches.resolution)[thin]
    shows = thin[most[key] - least[key] > _DIFFERS * most[key]]

    # The density that parts both sides, of each wall where it is thinnest.
    texel = np.sqrt(parts.geometry.steps.area[samples.triangle[shows]])
    part = ways.thickness[shows] < _PARTING * texel
    shows, texel = shows[part], texel[part]
    if not len(shows):
        return []
    meshes = np.unique(parts.triangles.mesh[ways.wall[shows]])
    density = float((_PARTING / np.maximum(ways.thickness[shows], 1e-6)).max())
    sentence = (
        "{}: thinner than two texels of what they stand on, so light shows up to a texel behind them. "
        f"{_rounded(density)} texels per metre would part both sides, now there are "
        f"{_rounded(1 / texel.max())}; "
        "or cut the lightmap UVs along them."
    )
    return [naming(sentence, [scene.meshes[mesh].name for mesh in meshes])]


def _rounded(density: float) -> str:
    """Return a density with at least two digits, such as 1,234 or 0.017."""
    return f"{density:,.0f}" if density >= 10 else f"{density:.2g}"


def _keys(samples: DisplaySamples, resolution: int) -> np.ndarray:
    """Return atlas * r * r + texel of samples, (s,) int64."""
    keys: np.ndarray = samples.atlas.astype(np.int64) * resolution**2 + samples.texel
    return keys


def _extremes_around(
    resolution: int, samples: DisplaySamples, chosen: np.ndarray, light: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest light of chosen samples within a texel of each texel.

    light: (c,) of the chosen samples. Returns (a * r * r,) each; inf and -inf where there is none.
    """
    keys = _keys(samples, resolution)
    shape = (int(samples.atlas.max()) + 1, resolution, resolution)
    least, most = np.full(shape, np.inf), np.full(shape, -np.inf)
    np.minimum.at(least.ravel(), keys[chosen], light)
    np.maximum.at(most.ravel(), keys[chosen], light)
    return _spread(least, np.minimum), _spread(most, np.maximum)


def _spread(values: np.ndarray, extreme: np.ufunc) -> np.ndarray:
    """Return the extreme of each texel and its eight neighbours, flat."""
    for axis in (1, 2):
        before, after = np.swapaxes(values, 0, axis)[:-1], np.swapaxes(values, 0, axis)[1:]
        result = values.copy()
        view = np.swapaxes(result, 0, axis)
        view[1:] = extreme(view[1:], before)
        view[:-1] = extreme(view[:-1], after)
        values = result
    return values.ravel()
