"""Random .blend files through the operators: a lightmap or an error, and nothing of the user's changed."""

from collections import Counter
from collections.abc import Iterator

import pytest
from hypothesis import event, given, note, settings

from tests.fuzz.apart import Apart
from tests.fuzz.blender_cases import CASES, EXAMPLES, REFUSED, Case

#: Longest time of a case, s; the first one starts Blender and makes kernels.
LIMIT = 120

#: One file for so many scenes of the engine, and what part of the files has to be baked, not refused.
FEWER, BAKED = 5, 0.4


@pytest.fixture(scope="module")
def apart() -> Iterator[Apart]:
    process = Apart("tests.fuzz.blender_bakes:check", LIMIT)
    yield process
    process.stop()


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_once_went_wrong(apart, name):
    end = apart.run(EXAMPLES[name])
    assert end.startswith("refused" if name in REFUSED else ("baked", "cancelled", "saved")), end


def test_every_file_is_baked_or_refused_and_otherwise_as_before(apart):
    ends: Counter[str] = Counter()

    @settings(max_examples=settings().max_examples // FEWER)
    @given(CASES)
    def bake(case: Case) -> None:
        note(repr(case))
        end = apart.run(case)
        event(end)
        ends[end] += 1

    bake()
    assert ends["baked"] > BAKED * ends.total(), ends
