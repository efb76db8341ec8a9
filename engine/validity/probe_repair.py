"""Repair of probes inside geometry: push-off to the outside, and fill of the others from valid neighbours."""

from __future__ import annotations

import itertools
from collections.abc import Generator

import numpy as np

from ..scene.probe_volume import ProbeVolume

#: Distance of a moved probe from the surface that it left, as a fraction of the smallest cell width (chosen).
_BEYOND = 0.05

#: Steps along the grid to the 26 neighbours of a probe.
_NEIGHBOURS = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]

#: Probes that are filled at once, to limit memory and the time between two steps of progress.
_AT_ONCE = 1 << 14


def moved_out(volume: ProbeVolume, ways: np.ndarray, distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where to move probes, (k, 3) float64 offsets in m, and which of them stay in their cells, (k,).

    ways, distances:  see `ProbeRows.push_offs`
    """
    lengths = np.linalg.norm(ways, axis=1).astype(np.float64)
    found = np.isfinite(distances) & (lengths > 0)
    factor = np.where(found, 1 + _BEYOND * volume.spacing / np.maximum(lengths, 1e-30), 0)
    offsets = ways.astype(np.float64) * factor[:, None]
    in_cells = offsets @ np.linalg.inv(volume.steps)
    return offsets, found & (np.abs(in_cells) < 0.5).all(axis=1)


def filled(
    coefficients: np.ndarray, valid: np.ndarray, volume: ProbeVolume
) -> Generator[float, None, np.ndarray]:
    """Return coefficients, (n, 9, 3) float32, in which invalid probes are filled.

    Each invalid probe gets the mean of its valid neighbours, weighted by the inverse square of their
    distance; neighbours of filled probes follow. Without any valid probe nothing changes. Yields the fraction
    that is filled.

    valid:  (n,) bool
    """
    if valid.all() or not valid.any():
        return coefficients
    # A border of unknown probes on all sides keeps neighbours of the outermost in the array.
    shape = tuple(size + 2 for size in volume.resolution[::-1])
    inner = np.zeros(shape, bool)
    inner[1:-1, 1:-1, 1:-1] = True
    known, made = np.zeros(inner.size, bool), np.zeros((inner.size, coefficients[0].size), np.float32)
    inside = np.flatnonzero(inner)
    known[inside], made[inside] = valid, coefficients.reshape(len(valid), -1)
    offsets = np.array([np.dot(step[::-1], [shape[1] * shape[2], shape[2], 1]) for step in _NEIGHBOURS])
    weights = 1 / np.square(np.array(_NEIGHBOURS) @ volume.steps).sum(axis=1)
    ring, count = inside[~valid], int(valid.sum())
    while len(ring):
        reached = []
        for first in range(0, len(ring), _AT_ONCE):
            part = ring[first : first + _AT_ONCE]
            found = known[part[:, None] + offsets]
            part, found = part[found.any(axis=1)], found[found.any(axis=1)] * weights
            sums = np.zeros((len(part), made.shape[1]))
            for offset, weight in zip(offsets, found.T, strict=True):
                sums += made[part + offset] * weight[:, None]
            made[part] = sums / found.sum(axis=1)[:, None]
            reached.append(part)
            yield min(1.0, count / len(valid))
        ring = np.concatenate(reached)
        known[ring] = True
        count += len(ring)
        beside = np.unique(ring[:, None] + offsets)
        ring = beside[inner.reshape(-1)[beside] & ~known[beside]]
    return made[inside].reshape(coefficients.shape)
