"""Difference of two lightmaps without the noise of the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: A texel is on an edge of light if its 3 x 3 neighbourhood spans more than this fraction of the mean.
_EDGE = 0.5

#: Reflectance below which Cycles' bake gives no light.
BLACK = 0.01


@dataclass(frozen=True)
class Difference:
    """Relative figures over all channels of the texels that both cover.

    rmse, bias:  root of the mean squared error and mean error, relative to the reference's mean
    local:       rmse with each error relative to the mean, or to the light of its texel if that is brighter:
                 a few texels beside a lamp cannot outweigh all others
    smooth:      rmse off the edges of light
    noise:       of the reference's mean, taken out of both rmse
    texels:      compared; hidden: left out, since they are inside of something or black
    edges:       fraction of the texels that are on an edge of light
    """

    rmse: float
    bias: float
    local: float
    smooth: float
    noise: float
    texels: int
    hidden: int
    edges: float


def weight_of(colour: np.ndarray) -> np.ndarray:
    """Return the weight of channels, (atlases, h, w, 3) float32, that reflect something.

    colour: what is reflected; Cycles tells no light in channels where it is 0.
    """
    weight: np.ndarray = (colour > BLACK).astype(np.float32)
    return weight


def compare(
    ours: np.ndarray, known: np.ndarray, weight: np.ndarray, bakes: tuple[np.ndarray, np.ndarray]
) -> tuple[Difference, np.ndarray]:
    """Return the figures, and the difference relative to the mean, (atlases, h, w, 3), 0 where left out.

    ours:    (atlases, h, w, 3) float32, E/pi
    known:   (atlases, h, w) bool, has a patch that is not hidden inside of something
    weight:  (atlases, h, w, 3) float32, of each channel of each texel; 0 where it is not known
    bakes:   two independent bakes of Cycles, (atlases, h, w, 4): the mean of (ours - first) times (ours -
             second) is the squared error without their noise
    """
    first, second = (bake[..., :3].astype(np.float64) for bake in bakes)
    baked = bakes[0][..., 3] > 0
    used = (known & baked)[..., None] & (weight > 0)
    truth = (first + second) / 2
    mean = np.average(truth[used], weights=weight[used]) if used.any() else 0.0
    if mean == 0:
        raise SystemExit("Cycles sees no light in this scene: there is nothing to compare.")
    edge = edges_of_light(truth, used.any(axis=-1), mean)
    difference = np.where(used, (ours - truth) / mean, 0)
    ours = ours.astype(np.float64)
    error = (ours - first) * (ours - second)
    noise = (first - second) ** 2
    return (
        Difference(
            rmse=_root(error, weight, used) / mean,
            bias=float(np.average((ours - truth)[used], weights=weight[used]) / mean),
            local=_root(error / np.maximum(truth, mean) ** 2, weight, used),
            smooth=_root(error, weight, used & ~edge[..., None]) / mean,
            noise=_root(noise, weight, used) / 2 / mean,
            texels=int(used.any(axis=-1).sum()),
            hidden=int((baked & ~used.any(axis=-1)).sum()),
            edges=float(edge[used.any(axis=-1)].mean()),
        ),
        difference,
    )


def _root(squares: np.ndarray, weight: np.ndarray, used: np.ndarray) -> float:
    """Return the root of a weighted mean, 0 if that is negative."""
    if not used.any():
        return 0.0
    return float(np.sqrt(max(0.0, np.average(squares[used], weights=weight[used]))))


def edges_of_light(truth: np.ndarray, used: np.ndarray, mean: float) -> np.ndarray:
    """Return the texels, (atlases, h, w) bool, whose neighbours that are used differ much."""
    grey = truth.mean(axis=-1)
    low, high = np.where(used, grey, np.inf), np.where(used, grey, -np.inf)
    lowest, highest = low.copy(), high.copy()
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            lowest = np.minimum(lowest, _shifted(low, dy, dx, np.inf))
            highest = np.maximum(highest, _shifted(high, dy, dx, -np.inf))
    return used & (highest - lowest > _EDGE * mean)


def _shifted(image: np.ndarray, dy: int, dx: int, outside: float) -> np.ndarray:
    padded = np.pad(image, ((0, 0), (1, 1), (1, 1)), constant_values=outside)
    height, width = image.shape[1:]
    return padded[:, 1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]
