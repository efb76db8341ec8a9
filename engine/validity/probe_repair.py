"""Repair of probes inside geometry: push-off to the outside, and fill of the others from valid neighbours."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterator

import numpy as np

from ..scene.probe_volume import ProbeVolume

#: Distance of a moved probe from the surface that it left, as a fraction of the smallest cell width (chosen).
_BEYOND = 0.05

#: Steps along the grid to the 26 neighbours of a probe.
_NEIGHBOURS = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]

#: Probes that are filled at once (fastest of 2^10 to 2^14): 76 kB each with eight light groups.
_AT_ONCE = 1 << 10


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
    """Return coefficients, (n, ...) float32, in which invalid probes are filled.

    Each invalid probe gets the mean of its valid neighbours, weighted by the inverse square of their
    distance; neighbours of filled probes follow. Without any valid probe nothing changes. Yields the fraction
    that is filled.

    valid:  (n,) bool
    """
    if valid.all() or not valid.any():
        return coefficients
    made, count = coefficients.copy(), int(valid.sum())
    values = made.reshape(len(valid), -1)
    for probes, neighbours, first, weights in _rings(valid, volume):
        values[probes] = np.add.reduceat(values[neighbours] * weights[:, None], first)
        count += len(probes)
        yield count / len(valid)
    return made


def _rings(
    valid: np.ndarray, volume: ProbeVolume
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield invalid probes, (k,) int64, whose neighbours are valid or were yielded with earlier rings.

    Also yields the known neighbours of each, (m,) int64, in the order of the probes; the first neighbour of
    each probe, (k,) int64; and the weights of the neighbours, (m,) float64, which sum to 1 for each probe.
    """
    # A border of unknown probes on all sides keeps neighbours of the outermost in the array.
    inner = np.pad(np.ones(volume.resolution[::-1], bool), 1)
    height, width = inner.shape[1:]
    offsets = np.array([np.dot(step[::-1], [height * width, width, 1]) for step in _NEIGHBOURS])
    weights = 1 / np.square(np.array(_NEIGHBOURS) @ volume.steps).sum(axis=1)
    inner = inner.ravel()
    probe, known = np.cumsum(inner) - 1, np.zeros(inner.size, bool)
    known[inner] = valid
    ring = np.flatnonzero(inner & ~known)
    while len(ring):
        reached = []
        for start in range(0, len(ring), _AT_ONCE):
            part = ring[start : start + _AT_ONCE]
            found = known[part[:, None] + offsets]
            part, found = part[found.any(axis=1)], found[found.any(axis=1)]
            if not len(part):
                continue
            row, column = found.nonzero()
            first = np.flatnonzero(np.diff(row, prepend=-1))
            shares = weights[column] / np.add.reduceat(weights[column], first)[row]
            yield probe[part], probe[part[row] + offsets[column]], first, shares
            reached.append(part)
        ring = np.concatenate(reached)
        known[ring] = True
        beside = np.zeros(inner.size, bool)
        beside[(ring[:, None] + offsets).ravel()] = True
        ring = np.flatnonzero(beside & inner & ~known)
