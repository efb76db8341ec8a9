"""Detection of walls thinner than two texels, through which interpolation leaks light, and their warning."""

from __future__ import annotations

import numpy as np

from ..array_ops import range_members, row_products
from ..object_message import object_message
from ..patches.patch_scene import PatchScene
from ..scene.model import Scene
from ..validity.push_off import PushOffs
from .texel_samples import TexelSamples

#: Relative difference between both sides of a wall above which light leaks visibly (chosen).
_DIFFERS = 0.25

#: The warning advises a higher texel density only up to this multiple of the present one (chosen). Lightmaps
#: of 8 times the density have 64 times as many texels.
_ADVISED = 8.0

#: Thickness in texels from which no bilinear lookup reads texels on both sides of a wall.
_PARTING = 2.0

#: Pairs of a texel and a wall that are compared at once (chosen): about 16 kB each with 16 samples a texel.
_AT_ONCE = 1 << 11


def in_thin_walls(
    patch_scene: PatchScene,
    samples: TexelSamples,
    push_offs: PushOffs,
    visible: np.ndarray,
    light: np.ndarray,
) -> np.ndarray:
    """Return the samples, (k,) int64, inside walls thinner than two texels that part light from dark.

    All visible samples within one texel on one side of the wall are darker by `_DIFFERS` than the mean on the
    other side. Neither a shadow at the foot of a wall that is lit on both sides counts, nor a pocket, whose
    samples are enclosed.

    patch_scene:  patches of the scene
    samples:      samples of all texels
    push_offs:    push-offs of the samples
    visible:      (s,) bool, valid samples
    light:        (s,) float32, E/pi, sum of the channels
    """
    chosen = np.flatnonzero(np.isfinite(push_offs.thickness) & (push_offs.wall >= 0))
    width = _texel(patch_scene, samples, push_offs.rows[chosen])
    chosen = chosen[push_offs.thickness[chosen] < _PARTING * width]
    thin = push_offs.rows[chosen]
    if not len(thin):
        return thin
    is_outside = visible & ~push_offs.enclosed
    is_outside[push_offs.rows[push_offs.wall >= 0]] = False
    resolution, triangles = patch_scene.patches.resolution, len(patch_scene.triangles.positions)
    keys = samples.subset(thin).keys(resolution)
    places, number = np.unique(keys * triangles + push_offs.wall[chosen], return_inverse=True)
    known, parts = samples.texels(resolution), np.zeros(len(places), bool)
    for first in range(0, len(places), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        texels, walls = np.divmod(places[some], triangles)
        place, beside = _samples_around(texels, known, samples.starts, len(samples), resolution)
        found = is_outside[beside]
        place, beside = place[found], beside[found]
        side = 2 * place + _is_in_front(patch_scene, samples, beside, walls[place])
        mean, most = _light_of_sides(side, light[beside], len(texels))
        parts[some] = (most[:, ::-1] < (1 - _DIFFERS) * mean).any(axis=1)
    return thin[parts[number]]


def _is_in_front(
    patch_scene: PatchScene, samples: TexelSamples, chosen: np.ndarray, walls: np.ndarray
) -> np.ndarray:
    """Return a mask of chosen samples, (k,) int64, in front of the planes of triangles, (k,): (k,) bool."""
    triangles = patch_scene.triangles
    points = np.einsum(
        "kc,kcd->kd", samples.barycentric[chosen], triangles.positions[samples.triangle[chosen]]
    )
    from_corner = points - triangles.positions[walls, 0]
    in_front: np.ndarray = row_products(from_corner, patch_scene.geometry.steps.geometric[walls]) > 0
    return in_front


def _light_of_sides(side: np.ndarray, light: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean and the maximum light on both sides of walls, (count, 2) each; 0 and inf for none.

    side:   (k,) int64, twice the number of the wall, plus 1 for samples in front of it
    light:  (k,) float32, light of the samples
    """
    number = np.bincount(side, minlength=2 * count)
    mean = np.bincount(side, light, 2 * count) / np.maximum(number, 1)
    most = np.where(number > 0, 0.0, np.inf)
    np.maximum.at(most, side, light)
    return mean.reshape(count, 2), most.reshape(count, 2)


def warn_thin_walls(
    scene: Scene, patch_scene: PatchScene, samples: TexelSamples, push_offs: PushOffs, inside: np.ndarray
) -> list[str]:
    """Return a warning: names of the walls around samples `inside`, (k,) int64, and the remedy."""
    if not len(inside):
        return []
    chosen = np.searchsorted(push_offs.rows, inside)
    meshes = np.unique(patch_scene.triangles.mesh[push_offs.wall[chosen]])

    # Texel density at which a texel is thin enough to separate both sides, at the thinnest place.
    units = 1 / scene.metres_per_unit
    density = units * float((_PARTING / np.maximum(push_offs.thickness[chosen], 1e-6)).max())
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


def _samples_around(
    texels: np.ndarray, known: np.ndarray, starts: np.ndarray, samples: int, resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of texels and the samples within one texel of them: indices (k,) int64 of both.

    texels:   (t,) int64, atlas * r * r + texel
    known:    (m,) int64, texels with samples, ascending, at least one
    starts:   (m,) int64, first sample of each
    samples:  number of samples
    """
    count = np.diff(starts, append=samples)
    pairs = []
    for there, here in _steps_around(known, texels, resolution):
        of_pair = count[there]
        pairs.append((np.repeat(here, of_pair), range_members(starts[there], of_pair)))
    place, sample = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
    return place, sample


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
