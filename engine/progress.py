"""What a bake tells about itself while it runs."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

Made = TypeVar("Made")


@dataclass(frozen=True)
class Progress:
    """One slice of work is done.

    stage      "patches", "direct", "hemicubes" or "outputs"
    fraction   of the stage (of the current iteration for "hemicubes"), in [0, 1]
    iteration  iterations completed
    residual   estimated remaining error, relative to each patch's light, on average; NaN before it is known
    energy     radiant flux that the last completed iteration added, W, sum of the channels
    partial    the lightmaps so far, dilated, (atlases, h, w, 3) float32, E/pi; only after an
               iteration, else None
    """

    stage: str
    fraction: float
    iteration: int = 0
    residual: float = float("nan")
    energy: float = 0.0
    partial: np.ndarray | None = None


def finished(work: Generator[Any, None, Made]) -> Made:
    """Let a bake, or any other work in slices, run to its end; return what it made."""
    while True:
        try:
            next(work)
        except StopIteration as stop:
            made: Made = stop.value
            return made
