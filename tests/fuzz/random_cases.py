"""Random cases, one after the other, and how they ended."""

from __future__ import annotations

from collections import Counter

from hypothesis import event, given, note, settings
from hypothesis.strategies import SearchStrategy

from tests.fuzz.apart import Apart


def ends_of(apart: Apart, cases: SearchStrategy, fewer: int = 1) -> Counter[str]:
    """Run as many random cases as the profile says, divided by `fewer`; return how many ended which way."""
    ends: Counter[str] = Counter()

    @settings(max_examples=settings().max_examples // fewer)
    @given(cases)
    def run(case: object) -> None:
        note(repr(case))
        end = apart.run(case)
        event(end)
        ends[end] += 1

    run()
    return ends
