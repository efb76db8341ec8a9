"""Tint palette: the color of transmitted light as a 6-bit index in each visibility sample."""

from __future__ import annotations

import numpy as np

from .cutouts import BACK, BOUNCE, Cutouts

#: Bits of a sample for the radiance entry; the upper bits hold the tint index.
ENTRY_BITS = 26

#: Number of palette entries.
SIZE = 64

#: Channel values of the color lattice at the end of the palette. Other tints are means of lattice corners.
_LEVELS = np.array([0.0, 0.5, 1.0])

#: Number of entries for exact tints, starting with white: constants and their products.
EXACT = SIZE - len(_LEVELS) ** 3

#: Tolerance for equal tints, as in kernels/visibility/trace_sample.cl.
_SAME = 1e-4

#: Maximum number of factors in an exact product; deeper stacks of surfaces use the lattice.
_FACTORS = 4


def tint_palette(cutouts: Cutouts) -> np.ndarray | None:
    """Return the palette, (SIZE, 4) float32, transmittance over its largest channel; None without tints.

    The first EXACT entries hold white, the tints of surfaces without a map, and products of these. The w
    component of the first entry is their number. A lattice follows, with red varying fastest; other tints
    choose among its corners by stochastic rounding, which preserves the mean.
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
    """Return the distinct tints of surfaces without a map for gathered light, except white."""
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
    """Return True if a tint equals one of the list within the tolerance."""
    return bool((np.abs(np.array(tints) - tint).max(axis=1) < _SAME).any())
