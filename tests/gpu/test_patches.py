import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Scene, SceneError, Settings
from engine.device.device_rows import host_rows
from engine.object_message import objects_of
from engine.patches import chart_raster, patch_scene
from engine.patches.chart_raster import ALIGNED, OVERLAP, PATCHES, TOUCHED
from engine.patches.chart_texels import ChartTexels
from engine.patches.device_charts import DeviceCharts, fits_device
from engine.patches.device_patch_list import list_patches_on
from engine.patches.geometry import patch_geometry, texel_steps
from engine.patches.patch_list import list_patches
from engine.patches.patch_scene import make_patch_scene
from engine.patches.texel_coverage import (
    border_texels,
    border_texels_on,
    check_overlap,
    cover_counts,
    covered_texels,
)
from engine.patches.texel_to_patch import index_map
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import furnace, nine_quad_room, quads, rectangle

GREY = Material("grey", np.full(3, 0.5, np.float32), np.zeros(3, np.float32))


def one_quad(chart, resolution=16, name="Quad"):
    corners = rectangle((1, 2, 3), (4, 0, 0), (0, 2, 0))[None]
    return quads(corners, [chart], [0], resolution, name)


def grown(graphics, compute, scene, resolution):
    triangles, atlases = join_meshes(scene), len(scene.atlases)
    if compute:
        drawn = DeviceCharts(graphics, compute, triangles, atlases, resolution)
        covered, counts = list_patches_on(drawn, scene)
        border = border_texels_on(drawn, covered.index.entries_in(atlases))
    else:
        covered = list_patches(graphics, scene, triangles, resolution)
        border = border_texels(graphics, triangles, covered.on_texels(atlases))
        counts = patch_geometry(triangles, covered).on_triangle
    steps = texel_steps(triangles, resolution)
    charts = ChartTexels((), covered, counts, covered.index.entries_in(atlases), border, ())
    index = index_map(compute, patch_geometry(triangles, covered, steps), charts, None)
    geometry = patch_geometry(triangles, index.patches, steps)
    if index.on_triangle is not None:
        assert np.array_equal(host_rows(index.on_triangle), geometry.on_triangle)
    return covered, index.patches, geometry, host_rows(index.texel_to_patch)


def test_texels_of_a_quad_become_patches(graphics):
    scene = Scene((one_quad((4, 6, 8, 5), 17),), (GREY,))
    patches = list_patches(graphics, scene, join_meshes(scene), 17)
    rows, columns = np.divmod(patches.texel, 17)
    assert len(patches) == 40
    assert set(zip(rows, columns, strict=True)) == {(y, x) for y in range(6, 11) for x in range(4, 12)}
    assert set(patches.triangle) == {0, 1}
    np.testing.assert_allclose(patches.barycentric.sum(axis=1), 1, atol=1e-6)


def test_centres_normals_and_areas_follow_from_the_barycentrics(graphics):
    scene = Scene((one_quad((4, 6, 8, 5), 17),), (GREY,))
    patches = list_patches(graphics, scene, join_meshes(scene), 17)
    geometry = patch_geometry(join_meshes(scene), patches)
    rows, columns = np.divmod(patches.texel, 17)
    expected = np.stack([1 + (columns - 4 + 0.5) / 2, 2 + (rows - 6 + 0.5) / 2.5, np.full(40, 3)], axis=1)
    np.testing.assert_allclose(geometry.center + geometry.triangles.origin, expected, atol=1e-4)
    np.testing.assert_allclose(geometry.normal, np.tile([0, 0, 1], (40, 1)), atol=1e-6)
    np.testing.assert_allclose(geometry.geometric, np.tile([0, 0, 1], (40, 1)), atol=1e-6)
    np.testing.assert_allclose(geometry.area, 0.2, rtol=1e-5)
    np.testing.assert_allclose(geometry.edge_u, np.tile([0.5, 0, 0], (40, 1)), atol=1e-5)


def test_triangles_of_meshes_and_atlases_are_told_apart(graphics):
    """Three meshes, of which the first and the last share an atlas, and one without faces between them."""
    room = nine_quad_room().meshes[0]
    second = replace(one_quad((2, 2, 8, 4), 128, "Second"), atlas=1)
    nothing = second.subset(np.zeros(2, bool))
    third = one_quad((0, 124, 7, 3), 128, "Third")
    scene = Scene((room, second, nothing, third), nine_quad_room().materials, ("First", "Second"))
    triangles = join_meshes(scene)
    patches = list_patches(graphics, scene, triangles, 128)
    mesh = triangles.mesh[patches.triangle]
    assert set(patches.triangle) == set(range(22))
    assert (patches.atlas == (mesh == 1)).all()
    assert (mesh == 1).sum() == 32 and (mesh == 3).sum() == 21
    for number in range(22):
        uv = patches.barycentric[patches.triangle == number] @ triangles.uvs[number].astype(np.float64)
        rows, columns = np.divmod(patches.texel[patches.triangle == number], 128)
        assert uv * 128 == pytest.approx(np.stack([columns, rows], axis=1) + 0.5, abs=1e-3)


def test_patches_on_slivers_lie_on_their_triangles(graphics):
    """Rasterisation finds barycentrics of thousands, or NaN, for triangles thinner than its own grid."""
    rng, count = np.random.default_rng(0), 20000
    start, angle = rng.random((count, 2)), rng.random(count) * 2 * np.pi
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.random((count, 1)) * 0.3
    across = along[:, ::-1] * (-1, 1) * 10 ** rng.uniform(-9, -2, (count, 1))
    corners = [start, start + along, start + along * rng.random((count, 1)) + across]
    square = quads(
        np.tile(rectangle((1e3, 0, 0), (1, 0, 0), (0, 1, 0)), (count, 1, 1)),
        [(0, 0, 1, 1)] * count,
        [0] * count,
        1,
    )
    slivers = square.subset(square.subface == 0)
    slivers = replace(slivers, uvs=np.stack(corners, axis=1).clip(0, 1).astype(np.float32))
    scene = Scene((slivers,), (GREY,))
    patches = list_patches(graphics, scene, join_meshes(scene), 331)
    assert patches.barycentric.min() >= 0 and len(patches) > 10000
    np.testing.assert_allclose(patches.barycentric.sum(axis=1), 1, rtol=1.1e-6)
    geometry = patch_geometry(join_meshes(scene), patches)
    center = geometry.center + geometry.triangles.origin
    assert (np.abs(center - (1000.5, 0.5, 0)).max(axis=1) <= 0.501).all()


def test_one_atlas_is_held_at_a_time(graphics):
    """Both targets take 12 bytes a texel; what all atlases hold is the patches, few here."""
    resolution, atlases = 509, 7
    meshes = [replace(one_quad((3, 5, 7, 11), resolution), atlas=atlas) for atlas in range(atlases)]
    scene = Scene(tuple(meshes), (GREY,), tuple(map(str, range(atlases))))
    tracemalloc.start()
    try:
        patches = list_patches(graphics, scene, join_meshes(scene), resolution)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(patches) == atlases * 77 and most < 2 * 12 * resolution**2


def test_texels_of_fewer_atlases_are_a_part_of_all(graphics):
    charts = (0, 0, 7, 11), (1, 0, 8, 5), (2, 3, 9, 9)
    meshes = (replace(one_quad(chart, 17), atlas=atlas) for atlas, chart in enumerate(charts))
    scene = Scene(tuple(meshes), (GREY,), atlases=("A", "B", "C"))
    for order in (1, 2, 3), (3, 2, 1):
        patches = list_patches(graphics, scene, join_meshes(scene), 17)
        for atlases in order:
            entries = patches.on_texels(atlases)
            assert entries.shape == (atlases, 17, 17) and entries is patches.on_texels(atlases)
            covered = np.flatnonzero(entries)
            assert covered.tolist() == patches.key[patches.atlas < atlases].tolist()
            assert entries.ravel()[covered].tolist() == list(range(1, len(covered) + 1))


def test_nothing_covered_is_an_error(graphics):
    scene = Scene((one_quad((0, 0, 1, 1), 4099),), (GREY,))
    with pytest.raises(SceneError, match="No texel.*'Quad'.*[Uu]nwrap"):
        list_patches(graphics, scene, join_meshes(scene), 17)


def overlap_notes(graphics, scene, triangles):
    patches = list_patches(graphics, scene, triangles, 19)
    texels = covered_texels(scene, patch_geometry(triangles, patches))
    return check_overlap(scene, triangles, patches, cover_counts(graphics, triangles, 1, 19), texels)


def test_overlap_names_both_objects(graphics):
    charts = {"Apart": (1, 1, 2, 2), "Table": (2, 4, 8, 8), "Chair": (6, 8, 11, 8)}
    scene = Scene(tuple(one_quad(chart, 19, name) for name, chart in charts.items()), (GREY,))
    triangles = join_meshes(scene)
    with pytest.raises(SceneError, match="overlap in atlas 'Lightmap'.*'Table', 'Chair'.*[Pp]ack"):
        overlap_notes(graphics, scene, triangles)


def test_shared_borders_are_no_overlap(graphics):
    scene = Scene((one_quad((2, 2, 5, 8), 19), one_quad((7, 2, 7, 8), 19)), (GREY,))
    triangles = join_meshes(scene)
    assert overlap_notes(graphics, scene, triangles) == []


def test_many_objects_with_texels_covered_twice_get_one_warning(graphics):
    charts = {"A": (1, 1, 4, 4), "B": (4, 4, 4, 4), "C": (10, 1, 4, 4), "D": (13, 4, 4, 4)}
    scene = Scene(tuple(one_quad(chart, 19, name) for name, chart in charts.items()), (GREY,))
    (note,) = overlap_notes(graphics, scene, join_meshes(scene))
    assert len(objects_of(note)) == 2 and "2 lightmap texels" in note and note.endswith("padding.")


def test_every_texel_a_surface_touches_belongs_to_a_patch_of_that_surface(graphics, compute):
    """A quad whose borders lie within texels: its border texels belong to its own patches."""
    mesh = one_quad((4, 6, 8, 4))
    uvs = mesh.uvs * 0.83 + 0.041
    scene = Scene((replace(mesh, uvs=uvs),), (GREY,))
    covered, patches, _, texel_to_patch = grown(graphics, compute, scene, 16)
    assert len(patches) == len(covered)
    low, high = uvs.reshape(-1, 2).min(axis=0) * 16, uvs.reshape(-1, 2).max(axis=0) * 16
    for y in range(int(low[1]), int(np.ceil(high[1]))):
        for x in range(int(low[0]), int(np.ceil(high[0]))):
            assert texel_to_patch[0, y, x] > 0
    assert (texel_to_patch > 0).sum() > len(covered)


def test_a_sliver_without_a_covered_centre_gets_a_patch_of_its_own(graphics, compute):
    mesh = one_quad((4, 6, 8, 4))
    thin = mesh.uvs * np.float32([1, 0.01]) + np.float32([0, 0.9])
    sliver = replace(mesh, name="Sliver", positions=mesh.positions + 50, uvs=thin)
    scene = Scene((mesh, sliver), (GREY,))
    covered, patches, geometry, texel_to_patch = grown(graphics, compute, scene, 16)
    added = patches.triangle >= 2
    assert (covered.triangle < 2).all() and added.sum() == 8
    assert (geometry.center[added] + geometry.triangles.origin > 45).all()
    assert (texel_to_patch[0].ravel()[patches.texel] == np.arange(1, len(patches) + 1)).all()


def test_patch_order_and_ids_do_not_depend_on_charts_touching_the_border(graphics, compute):
    covered, patches, _, texel_to_patch = grown(graphics, compute, furnace(0.5, 1.0), 32)
    assert len(patches) == len(covered) == 6 * 64
    assert (np.diff(patches.texel) > 0).all()
    assert (texel_to_patch[0].ravel()[patches.texel] == np.arange(1, len(patches) + 1)).all()


def test_borders_of_many_slivers_are_those_of_the_host(graphics, compute):
    """Triangles of every size and direction, in two atlases and in meshes that meet in the world."""
    rng, count, resolution = np.random.default_rng(3), 3001, 173
    start, angle = rng.random((count, 2)), rng.random(count) * 2 * np.pi
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 10 ** rng.uniform(-4, -1, (count, 1))
    across = along[:, ::-1] * (-1, 1) * 10 ** rng.uniform(-6, 0, (count, 1))
    uvs = np.stack([start, start + along, start + along * rng.random((count, 1)) + across], axis=1)
    uvs = uvs.clip(0, 1).astype(np.float32)
    square = quads(
        np.tile(rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), (count, 1, 1)),
        [(0, 0, 1, 1)] * count,
        [0] * count,
        1,
    )
    positions = np.concatenate([uvs, np.zeros((count, 3, 1), np.float32)], axis=2)
    slivers = replace(square.subset(square.subface == 0), uvs=uvs, positions=positions)
    parts = [replace(slivers.subset(np.arange(count) % 3 == part), atlas=part // 2) for part in range(3)]
    scene = Scene(tuple(parts), (GREY,), ("First", "Second"))
    covered, expected, _, wanted = grown(graphics, None, scene, resolution)
    _, patches, _, texel_to_patch = grown(graphics, compute, scene, resolution)

    # float32 and float64 take a few texels for thin, or a neighbour for near enough, that the other does not.
    assert len(expected) > len(covered) + 100
    both, mine, theirs = np.intersect1d(patches.key, expected.key, return_indices=True)
    assert len(both) > 0.999 * max(len(patches), len(expected))
    off = np.abs(patches.barycentric[mine] - expected.barycentric[theirs]).max(axis=1)
    assert np.quantile(off, 0.99) < 1e-3
    same = np.r_[-1, patches.key][texel_to_patch] == np.r_[-1, expected.key][wanted]
    assert same.mean() > 0.999


def test_patches_of_the_device_are_those_of_the_host(graphics, compute):
    """Meshes of three atlases in alternating order, slivers among them: all columns and lookups are equal."""
    random, count, resolution = np.random.default_rng(11), 900, 67
    start = random.random((count, 1, 2))
    spread = 10 ** random.uniform(-4, -0.5, (count, 1, 1)) * random.uniform(-1, 1, (count, 3, 2))
    square = quads(
        np.tile(rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), (count, 1, 1)),
        [(0, 0, 1, 1)] * count,
        [0] * count,
        1,
    )
    slivers = square.subset(square.subface == 0)
    slivers = replace(slivers, uvs=(start + spread).clip(0, 1).astype(np.float32))
    parts = [replace(slivers.subset(np.arange(count) % 5 == part), atlas=part % 3) for part in range(5)]
    scene = Scene(tuple(parts), (GREY,), ("A", "B", "C"))
    triangles = join_meshes(scene)
    expected = list_patches(graphics, scene, triangles, resolution)
    drawn = DeviceCharts(graphics, compute, triangles, 3, resolution)
    patches, counts = list_patches_on(drawn, scene)
    for name in ("atlas", "texel", "triangle", "key"):
        assert np.array_equal(getattr(patches, name), getattr(expected, name))
    assert patches.barycentric == pytest.approx(expected.barycentric, rel=3e-7)
    assert [patches.count_in(atlases) for atlases in range(4)] == [expected.count_in(n) for n in range(4)]
    assert np.array_equal(patches.on_texels(3), expected.on_texels(3))
    assert patches.on_texels(3) is host_rows(patches.index.entries_in(3))
    assert np.array_equal(host_rows(counts), patch_geometry(triangles, expected).on_triangle)
    covers = cover_counts(graphics, triangles, 3, resolution)
    assert all(np.array_equal(mine, theirs) for mine, theirs in zip(drawn.counts, covers, strict=True))
    border = border_texels_on(drawn, patches.index.entries_in(3))
    wanted = border_texels(graphics, triangles, expected.on_texels(3))
    assert np.array_equal(border.texel, wanted.texel) and np.array_equal(border.triangle, wanted.triangle)


def test_charts_beyond_the_device_are_listed_on_the_host(graphics, compute, monkeypatch):
    assert fits_device(compute, 1000)
    assert not fits_device(compute, 1 << 31) and not fits_device(compute, 0)
    scene = nine_quad_room()
    bakes = []
    for fits in (True, False):
        monkeypatch.setattr(patch_scene, "fits_device", lambda *_, fits=fits: fits)
        bakes.append(make_patch_scene(graphics, compute, scene, Settings(resolution=61)))
    for name in ("texel", "triangle"):
        assert np.array_equal(*(getattr(made.patches, name) for made in bakes))
    one, other = (made.patches.barycentric for made in bakes)
    assert one == pytest.approx(other, abs=1e-5)
    assert np.array_equal(*(made.texel_to_patch for made in bakes))


@pytest.mark.parametrize("resolution", [17, 331])
def test_aligned_quads_are_covered_whole_or_not_at_all(graphics, resolution):
    """Quads whose sides lie anywhere: the shader moves them to the nearest borders of texels."""
    random = np.random.default_rng(resolution)
    for low, size in zip(random.uniform(1, 7, (20, 2)), random.uniform(0.6, 8, (20, 2)), strict=True):
        scene = Scene((one_quad((*low, *size), resolution),), (GREY,))
        patches = list_patches(graphics, scene, join_meshes(scene), resolution, align=True)
        (x0, y0), (x1, y1) = np.floor(low + 0.5).astype(int), np.floor(low + size + 0.5).astype(int)
        rows, columns = np.divmod(patches.texel, resolution)
        found = set(zip(rows, columns, strict=True))
        assert found == {(y, x) for y in range(y0, y1) for x in range(x0, x1)} or x1 == x0 or y1 == y0
        assert len(patches) and patches.barycentric.min() >= 0
        np.testing.assert_allclose(patches.barycentric.sum(axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("top", [0.002, 0.31, 0.994, 1.0, 1.7, float("nan")])
@pytest.mark.parametrize("drawing", [PATCHES, ALIGNED, TOUCHED, OVERLAP])
def test_rows_above_all_charts_are_not_drawn_and_have_nothing(graphics, monkeypatch, drawing, top):
    resolution = 37
    uvs = np.random.default_rng(5).random((29, 3, 2)).astype(np.float32) * np.float32([1, 0.3])
    uvs[7, 1, 1] = top
    low = chart_raster.draw_charts(graphics, drawing, uvs, resolution)
    monkeypatch.setattr(chart_raster, "_rows_with_charts", lambda uvs, resolution: resolution)
    for some, every in zip(low, chart_raster.draw_charts(graphics, drawing, uvs, resolution), strict=True):
        assert len(some) % resolution == 0 and np.array_equal(some, every[: len(some)])
        assert not every[len(some) :].any()
    assert len(low[0]) < resolution**2 or not top < 0.9
