"""Identity hemicubes, kept, give the same light as radiance hemicubes drawn anew."""

import dataclasses

import numpy as np
import pytest

from engine import Settings
from tests.analytic.drive import drive
from tests.analytic.scenes import nine_quad_room
from tests.analytic.test_sky_and_cutouts import sky

SETTINGS = Settings(resolution=128, hemicube=8, iterations=4, tolerance=0, sample_emission=False)


def scene(world):
    """Return a room with emission on backs, see-through walls and a sky."""
    room = nine_quad_room()
    changed = [
        dataclasses.replace(
            material, alpha=0.7, culled=index == 1, emission=material.emission + np.float32(0.1)
        )
        for index, material in enumerate(room.materials)
    ]
    return dataclasses.replace(room, materials=tuple(changed), world=world)


@pytest.mark.parametrize(
    "world", [np.float32([1, 2, 3]), sky(32, lambda d: 1 + d[..., 0])], ids=["even", "map"]
)
def test_methods_agree(world):
    lightmaps = [
        drive(scene(world), dataclasses.replace(SETTINGS, method=method)) for method in ("paper", "cached")
    ]
    paper, cached = lightmaps
    assert [lightmap.report.method for lightmap in lightmaps] == ["paper", "cached"]
    assert cached.image == pytest.approx(paper.image, rel=2e-5, abs=1e-6)
    assert cached.display == pytest.approx(paper.display, rel=2e-5, abs=1e-6)
    assert paper.image.mean() > 0.5


def test_cached_bakes_are_repeatable():
    world = np.float32([1, 2, 3])
    first, second = (drive(scene(world), SETTINGS).image for _ in range(2))
    assert (first == second).all()
