"""Random .blend files through the operators: a lightmap or an error, and nothing of the user's changed."""

import pytest

from tests.fuzz.blender_cases import CASES, EXAMPLES, REFUSED
from tests.fuzz.random_cases import ends_of

CHECK = "tests.fuzz.blender_bakes:check"

#: Longest time of a case, s; the first one starts Blender and makes kernels.
LIMIT = 120

#: Scenes of the engine for each file, and what part of the files has to be baked, not refused.
FEWER, BAKED = 5, 0.4


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_once_went_wrong(apart, name):
    end = apart.run(EXAMPLES[name])
    assert end.startswith("refused" if name in REFUSED else ("baked", "cancelled", "saved")), end


def test_every_file_is_baked_or_refused_and_otherwise_as_before(apart):
    ends = ends_of(apart, CASES, FEWER)
    assert ends["baked"] > BAKED * ends.total(), ends
