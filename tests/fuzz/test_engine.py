"""Random scenes through the engine: light, or an error that names what is wrong."""

import pytest

from tests.fuzz.engine_cases import CASES, EXAMPLES
from tests.fuzz.random_cases import ends_of

CHECK = "tests.fuzz.engine_bakes:check"

#: Longest time of a case, s; the first one makes kernels.
LIMIT = 120

#: Fraction of the cases that have to be baked, not refused, lest the test tests nothing.
BAKED = 0.5


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_once_went_wrong(apart, name):
    apart.run(EXAMPLES[name])


def test_every_scene_gives_light_or_an_error_that_names_it(apart):
    ends = ends_of(apart, CASES)
    assert ends["baked"] > BAKED * ends.total(), ends
