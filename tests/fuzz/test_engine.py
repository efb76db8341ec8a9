"""Random scenes through the engine: light, or an error that names what is wrong."""

from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import event, given, note

from tests.fuzz.apart import Apart
from tests.fuzz.engine_cases import CASES, EXAMPLES, Case

#: Longest time of a case, s; the first one makes kernels.
LIMIT = 120

#: Fraction of the cases that have to be baked, not refused, lest the test tests nothing.
BAKED = 0.5


@pytest.fixture(scope="module")
def apart() -> Iterator[Apart]:
    process = Apart("tests.fuzz.engine_bakes:check", LIMIT)
    yield process
    process.stop()


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_once_went_wrong(apart, name):
    apart.run(EXAMPLES[name])


def test_every_scene_gives_light_or_an_error_that_names_it(apart):
    ends: Counter[str] = Counter()

    @given(CASES)
    def bake(case: Case) -> None:
        note(repr(case))
        end = apart.run(case)
        event(end)
        ends[end] += 1

    bake()
    assert ends["baked"] > BAKED * ends.total(), ends
