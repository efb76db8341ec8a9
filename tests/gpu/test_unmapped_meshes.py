from dataclasses import replace

import numpy as np
import pytest

from engine import Mesh, Settings
from engine.patches.unmapped_meshes import place_unmapped
from engine.scene.model import NO_LIGHTMAP
from tests.analytic.drive import drive
from tests.analytic.scenes import furnace, material, quads, room_walls
from tests.rows import long

#: Width of lightmaps, cubes along each axis of a room, cubes in an atlas, and what they emit by turns.
SIDE, CUBES, IN_ATLAS = 17, 4, 10
COLOURS = ((0, 0, 0), (4, 0, 0), (0, 2, 0), (0, 0, 1))


def cubes(baked: bool) -> list[Mesh]:
    """Return cubes that stand apart in the unit cube; if baked, each face has a texel and no neighbours."""
    walls = room_walls(1, 1, 1)[:, ::-1] * 0.09
    made = []
    for number, corner in enumerate(np.ndindex(CUBES, CUBES, CUBES)):
        atlas, index = divmod(number, IN_ATLAS)
        charts = [(2 * (face % 8), 2 * (face // 8), 1, 1) for face in range(6 * index, 6 * index + 6)]
        cube = quads(walls + 0.08 + 0.24 * np.array(corner), charts, [1 + number % 4] * 6, SIDE, "Cube")
        made.append(replace(cube, atlas=1 + atlas if baked else NO_LIGHTMAP))
    return made


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_occluders_in_several_atlases_show_what_they_emit(visibility):
    """More clusters than one atlas has room for: a room looks the same as with charts for all of them."""
    room = furnace(0.0, 0.0)
    colours = (material(f"Cube {colour}", 0, colour) for colour in COLOURS)
    room = replace(room, materials=(*room.materials, *colours))
    baked, hidden = (replace(room, meshes=(*room.meshes, *cubes(each))) for each in (True, False))
    baked = replace(baked, atlases=("Room", *(f"Cubes {i}" for i in range(-(-(CUBES**3) // IN_ATLAS)))))
    assert len(place_unmapped(hidden, SIDE).atlases) == 3
    settings = Settings(
        resolution=SIDE, hemicube=8, max_bounces=1, visibility=visibility, sample_emission=False
    )
    expected, light = drive(baked, settings).image[0], drive(hidden, settings).image[0]

    # A texel of a hemicube that is drawn at a cube's edge may be found just beside its chart.
    differs = np.abs(light - expected).max(axis=2) > 1e-5
    assert differs.mean() < (0.02 if visibility == "raster" else 1e-9) and light.max() > 0.1
