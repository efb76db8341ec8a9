"""Cache of Cycles' evaluations of materials, so that later bakes do not evaluate unchanged ones again."""

from __future__ import annotations

from collections import OrderedDict

from .evaluated_passes import Pixels

#: Largest size of the cache, bytes.
_BUDGET = 512 << 20


class EvaluationCache:
    """Least-recently-used cache of the evaluations of materials, by digest of their input."""

    def __init__(self, budget: int = _BUDGET) -> None:
        self._budget = budget
        self._passes: OrderedDict[bytes, Pixels] = OrderedDict()

    def get(self, digest: bytes | None) -> Pixels | None:
        """Return the finished evaluations of a digest, None if not cached; the arrays are read-only."""
        if digest is None or digest not in self._passes:
            return None
        self._passes.move_to_end(digest)
        return dict(self._passes[digest])

    def keep(self, digest: bytes | None, passes: Pixels) -> None:
        """Store finished evaluations; without a digest they are not stored."""
        if digest is None:
            return
        for pixels in passes.values():
            pixels.flags.writeable = False
        self._passes[digest] = dict(passes)
        while self.bytes > self._budget:
            self._passes.popitem(last=False)

    @property
    def bytes(self) -> int:
        """Size of the cached arrays, bytes."""
        return sum(pixels.nbytes for passes in self._passes.values() for pixels in passes.values())

    def clear(self) -> None:
        """Remove all evaluations."""
        self._passes.clear()


#: Evaluations of this Blender session, until another file is opened.
kept_evaluations = EvaluationCache()
