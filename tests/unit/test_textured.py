"""Patches by their materials."""

import numpy as np
import pytest

from engine.patches import textured


@pytest.mark.parametrize("materials", [1, 3, 13])
@pytest.mark.parametrize("searched", [0, 8, 100])
def test_patches_of_materials_are_found_by_search_and_by_sorting(monkeypatch, materials, searched):
    """In their order; those of materials that are not chosen are nobody's; one material has no patches."""
    monkeypatch.setattr(textured, "_SEARCHED", searched)
    random = np.random.default_rng(materials)
    numbers = random.integers(0, max(materials - 1, 1), 1009).astype(np.int32)
    chosen = [bool(number % 3 != 1) for number in range(materials)]
    groups = textured._grouped(numbers, chosen)
    assert [group is not None for group in groups] == chosen
    for number, group in enumerate(groups):
        expected = [place for place, of in enumerate(numbers) if of == number]
        assert group is None or group.tolist() == expected
