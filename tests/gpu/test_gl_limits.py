"""Arrays as large as OpenGL 4.1 has to offer: 16384 texels, 2048 layers, 16 viewports."""

import dataclasses

import numpy as np
import pytest

from engine import Settings
from engine.visibility.raster import raster
from engine.visibility.raster.tiles import Tiles, plan_tiles
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace
from tests.gpu.test_raster import pictures
from tests.rows import long

QUICK = Settings(resolution=32, hemicube=8, max_bounces=2, tolerance=0, visibility="raster")


@pytest.mark.parametrize(
    "size", [(16384, 24, 8), long((1024, 384, 8)), long((8, 24, 2048))], ids=["width", "hemicubes", "layers"]
)
@pytest.mark.parametrize("method", ["cached", "paper"])
def test_the_largest_arrays_give_the_same_light(method, size):
    settings = dataclasses.replace(QUICK, method=method)
    expected = drive(furnace(0.5, 1.0), settings).image
    large = drive(furnace(0.5, 1.0), dataclasses.replace(settings, array_size=size)).image
    assert (large == expected).all()


def test_a_batch_without_end_has_as_many_layers_as_there_may_be():
    tiles = plan_tiles(dataclasses.replace(QUICK, batch_bytes=1 << 50), 10**9)
    assert (tiles.layers, tiles.capacity) == (2048, 3 * 2048)


def test_the_memory_of_culling_does_not_grow_with_the_hemicubes_of_a_layer(graphics, monkeypatch):
    """Few hemicubes are tested at once, though a layer holds 35; the picture stays the same."""
    tiles, tested = Tiles(8, 7, 5, 2), []
    expected = pictures(graphics, tiles, "layer")
    monkeypatch.setattr(raster, "_TESTS", 50)
    visible = raster.TriangleClusters.visible

    def watched(clusters, matrices):
        tested.append(len(clusters) * len(matrices))
        return visible(clusters, matrices)

    monkeypatch.setattr(raster.TriangleClusters, "visible", watched)
    assert pictures(graphics, tiles, "layer") == expected
    assert max(tested) <= 50 and np.sum(tested) == 12 * (tiles.capacity - 1)
