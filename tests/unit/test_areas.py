"""Patch areas of a surface sum to its area, for any position of its charts on the texels."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Scene
from engine.patches.areas import surface_areas
from engine.patches.backs import with_places
from engine.scene.model import NO_LIGHTMAP
from tests.analytic.drive import prepare
from tests.analytic.rooms import Atlas, block
from tests.analytic.scenes import material, quads, rectangle


def test_areas_of_each_mesh_and_material_sum_to_those_of_its_triangles():
    width = 37
    corners = np.stack([rectangle((0, 0, k), (3.1, 0.2, 0), (0, 1.7, 0.4)) for k in range(3)])
    charts = [(1.3, 2.6, 9.9, 5.2), (14.7, 1.1, 3.3, 7.6), (22.2, 3.4, 10.45, 9.01)]
    first = quads(corners, charts, [0, 1, 0], width, "First")
    second = quads(corners[:1] * 2, [(3.6, 20.3, 21.4, 11.8)], [0], width, "Second")
    empty = replace(second.subset(np.zeros(2, bool)), name="Empty")
    scene = Scene((first, empty, second), (material("A", 0.5), material("B", 0.2)))
    prepared = prepare(scene, width)
    areas = surface_areas(prepared.triangles, prepared.patches, prepared.geometry)
    assert areas.dtype == np.float32 and len(areas) == len(prepared.patches)
    sizes = np.linalg.norm(np.cross((3.1, 0.2, 0), (0, 1.7, 0.4))) * np.array([2.0, 1.0, 4.0])
    mesh, surface = prepared.triangles.mesh, prepared.triangles.material
    triangle = prepared.geometry.triangle
    for size, chosen in zip(sizes, ((0, 0), (0, 1), (2, 0)), strict=True):
        of = (mesh[triangle] == chosen[0]) & (surface[triangle] == chosen[1])
        assert areas[of].sum() == pytest.approx(size, rel=1e-5)
        assert prepared.geometry.area[of].sum() != pytest.approx(size, rel=1e-3)


@pytest.mark.filterwarnings("ignore:overflow")
def test_texels_beyond_all_numbers_keep_finite_areas():
    huge = rectangle((0, 0, 0), (3e18, 0, 0), (0, 2e18, 0))
    mesh = quads(huge[None], [(0, 0, 1, 1)], [0], 3, "Huge")
    prepared = prepare(Scene((mesh,), (material("A", 0.5),)), 3)
    assert np.isfinite(surface_areas(prepared.triangles, prepared.patches, prepared.geometry)).all()


def test_each_chart_is_as_large_as_its_triangles():
    """Charts of 3.5 texels have rows of three or of four patches, as they lie; their sum is the same."""
    width = 29
    corners = np.stack([rectangle((0, 0, k), (1, 0, 0), (0, 1, 0)) for k in range(4)])
    charts = [(1, 1, 3.5, 3.5), (7.5, 1.5, 3.5, 3.5), (14.2, 1.7, 3.5, 3.5), (21.6, 8.4, 3.5, 3.5)]
    prepared = prepare(Scene((quads(corners, charts, [0] * 4, width),), (material("A", 0.5),)), width)
    areas = surface_areas(prepared.triangles, prepared.patches, prepared.geometry)
    chart = prepared.geometry.triangle // 2
    assert len(set(np.bincount(chart))) > 1
    assert np.bincount(chart, areas) == pytest.approx(np.ones(4), rel=1e-5)


def test_triangles_without_patches_count_with_others_of_their_surface():
    width = 23
    corners = np.stack([rectangle((0, 0, k), (1, 0, 0), (0, 1, 0)) for k in range(2)])
    charts = [(1.2, 1.3, 5.5, 5.5), (12.1, 12.1, 0.3, 0.3)]
    prepared = prepare(Scene((quads(corners, charts, [0, 0], width),), (material("A", 0.5),)), width)
    areas = surface_areas(prepared.triangles, prepared.patches, prepared.geometry)
    assert set(prepared.geometry.triangle // 2) == {0}
    assert areas.sum() == pytest.approx(2, rel=1e-5)


def test_a_patch_of_a_back_has_the_area_of_all_points_that_show_it():
    """Triangles of blocks of one texel and of many, and small ones that share a texel."""
    width, random = 61, np.random.default_rng(3)
    corners = np.stack([rectangle((0, 0, k), (size, 0.3 * size, 0), (0.2, 0.7 * size, 0.1))
                        for k, size in enumerate((2.9, 1.1, 0.31, 0.17))])  # fmt: skip
    small = np.stack([rectangle((0.03 * k, 0, 9), (0.02, 0, 0), (0, 0.03, 0)) for k in range(5)])
    charts = [(9 * k % 54, 9 * (9 * k // 54), 7, 7) for k in range(9)]
    mesh = quads(np.concatenate([corners, small]), charts, [0] * 9, width, "Cards")
    prepared = prepare(with_places(Scene((mesh,), (material("A", 0.5),)), width), width)
    triangles, patches = prepared.triangles, prepared.patches
    areas = surface_areas(triangles, patches, prepared.geometry)
    expected = np.zeros(len(patches))
    for triangle in range(triangles.solid, len(triangles.mesh)):
        points = random.dirichlet(np.ones(3), 40_000)
        column, row = np.floor(points @ triangles.uvs[triangle] * width).astype(int).T
        key = (triangles.atlas[triangle] * width + row) * width + column
        shown = np.searchsorted(patches.key, key).clip(max=len(patches) - 1)
        shown = shown[patches.key[shown] == key]
        whole = prepared.geometry.steps.whole[triangle]
        expected += whole * np.bincount(shown, minlength=len(patches)) / len(points)
    backs = patches.triangle >= triangles.solid
    assert len(set(np.bincount(patches.triangle[backs]))) > 2
    assert areas[backs].sum() == pytest.approx(
        prepared.geometry.steps.whole[triangles.solid :].sum(), rel=1e-6
    )
    assert areas[backs] == pytest.approx(expected[backs], rel=0.05, abs=2e-5)


def test_backs_of_triangles_that_share_a_texel_keep_their_area():
    """A sheet of small quads without a lightmap: fronts and backs may have the same texel coordinates."""
    width = 64
    places = [(0.01 * i, 0.01 * j, 1) for i in range(20) for j in range(20)]
    corners = [rectangle(place, (0.01, 0, 0), (0, 0.01, 0)) for place in places]
    sheet = quads(np.stack(corners), [(0, 0, 1, 1)] * 400, [0] * 400, width, "Sheet")
    cube = block(Atlas(131), (0, 0, 0), (1, 1, 1), "Block")
    closed = replace(cube, positions=10 * cube.positions - np.float32((0, 0, 10)))
    scene = Scene((closed, replace(sheet, atlas=NO_LIGHTMAP)), (material("A", 0.5),))
    prepared = prepare(with_places(scene, width), width)
    areas = surface_areas(prepared.triangles, prepared.patches, prepared.geometry)
    names = [mesh.name for mesh in with_places(scene, width).meshes]
    backs = [number for number, name in enumerate(names) if name == "Sheet"][-1]
    mine = prepared.triangles.mesh[prepared.patches.triangle] == backs
    assert areas[mine].sum() == pytest.approx(0.04, rel=1e-4)
