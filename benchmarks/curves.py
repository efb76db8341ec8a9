"""Error over time, and the time at which a curve reaches an error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    """One bake: its name, wall time in seconds and relative error."""

    label: str
    seconds: float
    error: float


@dataclass(frozen=True)
class Reach:
    """When an error is reached.

    seconds:  None if it is not
    how:      "interpolated"; "at most": the fastest bake is already better; "extrapolated"; "not reached"
    """

    seconds: float | None
    how: str


def reach(points: Sequence[Point], target: float) -> Reach:
    """Return when the best bakes reach an error: log of error over log of time, line by line."""
    best = envelope(points)
    if not best or best[-1].error > target:
        return Reach(None, "not reached")
    if best[0].error <= target:
        return Reach(best[0].seconds, "at most")
    after = next(index for index, point in enumerate(best) if point.error <= target)
    slow, fast = best[after], best[after - 1]
    step = math.log(fast.error / target) / math.log(fast.error / max(slow.error, 1e-12))
    return Reach(fast.seconds * (slow.seconds / fast.seconds) ** step, "interpolated")


def envelope(points: Sequence[Point]) -> list[Point]:
    """Return the points that no other point beats in time and error, the fastest first."""
    best: list[Point] = []
    for point in sorted(points, key=lambda point: (point.seconds, point.error)):
        if not best or point.error < best[-1].error:
            best.append(point)
    return best


def reach_by_sampling(samples: Sequence[int], points: Sequence[Point], target: float) -> Reach:
    """Return when a path tracer reaches an error.

    Beyond its last point the error falls as 1 / sqrt(samples), and each sample takes as long as
    between its last two points (all of the last point's time if there is only one).
    """
    found = reach(points, target)
    if found.seconds is not None or not points:
        return found
    last = points[-1]
    each = last.seconds / samples[-1]
    if len(points) > 1:
        each = (last.seconds - points[-2].seconds) / (samples[-1] - samples[-2])
    needed = samples[-1] * (last.error / target) ** 2
    return Reach(last.seconds + max(each, 0.0) * (needed - samples[-1]), "extrapolated")


def text_of(reached: Reach) -> str:
    """Return a reach as a cell of a table."""
    if reached.seconds is None:
        return reached.how
    mark = {"at most": "≤ ", "extrapolated": "~ "}.get(reached.how, "")
    return f"{mark}{reached.seconds:.3g}"
