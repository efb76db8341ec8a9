"""Progress reports, and the time model that combines the stages of a bake into one percentage."""

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
Converted = TypeVar("Converted")

#: Seconds of a stage after which its own pace counts as much as the expected one: for a measured pace, and
#: for a guess, which may be wrong by orders of magnitude.
_PRIOR, _GUESS = 0.5, 0.02

#: Fraction of a stage: the first slice does not count for the pace if it is shorter, since drivers compile in
#: it.
_STARTING = 0.2

#: Minimum time between two reports, s; thousands of shorter steps would cost as much as the work.
_STEP = 0.004

#: Lower bound of the ratio of actual to guessed time, for work that has never been measured. Work that ends
#: early, such as unwrapping, says nothing about the speed of the device that works next.
_FASTEST = 1.0

#: Minimum fraction of a stage's seconds that its units take (chosen).
_LEAST = 0.1

#: A guess of remaining time below this fraction of the time spent so far is ignored.
_NEGLIGIBLE = 0.1


@dataclass(frozen=True)
class Progress:
    """Progress of the work after one slice.

    stage:         name for the user: "Preparing texels", "Direct light", "Visibility", "Bounce 3" ...
    fraction:      completed fraction of the stage, in [0, 1]
    overall:       completed fraction of all work, in [0, 1]; never decreases, 1 at the end
    seconds_left:  remaining time of all work, s; NaN while unknown
    expected_left: the same, also while most of it is a guess, s; NaN without any
    iteration:     completed iterations
    residual:      estimated mean error of the patches, relative to the light of each; NaN while unknown
    energy:        flux that the last completed iteration added, W, sum of the channels
    intermediate:  current lightmaps, dilated, (atlases, h, w, 3) float32, E/pi; only after direct light and
                   after an iteration, else None
    """

    stage: str
    fraction: float
    overall: float = 0.0
    seconds_left: float = math.nan
    expected_left: float = math.nan
    iteration: int = 0
    residual: float = math.nan
    energy: float = 0.0
    intermediate: np.ndarray | None = None


@dataclass(eq=False)
class Stage:
    """Stage of the work with its time model.

    name:      name for the user
    amount:    amount of work in units of its own, such as texels or rays; may be corrected during the work
    pace:      expected seconds for each unit
    measured:  True if the pace was measured by earlier work or a trial; False for a guess
    like:      stage of the same kind of work, whose known pace replaces a guess
    ratio:     seconds for each unit relative to a unit of `like`
    overhead:  expected seconds besides the units, such as loading programs; spread over the units
    forecast:  remaining seconds as the work reports them once reliable, else NaN
    guess:     the same from the start, reliable or not; NaN if the work reports none
    done:      completed units
    seconds:   seconds spent
    """

    name: str
    amount: float = 1.0
    pace: float = 0.0
    measured: bool = False
    like: Stage | None = None
    ratio: float = 1.0
    overhead: float = 0.0
    forecast: float = math.nan
    guess: float = math.nan
    done: float = 0.0
    seconds: float = 0.0
    _start: tuple[float, float] = field(default=(0.0, 0.0), repr=False)

    def advance(self, done: float, seconds: float) -> None:
        """Record `seconds` of work that reached `done` units in total."""
        self.seconds += seconds
        if self.done == 0 and done < _STARTING * self.amount:
            self._start = (done, self.seconds)
        self.done = done

    @property
    def known(self) -> bool:
        """True if the remaining time follows from measurements, not from a guess."""
        alike = self.like is not None and self.like.known
        return self.measured or alike or not math.isnan(self.forecast) or self.done > self._start[0]

    @property
    def seconds_left(self) -> float:
        """Expected remaining seconds."""
        if not math.isnan(self.forecast):
            return self.forecast
        if not math.isnan(self.guess):
            return self.guess
        rest = self.amount - self.done
        return rest * self._likely_pace if rest > 0 else 0.0

    @property
    def expected_pace(self) -> float:
        """Expected seconds per unit of work, from earlier work or a guess, not from this stage."""
        return self.pace if self._alike is None else self.ratio * self._alike._likely_pace

    @property
    def own_pace(self) -> float:
        """Measured seconds per unit of this stage; NaN before enough is done.

        A first slice that compiles is excluded.
        """
        done, seconds = self.done - self._start[0], self.seconds - self._start[1]
        return seconds / done if done > 0 and seconds > 0 else math.nan

    @property
    def work_pace(self) -> float:
        """Seconds per unit of this stage without the overhead, at least `_LEAST` of `own_pace`."""
        return max(self.own_pace - self.overhead / self.done, _LEAST * self.own_pace)

    @property
    def _alike(self) -> Stage | None:
        return self.like if not self.measured and self.like is not None and self.like.known else None

    @property
    def _likely_pace(self) -> float:
        """Seconds for each unit: geometric mean of the expected and the measured pace, weighted by time.

        The mean is geometric, since paces are wrong by factors in either direction.
        """
        overhead = self.overhead / self.amount if self.amount > 0 else 0.0
        expected, seconds = self.expected_pace + overhead, self.seconds - self._start[1]
        if math.isnan(self.own_pace) or expected <= 0:
            return expected
        trust = seconds / (seconds + (_GUESS if self._alike is None and not self.measured else _PRIOR))
        pace: float = expected ** (1 - trust) * self.own_pace**trust
        return pace


class Schedule:
    """Sequence of stages with one overall fraction.

    In a time t the fraction f grows by (1 - f) t / (t + left): the share of t in the remaining time. It never
    decreases, ends at 1, and grows evenly if the estimates are right.

    seconds_left:  remaining time of all work, s; NaN while most of it is a guess that matters
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages, self._current, self._rest = tuple(stages), 0, 1.0
        self._left, self.seconds_left = 0.0, math.nan
        self._last = time.perf_counter()

    @property
    def current(self) -> Stage:
        """The current stage."""
        return self._stages[self._current]

    @property
    def overall(self) -> float:
        """Completed fraction of all work, in [0, 1]."""
        return 1 - self._rest

    @property
    def due(self) -> bool:
        """True if enough time has passed since the last report."""
        return time.perf_counter() - self._last >= _STEP

    def begin(self, stage: Stage) -> Progress:
        """Begin a stage and drop the remaining work of earlier stages."""
        self._current = self._stages.index(stage)
        self._estimate()
        return self.progress(0.0)

    def advance(self, done: float) -> None:
        """Record the time since the last call for the current stage, which reached `done` units."""
        now = time.perf_counter()
        seconds, self._last = now - self._last, now
        self.current.advance(done, seconds)
        self._estimate()
        if seconds + self._left > 0:
            self._rest *= self._left / (seconds + self._left)

    def end(self) -> Progress:
        """End the current stage; its completed work becomes its total."""
        stage = self.current
        stage.amount, stage.forecast, stage.guess = stage.done or stage.amount, math.nan, math.nan
        self.advance(stage.amount)
        return self.progress(1.0)

    def run(self, stage: Stage, work: Generator[float, None, Made]) -> Generator[Progress, None, Made]:
        """Run the work of a stage, which yields its completed fraction; return the result of the work."""
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
        """Run work with a schedule of its own, as a stage with 1 unit; return the result of the work."""
        self.begin(stage)
        made = yield from map_progress(work, self._included)
        self.end()
        return made

    def _included(self, progress: Progress | None) -> Progress | None:
        if progress is None:
            return None
        self.current.forecast, self.current.guess = progress.seconds_left, progress.expected_left
        self.advance(progress.overall)
        left = math.nan if math.isnan(progress.seconds_left) else self.seconds_left
        return replace(progress, overall=self.overall, seconds_left=left, expected_left=self._left)

    def progress(self, fraction: float, name: str = "", **facts: Any) -> Progress:
        """Return the overall progress with facts about the current stage.

        fraction:  completed fraction of the stage
        name:      name for the user; empty for the name of the stage
        facts:     further fields of `Progress`
        """
        return Progress(
            name or self.current.name, fraction, self.overall, self.seconds_left, self._left, **facts
        )

    def _estimate(self) -> None:
        """Estimate the remaining time of all stages, and how much of it is guessed."""
        left, guessed, slowness = 0.0, 0.0, math.nan
        for stage in self._stages[self._current :]:
            seconds = stage.seconds_left

            # In most bakes, most stages have no work.
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
        """Seconds spent on all stages so far."""
        return sum(stage.seconds for stage in self._stages[: self._current + 1])

    def _slowness(self) -> float:
        """Return the ratio of actual to expected time of the work so far, at least `_FASTEST`.

        The ratio corrects guesses of later stages: compiling drivers and other programs slow them too.
        """
        begun = [stage for stage in self._stages[: self._current + 1] if stage.seconds > 0]
        expected = sum(stage.pace * (stage.done or stage.amount) + stage.overhead for stage in begun)
        return max(_FASTEST, (self._spent + _PRIOR) / (expected + _PRIOR))


def format_seconds_left(seconds: float) -> str:
    """Return a time for the user, such as "12 s left"; empty while it is unknown."""
    if math.isnan(seconds):
        return ""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes} min {rest} s left" if minutes else f"{rest} s left"


def finished(work: Generator[Any, None, Made]) -> Made:
    """Run a generator to its end and return its result."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            made: Made = stop.value
            return made


def run_as_fraction(
    first: float, last: float, work: Generator[float, None, Made]
) -> Generator[float, None, Made]:
    """Run work as part of a larger task; yield the completed fraction of the larger task."""
    return map_progress(work, lambda done: first + (last - first) * done)


def map_progress(
    work: Generator[Step, None, Made], convert: Callable[[Step], Converted]
) -> Generator[Converted, None, Made]:
    """Run work; yield `convert(step)` for each of its steps; return its result."""
    with closing(work):
        while True:
            try:
                step = next(work)
            except StopIteration as stop:
                made: Made = stop.value
                return made
            yield convert(step)
