"""Palette of tints: colors that see-through surfaces give to the light of patches, as 6 bits of a sample."""

from __future__ import annotations

import numpy as np

from .cutouts import BACK, BOUNCE, Cutouts

#: Bits of a sample that hold the entry of the radiance; the others hold the index of the tint.
ENTRY_BITS = 26

#: Tints of a palette.
SIZE = 64

#: Values of a channel in the lattice, which ends the palette: any tint is a mean of its corners.
_LEVELS = np.array([0.0, 0.5, 1.0])

#: Tints of constants and their products, first of all white.
EXACT = SIZE - len(_LEVELS) ** 3

#: Tints that differ by less are the same, as in kernels/visibility/trace_sample.cl.
_SAME = 1e-4

#: Most products of tints that are tried: stacks of more surfaces use the lattice.
_FACTORS = 4


def tint_palette(cutouts: Cutouts) -> np.ndarray | None:
    """Return tints, (SIZE, 4) float32, transmittance over its largest channel; None if nothing is tinted.

    First EXACT tints, of which w of the first one is the number: white, those of surfaces without a map, and
    products of these. Then a lattice, red fastest, between whose corners all other tints are drawn by lot
    with the right mean (stochastic rounding).
    """
    if not cutouts.tinted:
        return None
    tints = [np.ones(3)]
    factors = _constant_tints(cutouts)
    products = list(tints)
    for _ in range(_FACTORS):
        products = [product * factor for product in products for factor in factors]
        for product in products:
            if len(tints) < EXACT and not _is_among(product, tints):
                tints.append(product)
    blue, green, red = np.meshgrid(_LEVELS, _LEVELS, _LEVELS, indexing="ij")
    palette = np.ones((SIZE, 4), np.float32)
    palette[: len(tints), :3] = tints
    palette[EXACT:, :3] = np.stack([red, green, blue], axis=-1).reshape(-1, 3)
    palette[0, 3] = len(tints)
    return palette


def _constant_tints(cutouts: Cutouts) -> list[np.ndarray]:
    """Return the tints of surfaces without a map for gathered light, each once, white left out."""
    known, white = list[np.ndarray](), [np.ones(3)]
    for record in range(BOUNCE, len(cutouts.base), BACK):
        opacity, threshold = cutouts.base[record].astype(np.float64), cutouts.threshold[record]
        if cutouts.maps[record, 1] or len(known) >= EXACT:
            continue
        if threshold >= 0:
            opacity = (opacity >= threshold).astype(np.float64)
        passed = 1 - opacity.clip(0, 1)
        if passed.max() > 0 and not _is_among(passed / passed.max(), white + known):
            known.append(passed / passed.max())
    return known


def _is_among(tint: np.ndarray, tints: list[np.ndarray]) -> bool:
    """Return whether a tint is one of some."""
    return bool((np.abs(np.array(tints) - tint).max(axis=1) < _SAME).any())
