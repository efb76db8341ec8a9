"""Test rays with origins all over triangles and cosine-distributed directions; see `visible_backs`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Mark of a known back face, KNOWN of visible_backs.cl.
_KNOWN = 2


@dataclass(frozen=True)
class BackRays:
    """Test rays of one round.

    ends:       (t,) uint32, end of each triangle's range of rays
    side:       1 for rays from fronts, -1 from backs
    height:     of ray origins above the surface, m
    count:      number of rays
    known:      (t,) bool, back faces that earlier rounds found; no ray looks for them, and probes that meet
                them are not enclosed
    """

    ends: np.ndarray
    side: float
    height: float
    count: int
    known: np.ndarray

    @property
    def marks(self) -> np.ndarray:
        """Marks of triangles before the rays, (t,) uint8: KNOWN of visible_backs.cl, or 0."""
        return np.where(self.known, np.uint8(_KNOWN), np.uint8(0))

    @classmethod
    def of(
        cls,
        weight: np.ndarray,
        count: int,
        side: float,
        height: float,
        known: np.ndarray,
    ) -> BackRays:
        """Create rays, whose number per triangle is proportional to its weight, (t,) float64.

        Not all weights may be 0.
        """
        total = np.cumsum(weight)
        ends = np.floor(total * (count / max(total[-1], 1e-300))).clip(max=count).astype(np.uint32)
        return cls(ends, side, height, count, known)
