"""What Cycles gave for materials in earlier bakes: those that have not changed are not evaluated again."""

from __future__ import annotations

from collections import OrderedDict

from .evaluated_passes import Pixels

#: Memory that it takes at most, bytes.
_BUDGET = 512 << 20


class EvaluationCache:
    """Passes of materials by the digest of what was evaluated; those used longest ago are dropped first."""

    def __init__(self, budget: int = _BUDGET) -> None:
        self._budget = budget
        self._passes: OrderedDict[bytes, Pixels] = OrderedDict()

    def get(self, digest: bytes | None) -> Pixels | None:
        """Return the finished passes of a digest, which may not be changed; None if there are none."""
        if digest is None or digest not in self._passes:
            return None
        self._passes.move_to_end(digest)
        return dict(self._passes[digest])

    def keep(self, digest: bytes | None, passes: Pixels) -> None:
        """Keep finished passes; without a digest nobody could find them."""
        if digest is None:
            return
        for pixels in passes.values():
            pixels.flags.writeable = False
        self._passes[digest] = dict(passes)
        while self.bytes > self._budget:
            self._passes.popitem(last=False)

    @property
    def bytes(self) -> int:
        """Memory that is taken."""
        return sum(pixels.nbytes for passes in self._passes.values() for pixels in passes.values())

    def clear(self) -> None:
        """Drop all of it."""
        self._passes.clear()


#: Those of this Blender, until another file is opened.
kept_evaluations = EvaluationCache()
