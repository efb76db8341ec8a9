"""Repair of probes inside geometry: their way out, and the fill from valid neighbours."""

from __future__ import annotations

import itertools

import numpy as np

from ..scene.probe_volume import ProbeVolume

#: Distance of a moved probe from the surface that it left, as a fraction of the smallest cell width (chosen).
_BEYOND = 0.05

#: Steps along the grid to the 26 neighbours of a probe.
_NEIGHBOURS = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]


def moved_out(volume: ProbeVolume, ways: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where to move probes, (k, 3) float64 offsets in m, and which of them stay in their cells, (k,).

    ways, distances:  see `ProbeRows.ways_out`
    """
    lengths = np.linalg.norm(ways, axis=1).astype(np.float64)
    found = np.isfinite(distances) & (lengths > 0)
    factor = np.where(found, 1 + _BEYOND * volume.spacing / np.maximum(lengths, 1e-30), 0)
    offsets = ways.astype(np.float64) * factor[:, None]
    in_cells = offsets @ np.linalg.inv(volume.steps)
    return offsets, found & (np.abs(in_cells) < 0.5).all(axis=1)


def filled(coefficients: np.ndarray, valid: np.ndarray, volume: ProbeVolume) -> np.ndarray:
    """Return coefficients, (n, 9, 3) float32, with those of invalid probes from valid neighbours.

    Each is the mean of its valid neighbours, weighted by the inverse square of their distance; neighbours of
    filled probes follow. Without any valid probe nothing changes.

    valid:  (n,) bool
    """
    if valid.all() or not valid.any():
        return coefficients
    shape = volume.resolution[::-1]
    made = coefficients.reshape(*shape, -1).astype(np.float64)
    known = valid.reshape(shape).copy()
    while not known.all():
        sums, weights = np.zeros_like(made), np.zeros(shape)
        for step in _NEIGHBOURS:
            here, there = _shifted(shape, step)
            weight = known[there] / np.square(np.array(step) @ volume.steps).sum()
            sums[here] += made[there] * weight[..., None]
            weights[here] += weight
        reached = ~known & (weights > 0)
        made[reached] = sums[reached] / weights[reached][:, None]
        known |= reached
    return made.reshape(coefficients.shape).astype(np.float32)


def _shifted(shape: tuple[int, ...], step: tuple[int, ...]) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return slices of an array (z, y, x) and of the neighbours at a step along x, y and z."""
    steps = step[::-1]
    here = tuple(slice(max(-d, 0), size - max(d, 0)) for d, size in zip(steps, shape, strict=True))
    there = tuple(slice(max(d, 0), size - max(-d, 0)) for d, size in zip(steps, shape, strict=True))
    return here, there
