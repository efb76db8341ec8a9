"""Options of a run of the benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Options:
    """Options that all suites share.

    gpu:      True chooses sizes for a graphics card
    full:     True measures everything, False what takes minutes
    scenes:   folder of scene files
    only:     names of the scenes of equal_error, or of the cases of large and levels; none for all
    cache:    folder of references that are kept between runs
    results:  folder of the stored results
    """

    gpu: bool = False
    full: bool = False
    scenes: str = str(ROOT.parent / "shared" / "scenes")
    only: tuple[str, ...] = ()
    cache: str = str(ROOT / "out" / "benchmarks")
    results: str = str(ROOT / "benchmarks" / "results")
