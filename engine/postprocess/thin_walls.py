"""Detection of walls thinner than two texels, through which interpolation leaks light, and their warning."""

from __future__ import annotations

import numpy as np

from ..array_ops import run_starts
from ..object_message import object_message
from ..patches.patch_scene import PatchScene
from ..scene.model import Scene
from ..validity.push_off import PushOffs
from .texel_samples import TexelSamples

#: Relative difference between both sides above which light leaks visibly (chosen).
_DIFFERS = 0.25

#: The warning advises a higher texel density only up to this multiple of the present one (chosen). Lightmaps
#: of 8 times the density have 64 times as many texels.
_ADVISED = 8.0

#: Thickness in texels from which no bilinear lookup reads texels on both sides of a wall.
_PARTING = 2.0


def in_thin_walls(
    patch_scene: PatchScene,
    samples: TexelSamples,
    push_offs: PushOffs,
    visible: np.ndarray,
    light: np.ndarray,
) -> np.ndarray:
    """Return the samples, (k,) int64, inside walls thinner than two texels with different light behind them.

    patch_scene:  patches of the scene
    samples:      samples of all texels
    push_offs:    push-offs of the samples
    visible:      (s,) bool, valid samples
    light:        (s,) float32, E/pi, sum of the channels
    """
    thin = np.flatnonzero(np.isfinite(push_offs.thickness) & (push_offs.wall >= 0))
    outside = np.flatnonzero(visible & (push_offs.wall < 0))
    if not len(thin) or not len(outside):
        return thin[:0]
    keys, resolution = samples.keys(patch_scene.patches.resolution), patch_scene.patches.resolution
    texels, number = np.unique(keys[thin], return_inverse=True)
    least, most = _extremes_around(texels, keys[outside], light[outside], resolution)
    shows = thin[(most - least > _DIFFERS * most)[number]]
    return shows[push_offs.thickness[shows] < _PARTING * _texel(patch_scene, samples, shows)]


def warn_thin_walls(
    scene: Scene, patch_scene: PatchScene, samples: TexelSamples, push_offs: PushOffs, inside: np.ndarray
) -> list[str]:
    """Return a warning: names of the walls around samples `inside`, (k,) int64, and the remedy."""
    if not len(inside):
        return []
    meshes = np.unique(patch_scene.triangles.mesh[push_offs.wall[inside]])

    # Texel density at which a texel is thin enough to separate both sides, at the thinnest place.
    units = 1 / scene.metres_per_unit
    density = units * float((_PARTING / np.maximum(push_offs.thickness[inside], 1e-6)).max())
    now = units / float(_texel(patch_scene, samples, inside).max())
    remedy = "Cut the lightmap UVs along the wall."
    if density <= _ADVISED * now:
        remedy = (
            f"Use {_rounded(density)} texels per metre (now {_rounded(now)}) "
            "or cut the lightmap UVs along the wall."
        )
    sentence = f"{{}}: wall thinner than two texels, so light leaks next to it. {remedy}"
    names = list(dict.fromkeys(scene.meshes[mesh].name for mesh in meshes))
    return [object_message(sentence, names, "cut_along_walls")]


def _texel(patch_scene: PatchScene, samples: TexelSamples, chosen: np.ndarray) -> np.ndarray:
    """Return the texel width at chosen samples, (k,), m."""
    width: np.ndarray = np.sqrt(patch_scene.geometry.steps.area[samples.triangle[chosen]])
    return width


def _rounded(density: float) -> str:
    """Return a density as text with at least two digits, such as 1,234 or 0.017."""
    return f"{density:,.0f}" if density >= 10 else f"{density:.2g}"


def _extremes_around(
    texels: np.ndarray, keys: np.ndarray, light: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the minimum and maximum light of samples within one texel of each texel, (k,) float32 each.

    They are inf and 0 where there are no samples.

    texels:  (k,) int64, atlas * r * r + texel
    keys:    (c,) int64, texel of each sample, ascending
    light:   (c,) float32, light of the samples, at least one
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
    """Return matching index pairs of neighbouring texels for each of the 3 x 3 offsets.

    texels:  (n,) int64, ascending, atlas * r * r + texel
    around:  (m,) int64, texels whose neighbours are searched

    Each pair holds indices into `texels` and the indices into `around` of their neighbours.
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
