"""Stages and progress of reading a scene."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

from ...engine.progress import Progress, Schedule, Stage
from .slice_timer import Slices

Made = TypeVar("Made")

#: Estimated seconds for an object, an evaluation by Cycles and a triangle, before any was measured.
_OBJECT, _EVALUATION, _TRIANGLE = 1e-3, 0.5, 1e-6


class ReadStages(Schedule):
    """Schedule of reading: objects and instances, evaluations by Cycles, joining of triangles.

    paces:  seconds per unit of each stage in earlier readings, by its name; `update_paces` updates them
    items:  number of objects and instances
    """

    def __init__(self, paces: dict[str, float], items: int) -> None:
        self._paces = paces
        self.objects = self._stage("Reading objects", items, _OBJECT)
        self.materials = self._stage("Reading materials", 0, _EVALUATION)
        self.joining = self._stage("Joining objects", 0, _TRIANGLE)
        super().__init__([self.objects, self.materials, self.joining])

    def expect(self, evaluations: int, triangles: int) -> None:
        """Set the amounts of the remaining stages after the objects have been read."""
        self.materials.amount, self.joining.amount = evaluations, triangles

    def follow(self, stage: Stage, work: Slices[Made]) -> Generator[Progress | None, None, Made]:
        """Run the work of a stage, and yield its progress and announcements."""
        yield self.begin(stage)
        fraction = 0.0
        while True:
            try:
                said = next(work)
            except StopIteration as stop:
                yield self.end()
                made: Made = stop.value
                return made
            if isinstance(said, str):
                yield self.progress(fraction, said)
                yield None
                continue
            fraction = fraction if said is None else max(said, fraction)
            if self.due:
                self.advance(fraction * stage.amount)
                yield self.progress(fraction)

    def update_paces(self) -> None:
        """Store the seconds per unit of this reading for the next one."""
        for stage in (self.objects, self.materials, self.joining):
            if stage.done > 0:
                self._paces[stage.name] = stage.seconds / stage.done

    def _stage(self, name: str, amount: float, guess: float) -> Stage:
        return Stage(name, amount, self._paces.get(name, guess), name in self._paces)
