import pytest

from engine.errors import SettingsError
from engine.settings import Settings
from engine.visibility.raster.tiles import Tiles, plan_tiles


def test_paper_layouts():
    tiles = plan_tiles(Settings(hemicube=128, array_size=(1024, 768, 2)), 10700)
    assert tiles == Tiles(128, 8, 2, 2) and (tiles.width, tiles.height, tiles.capacity) == (1024, 768, 32)
    assert plan_tiles(Settings(hemicube=64, array_size=(1024, 1024, 8)), 10700).per_layer == 16 * 5


def test_origins_tile_the_layer():
    tiles = Tiles(8, 4, 2, 1)
    assert [tiles.origin(tile) for tile in (0, 3, 4, 7)] == [(0, 0), (24, 0), (0, 24), (24, 24)]


def test_automatic_layout_fits_the_batch_memory_and_the_patches():
    tiles = plan_tiles(Settings(hemicube=64, batch_bytes=64 << 20), 10**6)
    assert tiles.columns == 3 and tiles.capacity * 3 * 64 * 64 * 52 <= 64 << 20
    denser = plan_tiles(Settings(hemicube=64, batch_bytes=64 << 20), 10**6, texel_bytes=20)
    assert tiles.capacity < denser.capacity <= (64 << 20) / (3 * 64 * 64 * 20)
    assert plan_tiles(Settings(hemicube=8), 5).capacity == 6


@pytest.mark.parametrize("size", [(32, 1024, 1), (1024, 100, 1), (1024, 1024, 0), (16384, 16384, 2)])
def test_impossible_arrays(size):
    with pytest.raises(SettingsError, match="array_size"):
        plan_tiles(Settings(hemicube=64, array_size=size), 100)
