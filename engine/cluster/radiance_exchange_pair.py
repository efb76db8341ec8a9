"""The memories in which light of one sweep after the other travels within a machine."""

from __future__ import annotations

from .radiance_exchange import RadianceExchange


class RadianceExchangePair:
    """Two memories that sweeps take turns with.

    Once a worker is lost, others may repeat tasks of the last sweep. It may itself still write: those that
    are left get other memories.
    """

    def __init__(self, folder: str) -> None:
        """Take a folder in the memory of all workers; empty if there is none."""
        self._folder, self._workers = folder, set[str]()
        self._both: list[RadianceExchange] = []

    def next(self, count: int, workers: set[str]) -> RadianceExchange | None:
        """Return the memory for a sweep of `count` patches; None without a folder, or without room in it.

        workers: addresses of those that are there
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
