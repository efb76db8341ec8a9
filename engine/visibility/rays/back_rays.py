"""Test rays with origins all over triangles and cosine-distributed directions; see `visible_backs`."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

#: Mark of a known back face, KNOWN of visible_backs.cl.
_KNOWN = 2


@dataclass(frozen=True)
class BackRays:
    """Test rays from one side of triangles.

    ends:    (t,) uint32, end of each triangle's range of rays
    side:    1 for rays from fronts, -1 from backs
    height:  of ray origins above the surface, m
    count:   number of rays
    """

    ends: np.ndarray
    side: float
    height: float
    count: int

    @property
    def words(self) -> int:
        """Number of 32-bit words with one bit for each ray."""
        return max(-(-self.count // 32), 1)

    @classmethod
    def of(cls, weight: np.ndarray, count: int, side: float, height: float) -> BackRays:
        """Create rays, whose number per triangle is proportional to its weight, (t,) float.

        Not all weights may be 0.
        """
        total = np.cumsum(weight, dtype=np.float64)
        ends = np.floor(total * (count / max(total[-1], 1e-300))).clip(max=count).astype(np.uint32)
        return cls(ends, side, height, count)


class CastRays(Protocol):
    """Test rays on a device."""

    def hit_backs(self, known: np.ndarray) -> Generator[None, None, np.ndarray]:
        """Return a mask of triangles whose unknown back face some ray hits, (t,) bool; yield after launches.

        The first call casts all rays. Later calls cast those that start inside something, since only their
        result depends on the known back faces. Triangles that a call returns must be known in the next one,
        or of no interest.

        known:  (t,) bool, back faces that earlier rounds found; no ray searches for them, and probes that
                meet them are not enclosed
        """


def marks_of(known: np.ndarray) -> np.ndarray:
    """Return the marks of triangles before rays, (t,) uint8: KNOWN of visible_backs.cl, or 0."""
    return np.where(known, np.uint8(_KNOWN), np.uint8(0))
