"""What a bake tells about itself while it runs, and how the times of its stages become one percentage."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

Made = TypeVar("Made")
Step = TypeVar("Step")
Told = TypeVar("Told")

#: An expected pace counts as much as one that the stage itself shows for this time, s: one that was measured
#: in earlier work, and a guess, which may be wrong by orders of magnitude.
_PRIOR, _GUESS = 0.5, 0.02

#: A first slice below this part of a stage is not measured: drivers compile what it needs.
_STARTING = 0.2

#: Slices that follow each other faster are one step: thousands of them would cost as much as the work, s.
_STEP = 0.004

#: Work of which nothing but a guess is known is not expected to take a smaller part of that.
_FASTEST = 0.25

#: A guess does not matter if it is less than this part of the time that was spent so far.
_NEGLIGIBLE = 0.1


@dataclass(frozen=True)
class Progress:
    """One slice of work is done.

    stage         as a user knows it: "Patches", "Direct light", "Visibility", "Bounce 3", "Outputs" ...
    fraction      of the stage, in [0, 1]
    overall       of all work, in [0, 1]; never falls, 1 at the end
    seconds_left  until all work is done, s; NaN while unknown
    iteration     iterations completed
    residual      estimated remaining error, relative to each patch's light, on average; NaN while unknown
    energy        radiant flux that the last completed iteration added, W, sum of the channels
    intermediate  the lightmaps so far, dilated, (atlases, h, w, 3) float32, E/pi; only after
                  direct light and after an iteration, else None
    """

    stage: str
    fraction: float
    overall: float = 0.0
    seconds_left: float = math.nan
    iteration: int = 0
    residual: float = math.nan
    energy: float = 0.0
    intermediate: np.ndarray | None = None


@dataclass(eq=False)
class Stage:
    """A part of the work, and how long it takes.

    name      as a user knows it
    amount    of work, in a unit of its own such as texels or rays; may be corrected while it is done
    pace      seconds that a unit is expected to take
    measured  whether that pace was measured, by earlier work or in a trial; else it is a guess
    like      a stage of the same kind of work: its pace, once known, counts in place of a guess
    forecast  seconds that are left as the work itself tells; NaN if it does not
    done      units that are done
    seconds   spent on it
    """

    name: str
    amount: float = 1.0
    pace: float = 0.0
    measured: bool = False
    like: Stage | None = None
    forecast: float = math.nan
    done: float = 0.0
    seconds: float = 0.0
    _start: tuple[float, float] = field(default=(0.0, 0.0), repr=False)

    def advance(self, done: float, seconds: float) -> None:
        """Book time, in which the work has come to `done` units."""
        self.seconds += seconds
        if self.done == 0 and done < _STARTING * self.amount:
            self._start = (done, self.seconds)
        self.done = done

    @property
    def known(self) -> bool:
        """Whether the time that is left rests on a measurement."""
        alike = self.like is not None and self.like.known
        return self.measured or alike or not math.isnan(self.forecast) or self.done > self._start[0]

    @property
    def seconds_left(self) -> float:
        """Seconds that the rest is expected to take."""
        if not math.isnan(self.forecast):
            return self.forecast
        rest = self.amount - self.done
        return rest * self._likely_pace if rest > 0 else 0.0

    @property
    def expected_pace(self) -> float:
        """Seconds a unit, by what is known of others: its own pace is not asked."""
        return self.pace if self._alike is None else self._alike._likely_pace

    @property
    def own_pace(self) -> float:
        """Seconds a unit of what is done, without a first slice that compiles; NaN of nothing."""
        done, seconds = self.done - self._start[0], self.seconds - self._start[1]
        return seconds / done if done > 0 and seconds > 0 else math.nan

    @property
    def _alike(self) -> Stage | None:
        return self.like if not self.measured and self.like is not None and self.like.known else None

    @property
    def _likely_pace(self) -> float:
        """Seconds a unit: by its pace so far, at first by the expected one.

        The mean of both is geometric, since paces are wrong by factors, either way.
        """
        expected, seconds = self.expected_pace, self.seconds - self._start[1]
        if math.isnan(self.own_pace) or expected <= 0:
            return expected
        trust = seconds / (seconds + (_GUESS if self._alike is None and not self.measured else _PRIOR))
        pace: float = expected ** (1 - trust) * self.own_pace**trust
        return pace


class Schedule:
    """Stages in their order, and one fraction over all of them.

    In the time t the fraction f grows by (1 - f) t / (t + left): the part that t has of the time that was
    left. So it never falls, however wrong the estimates, ends at 1, and is even where they are right.

    seconds_left  until all work is done; NaN while most of it is a guess that matters
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages, self._current, self._rest = tuple(stages), 0, 1.0
        self._left, self.seconds_left = 0.0, math.nan
        self._last = time.perf_counter()

    @property
    def current(self) -> Stage:
        """The stage that is done now."""
        return self._stages[self._current]

    @property
    def overall(self) -> float:
        """The fraction of all work that is done, in [0, 1]."""
        return 1 - self._rest

    @property
    def due(self) -> bool:
        """Whether the last step is long enough ago for another one."""
        return time.perf_counter() - self._last >= _STEP

    def begin(self, stage: Stage) -> Progress:
        """Begin a stage; what is left of those before it does not count any more."""
        self._current = self._stages.index(stage)
        self._estimate()
        return self.progress(0.0)

    def advance(self, done: float) -> None:
        """Book the time since the last call on the current stage, which has come to `done` units."""
        now = time.perf_counter()
        seconds, self._last = now - self._last, now
        self.current.advance(done, seconds)
        self._estimate()
        if seconds + self._left > 0:
            self._rest *= self._left / (seconds + self._left)

    def end(self) -> Progress:
        """End the current stage: what it did is all that there was."""
        stage = self.current
        stage.amount, stage.forecast = stage.done or stage.amount, math.nan
        self.advance(stage.amount)
        return self.progress(1.0)

    def run(self, stage: Stage, work: Generator[float, None, Made]) -> Generator[Progress, None, Made]:
        """Do the work of a stage, which yields the fraction done; return what it made."""
        yield self.begin(stage)
        while True:
            try:
                fraction = next(work)
            except StopIteration as stop:
                self.advance(stage.amount)
                yield self.end()
                made: Made = stop.value
                return made
            if self.due:
                self.advance(fraction * stage.amount)
                yield self.progress(fraction)

    def include(
        self, stage: Stage, work: Generator[Progress | None, None, Made]
    ) -> Generator[Progress | None, None, Made]:
        """Do work with a schedule of its own as a stage of amount 1; return what it made."""
        self.begin(stage)
        made = yield from map_progress(work, self._included)
        self.end()
        return made

    def _included(self, progress: Progress | None) -> Progress | None:
        if progress is None:
            return None
        self.current.forecast = progress.seconds_left
        self.advance(progress.overall)
        left = math.nan if math.isnan(progress.seconds_left) else self.seconds_left
        return replace(progress, overall=self.overall, seconds_left=left)

    def progress(self, fraction: float, name: str = "", **facts: Any) -> Progress:
        """Return how far all work is, with what is to be shown of the current stage.

        facts: further fields of `Progress`
        """
        return Progress(name or self.current.name, fraction, self.overall, self.seconds_left, **facts)

    def _estimate(self) -> None:
        """Estimate the time that is left, and how much of it is a guess."""
        left, guessed, slowness = 0.0, 0.0, math.nan
        for stage in self._stages[self._current :]:
            seconds = stage.seconds_left

            # Most stages of most bakes have nothing to do.
            if seconds and not stage.known:
                if stage is not self.current:
                    slowness = self._slowness() if math.isnan(slowness) else slowness
                    seconds *= slowness
                guessed += seconds
            left += seconds
        self._left = left
        matters = guessed > left / 2 and guessed > _NEGLIGIBLE * self._spent
        self.seconds_left = math.nan if matters else left

    @property
    def _spent(self) -> float:
        """Seconds that the stages so far have taken."""
        return sum(stage.seconds for stage in self._stages[: self._current + 1])

    def _slowness(self) -> float:
        """Return how many times as long as expected the work so far took, at least `_FASTEST`.

        What slows it, drivers that compile and other programs, slows what nothing but a guess is known of. A
        machine that is faster than the guesses is faster at that, too.
        """
        begun = [stage for stage in self._stages[: self._current + 1] if stage.seconds > 0]
        expected = sum(stage.pace * (stage.done or stage.amount) for stage in begun)
        return max(_FASTEST, (self._spent + _PRIOR) / (expected + _PRIOR))


def format_seconds_left(seconds: float) -> str:
    """Return a time as a user reads it, such as "12 s left"; empty while it is unknown."""
    if math.isnan(seconds):
        return ""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes} min {rest} s left" if minutes else f"{rest} s left"


def finished(work: Generator[Any, None, Made]) -> Made:
    """Let a bake, or any other work in slices, run to its end; return what it made."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            made: Made = stop.value
            return made


def run_as_fraction(
    first: float, last: float, work: Generator[float, None, Made]
) -> Generator[float, None, Made]:
    """Do work as a part of something; yield the fraction done of all of it."""
    return map_progress(work, lambda done: first + (last - first) * done)


def map_progress(
    work: Generator[Step, None, Made], tell: Callable[[Step], Told]
) -> Generator[Told, None, Made]:
    """Do work, yield what is told of each of its steps, and return what it made; closing closes the work."""
    with closing(work):
        while True:
            try:
                step = next(work)
            except StopIteration as stop:
                made: Made = stop.value
                return made
            yield tell(step)
