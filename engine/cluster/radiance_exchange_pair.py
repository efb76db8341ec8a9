"""Alternating radiance exchanges for successive iterations within a machine."""

from __future__ import annotations

from .radiance_exchange import RadianceExchange


class RadianceExchangePair:
    """Two radiance exchanges used in turn.

    After a worker is lost, others may repeat tasks of the last iteration while it still writes. The remaining
    workers then get new files.
    """

    def __init__(self, folder: str) -> None:
        """Store a folder in the shared memory of all workers; empty if there is none."""
        self._folder, self._workers = folder, set[str]()
        self._both: list[RadianceExchange] = []

    def next(self, count: int, workers: set[str]) -> RadianceExchange | None:
        """Return the exchange for an iteration of `count` patches; None without a folder or space.

        workers: addresses of the present workers
        """
        if not self._folder:
            return None
        if not self._both or workers != self._workers:
            for memory in self._both:
                memory.close()
            try:
                self._both = [RadianceExchange(self._folder, count) for _ in range(2)]
            except OSError:
                self._both, self._folder = [], ""
                return None
            self._workers = workers
        self._both.reverse()
        return self._both[0]
