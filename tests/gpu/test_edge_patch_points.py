"""Charts that end on texel centres: no ray passes the wall at their edge."""

import numpy as np
import pytest

from engine import Scene, Settings, bake, finished
from engine.patches.edge_patch_points import inset_edge_patches
from engine.patches.geometry import patch_geometry
from engine.patches.patch_list import list_patches
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import material, quads, room_walls

RESOLUTION = 41


def cube(shift: float, offset: float = 0.0) -> Scene:
    """Return a closed cube whose charts begin and end `shift` of a texel after a border of texels."""
    charts = [(1 + shift + 13 * (k % 3), 1 + shift + 13 * (k // 3), 9, 9) for k in range(6)]
    mesh = quads(room_walls(1, 1, 1) + offset, charts, [0] * 6, RESOLUTION, "Cube")
    return Scene((mesh,), (material("Grey", 0.5, 1.0),))


@pytest.mark.parametrize("visibility", ["rays", "raster"])
@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_a_furnace_is_even_up_to_its_edges(visibility, offset):
    """All light is 1 / (1 - 0.5), whoever looks; what looks past a wall sees half of it."""
    settings = Settings(
        resolution=RESOLUTION, hemicube=16, samples=64, visibility=visibility, sample_emission=False,
        texel_samples=1, hide_seams=False, tolerance=1e-4, max_bounces=30,
    )  # fmt: skip
    lightmap = finished(bake(cube(0.5, offset), settings))
    light = lightmap.image[lightmap.has_patch]
    assert len(light) == 6 * 81
    assert light == pytest.approx(np.full(light.shape, 2.0), abs=4e-3)
    assert lightmap.report.energy.escaped == 0


@pytest.mark.parametrize("shift", [0.0, 0.2, 0.5, 0.515])
def test_only_patches_on_edges_move_and_stay_within_their_texels(graphics, compute, shift):
    scene = cube(shift)
    triangles = join_meshes(scene)
    patches = list_patches(graphics, scene, triangles, RESOLUTION)
    geometry, own = patch_geometry(triangles, patches), patches.on_texels(1)
    places = {}
    for device in (compute, None):
        moved = inset_edge_patches(device, geometry, patches, own)
        uvs = np.einsum("nk,nkd->nd", moved.barycentric, triangles.uvs[moved.triangle]) * RESOLUTION
        places[device] = uvs - np.stack([moved.texel % RESOLUTION, moved.texel // RESOLUTION], axis=1)
    assert np.allclose(places[compute], places[None], atol=1e-4)
    off = np.abs(places[compute] - 0.5).max(axis=1)
    assert off.max() < 0.5
    assert (off > 0.1).any() == (shift >= 0.5)
    inner = (np.abs(places[compute] - 0.5) < 1e-3).all(axis=1)
    assert inner.sum() >= 6 * 49
