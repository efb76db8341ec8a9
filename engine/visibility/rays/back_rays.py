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
    def of(
        cls, weight: np.ndarray, count: int, side: float, height: float, starting: np.ndarray | None = None
    ) -> BackRays:
        """Create rays, whose number per triangle is proportional to its weight, (t,) float.

        Not all weights may be 0.

        starting:  (k,) int64, ascending, all triangles with a weight; None to search for them
        """
        # Later rounds start from few triangles.
        starting = np.flatnonzero(weight) if starting is None else starting
        total = np.cumsum(weight[starting], dtype=np.float64)
        ends = np.floor(total * (count / max(total[-1], 1e-300))).clip(max=count).astype(np.uint32)
        repeated = np.diff(starting, prepend=0, append=len(weight))
        return cls(np.repeat(np.append(np.uint32(0), ends), repeated), side, height, count)


class CastRays(Protocol):
    """Test rays on a device."""

    def hit_backs(self, known: np.ndarray) -> Generator[None, None, np.ndarray]:
        """Return a mask of triangles whose back face a ray hits for the first time, (t,) bool.

        Yields after launches. The first call casts all rays. Later calls repeat the rays that start inside
        geometry, since only their result depends on the known back faces. The next call must include the
        returned triangles in `known`, unless the caller ignores them.

        known:  (t,) bool, back faces that earlier rounds found. Hits of them are not returned, and a ray
                origin whose probe rays hit them is not enclosed
        """


def marks_of(known: np.ndarray) -> np.ndarray:
    """Return the mark of each triangle before the rays of a round, (t,) uint8: KNOWN of the kernel, or 0."""
    return known.view(np.uint8) * np.uint8(_KNOWN)
