"""Computes the best bilinear lightmap for a wall thinner than a texel, and its error.

    python tools/wall_limits.py

Across a wall of 2 cm on texels of 4 cm the light is 1 on one side and 0 on the other. For each place of the
wall on the texels the table has the least worst error on the lit side, of all values of texels that leak at
most 13 % at a centimetre behind the wall and 2 % from a texel on; and the least leak at a centimetre, if the
lit side is off by 5 % at most. Texels of a row depend on each other in pairs, so dynamic programming finds
both, in steps of 0.5 % of light.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tools.page_table import table_row

#: Widths of texels and the wall, and the distance behind it, cm.
_TEXEL, _WALL, _BEHIND = 4.0, 2.0, 1.0

#: Limits of leaks, there and from a texel behind the wall on, and of the error on the lit side.
_NEAR, _FAR, _LIT = 0.13, 0.02, 0.05

#: Where the lit face of the wall is, cm from the border of a texel.
_PLACES = (0.0, 0.7, 1.3, 2.0, 2.9, 3.6)

#: Values that a texel may have, and texels to each side of the wall.
_VALUES, _TEXELS = np.linspace(0, 2, 401), 4


def main() -> None:
    """Print the table."""
    print(
        table_row("lit face, cm from a texel's border", "least worst error, lit side", "least leak at 1 cm")
    )
    print("|---|---|---|")
    for place in _PLACES:
        error, leak = least_error(place), least_leak(place)
        print(table_row(f"{place:.1f}", f"{error:.0%}", f"{leak:.0%}"))


def least_error(face: float) -> float:
    """Return the least worst error on the lit side of a face, where leaks keep their limits."""
    return _least(face, lambda lit, near, far: np.where((near <= _NEAR) & (far <= _FAR), lit, np.inf))


def least_leak(face: float) -> float:
    """Return the least light one centimetre behind the wall for which the lit side keeps its limit."""
    return _least(face, lambda lit, near, far: np.where(lit <= _LIT, near, np.inf))


def _least(face: float, worst) -> float:
    """Return the least value, over all values of texels, of the worst of what segments between centres show.

    worst: of a segment, from its largest error on the lit side, its light a centimetre behind the wall, and
    its largest from a texel behind it on, (v, v) each by the values at its ends
    """
    behind = face + _WALL
    best = np.zeros(len(_VALUES))
    for left in (np.arange(-_TEXELS, _TEXELS) + 0.5) * _TEXEL:
        right = left + _TEXEL
        lit = [left, min(right, face)] if left < face else []
        near = [behind + _BEHIND] if left <= behind + _BEHIND < right else []
        far = [max(left, behind + _TEXEL), right] if right > behind + _TEXEL else []
        shown = [_largest(left, places) for places in (near, far)]
        error = (
            np.maximum(_largest(left, lit) - 1, 1 - _smallest(left, lit)) if lit else np.zeros_like(shown[0])
        )
        best = np.maximum(best[:, None], worst(error, *shown)).min(axis=0)
    return float(best.min())


def _largest(left: float, places: list[float]) -> np.ndarray:
    """Return the largest light at places of a segment, (v, v) by the values at its ends; 0 without places."""
    return _shown(left, places).max(axis=0, initial=0.0)


def _smallest(left: float, places: list[float]) -> np.ndarray:
    """Return the smallest light at places of a segment; see `_largest`."""
    return _shown(left, places).min(axis=0)


def _shown(left: float, places: list[float]) -> np.ndarray:
    """Return the light at places of a segment, (p, v, v)."""
    part = (np.asarray(places, float).reshape(-1, 1, 1) - left) / _TEXEL
    return (1 - part) * _VALUES[:, None] + part * _VALUES


if __name__ == "__main__":
    main()
