"""Charts and packing, from arrays to arrays, with real and simulated results of xatlas."""

import dataclasses
import time
import weakref
from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from engine import array_ops
from engine.errors import WorkerError
from engine.progress import finished
from engine.unwrap import atlas_bitmap, packing, segmentation
from engine.unwrap.adjacency import polygon_normals
from engine.unwrap.alignment import Alignment
from engine.unwrap.chart_options import USUAL
from engine.unwrap.charts import flatten, make_charts
from engine.unwrap.packing import PADDING, pack_charts
from engine.unwrap.planar import doubly_covered, project_flat
from engine.unwrap.polygon_mesh import MeshCharts, PolygonMesh, areas, signed_areas
from engine.unwrap.row_spans import border_spans, row_spans
from engine.unwrap.segmentation import has_xatlas
from engine.unwrap.unplaced_charts import orient_charts
from engine.unwrap.unwrapping import PackJob, unwrap
from engine.worker.disposable import run_apart
from engine.worker.worker import Worker
from tests.tools.levels import level

needs_xatlas = pytest.mark.skipif(not has_xatlas(), reason="no xatlas for this Python")


def polygons(corners, sides=4):
    """Return a mesh of separate polygons, (p, sides, 3), as fans of triangles."""
    corners = np.asarray(corners, np.float64)
    count = len(corners)
    fan = np.array([(0, k, k + 1) for k in range(1, sides - 1)])
    triangles = (np.arange(count)[:, None, None] * sides + fan).reshape(-1, 3)
    return PolygonMesh(
        name="Polygons",
        positions=corners.reshape(-1, 3),
        corners=np.arange(sides * count, dtype=np.int32),
        starts=np.arange(0, sides * count + 1, sides, dtype=np.int32),
        triangles=triangles.astype(np.int32),
        polygon=np.repeat(np.arange(count, dtype=np.int32), sides - 2),
    )


def flat_charts(mesh):
    """Return each polygon of a mesh in the plane z = 0 as a chart."""
    return MeshCharts(mesh.positions[mesh.corners][:, :2].copy(), mesh.polygon.astype(np.int64))


def rectangles(sizes, seed=0):
    """Return rectangles of sizes, (p, 2), turned by any angle."""
    unit = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    flat = unit * np.asarray(sizes, np.float64)[:, None]
    angle = np.random.default_rng(seed).uniform(0, 7, len(flat))
    turn = np.stack([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    return polygons(np.concatenate([flat @ turn, np.zeros((len(flat), 4, 1))], axis=2))


def steps(count, seed):
    """Return polygons in the form of an L, of any size, and of an L with a slanted end."""
    random, corners = np.random.default_rng(seed), []
    for index in range(count):
        (w, h), (a, b) = random.uniform(1, 3, 2), random.uniform(0.2, 0.8, 2)
        lean = 0.3 * (index % 3 == 0)
        corners.append(
            [(0, 0, 0), (w + lean, 0, 0), (w, b * h, 0), (a * w, b * h, 0), (a * w, h, 0), (0, h, 0)]
        )
    return polygons(corners, 6)


def pieces(count, seed):
    """Return triangles and thin slivers of sizes that differ by orders of magnitude."""
    random = np.random.default_rng(seed)
    corners = random.normal(size=(count, 3, 3)) * np.exp(random.normal(size=(count, 1, 1)))
    corners[..., 2] = 0
    corners[::5, :, 1] *= 1e-3
    return polygons(corners, 3)


def touched(mesh, charts, uvs, resolution):
    """Return the chart that touches each texel, -1 for none; fail if two touch one texel."""
    owner = np.full((resolution, resolution), -1)
    corners = uvs[mesh.triangles].astype(np.float64) * resolution
    rise = np.full((len(np.unique(charts.chart)), 2), resolution)
    for chart, row, first, end in zip(*row_spans(corners, charts.chart, rise), strict=True):
        texels = owner[row, first:end]
        assert ((texels == -1) | (texels == chart)).all()
        texels[:] = chart
    return owner


def least_gap(owner):
    """Return the least number of free texels between two charts, along an axis or a diagonal, up to 9."""
    size = len(owner)
    for gap in range(1, 10):
        for dy in range(-gap, gap + 1):
            for dx in range(gap + 1):
                here = owner[max(0, -dy) : size - max(0, dy), : size - dx]
                there = owner[max(0, dy) : size - max(0, -dy), dx:]
                if ((here >= 0) & (there >= 0) & (here != there)).any():
                    return gap - 1
    return 9


CASES = {
    "one triangle": lambda: polygons([[(0, 0, 0), (1, 0, 0), (0.2, 0.7, 0)]], 3),
    "rectangles": lambda: rectangles(np.random.default_rng(1).uniform(0.1, 3, (57, 2))),
    "one long, many small": lambda: rectangles([(40, 1), *[(0.5, 0.3)] * 90]),
    "pieces": lambda: pieces(301, 2),
    "a line and a point": lambda: polygons(
        [[(0, 0, 0), (1, 1, 0), (2, 2, 0)], [(1, 1, 0)] * 3, [(0, 0, 0), (3, 0, 0), (0, 2, 0)]], 3
    ),
}


@pytest.mark.parametrize("resolution", [127, 256])
@pytest.mark.parametrize("case", CASES)
def test_charts_keep_their_distance(case, resolution):
    mesh = CASES[case]()
    charts = flat_charts(mesh)
    (uvs,) = finished(pack_charts([mesh], [charts], resolution))
    assert uvs.min() > 0 and uvs.max() < 1
    assert least_gap(touched(mesh, charts, uvs, resolution)) >= PADDING


def test_charts_are_in_proportion_to_their_size_and_fill_the_page():
    mesh = rectangles(np.random.default_rng(3).uniform(0.5, 3, (31, 2)))
    (uvs,) = finished(pack_charts([mesh], [flat_charts(mesh)], 509))
    covered = np.abs(signed_areas(uvs[mesh.triangles].astype(np.float64)))
    ratio = covered / areas(mesh.positions[mesh.corners[mesh.triangles]])
    assert ratio.max() < 1.1 * ratio.min()
    assert covered.sum() > 0.65


def test_rectangles_lie_on_borders_of_texels():
    mesh = rectangles([(2, 1.1), (0.3, 0.4), (1e-4, 2)])
    (uvs,) = finished(pack_charts([mesh], [flat_charts(mesh)], 97))
    texels = uvs.astype(np.float64) * 97
    assert texels[:8] == pytest.approx(np.round(texels[:8]), abs=1e-3)
    assert np.ptp(texels.reshape(3, 4, 2), axis=1).min() >= 1 - 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_borders_along_the_axes_lie_between_texels(seed):
    """Aligned or not charts keep their distance; aligned ones touch no texel in part but along the slants."""
    mesh = steps(37, seed)
    charts, slanted = flat_charts(mesh), np.arange(37) % 3 == 0
    off = {}
    for align in (False, True):
        (uvs,) = finished(pack_charts([mesh], [charts], 251, align=align))
        corners = uvs.reshape(-1, 6, 2)[~slanted].astype(np.float64) * 251
        off[align] = np.abs(corners - corners.round()).max(axis=(1, 2))
        owner = touched(mesh, charts, uvs, 251)
        assert least_gap(owner) >= PADDING
        if align:
            areas = np.abs(signed_areas(uvs[mesh.triangles].astype(np.float64))) * 251**2
            for chart in np.flatnonzero(~slanted):
                assert areas[charts.chart == chart].sum() == pytest.approx((owner == chart).sum(), rel=1e-4)
    assert off[True].max() < 1e-3 < np.median(off[False])


def test_alignment_moves_nothing_by_more_than_half_a_texel_and_turns_no_face_over():
    """Grids of uneven squares, some narrower than a texel, with holes."""
    random = np.random.default_rng(5)
    across = np.cumsum(random.uniform(0.05, 2, 19))
    points = np.stack([*np.meshgrid(across, across), np.zeros((19, 19))], axis=-1)
    first = np.flatnonzero(random.random(18 * 18) < 0.8)
    first += first // 18
    quads = first[:, None] + np.array([0, 1, 20, 19])
    texels = points.reshape(-1, 3)[quads][..., :2].reshape(-1, 2) - across[0]
    chart, size = np.zeros(len(texels), np.int64), np.ceil(texels.max(axis=0)).astype(np.int64)[None]
    texels *= size[0] / texels.max(axis=0)
    loops = np.arange(len(texels)).reshape(-1, 4)
    borders = np.stack([loops, np.roll(loops, -1, axis=1)], axis=-1).reshape(-1, 2)
    moved = Alignment(texels, chart, borders, size).moved(texels, chart)
    assert np.abs(moved - texels).max() <= 0.5 + 1e-6
    before, after = (signed_areas(each[loops[:, :3]]) for each in (texels, moved))
    assert (before > 0).all() and (after > 0).all()


@pytest.mark.parametrize("case", ["pieces", "steps", "level"])
def test_borders_touch_the_texels_that_triangles_do(case):
    mesh = {
        "pieces": lambda: pieces(97, 3),
        "steps": lambda: steps(23, 1),
        "level": lambda: level(600, seed=3),
    }[case]()
    charts = make_charts(mesh, *segments_of(mesh)) if case == "level" else flat_charts(mesh)
    loose = finished(orient_charts([mesh], [charts]))
    boxes = np.maximum(np.round(7.3 * loose.size), 1).astype(np.int64)
    texels = loose.uvs * (boxes / loose.size)[loose.chart]
    corners = mesh.triangles[charts.chart >= 0]
    by_triangles = row_spans(texels[corners], loose.chart[corners[:, 0]], boxes)
    by_borders = border_spans(texels[loose.borders], loose.chart[loose.borders[:, 0]], boxes)
    masks = []
    for spans in (by_triangles, by_borders):
        mask = np.zeros((len(boxes), *boxes.max(axis=0)[::-1]), bool)
        for chart, row, first, end in zip(*spans, strict=True):
            mask[chart, row, first:end] = True
        masks.append(mask)
    assert not (masks[0] & ~masks[1]).any() and (masks[1] & ~masks[0]).sum() <= 0.01 * masks[0].sum()


@needs_xatlas
def test_rings_leave_little_free():
    """A torus: two rings, which are cut, and arcs that nest."""
    angle = np.linspace(0, 2 * np.pi, 49)[:-1]
    u, v = np.meshgrid(angle, angle, indexing="ij")
    away = 1 + 0.3 * np.cos(v)
    points = np.stack([away * np.cos(u), away * np.sin(u), 0.3 * np.sin(v)], axis=-1)
    number, around = np.arange(48 * 48).reshape(48, 48), ((0, 0), (1, 0), (1, 1), (0, 1))
    quads = np.stack([np.roll(number, (-i, -j), (0, 1)) for i, j in around], axis=-1)
    mesh = of_quads(points.reshape(-1, 3), quads.reshape(-1, 4))
    (square,) = finished(unwrap([mesh], [None], [PackJob((0,), 512)])).squares
    assert np.abs(signed_areas(square.uvs[0][mesh.triangles].astype(np.float64))).sum() > 0.59


@needs_xatlas
def test_options_of_cutting_count():
    """A knobbly ball: a higher cost makes fewer charts; a ridge is a crease from its own angle on."""
    knobs = lambda u, v: 1 + 0.2 * np.sin(19 * u) * np.sin(13 * v)  # noqa: E731
    mesh = lattice(16, 16, lambda u, v: [axis * knobs(u, v) for axis in sphere(u, v)])
    counts = [
        int(finished(segmentation.segment([mesh], replace(USUAL, largest_cost=cost)))[0][1].max()) + 1
        for cost in (0.5, 8.0)
    ]
    assert counts[0] > 1.2 * counts[1]
    ridge = lattice(2, 1, lambda u, v: (2 * u, v, np.maximum(2 * u - 1, 0) * 0.6))
    assert [int(project_flat(ridge, crease).chart.max()) + 1 for crease in (0.5, 0.6)] == [2, 1]


def test_edges_that_are_parted_end_charts_where_a_whole_line_is():
    sheet = grid(6, 4)
    middle = sheet.positions[np.stack([sheet.corners, sheet.corners[sheet.after]], axis=1)].mean(axis=1)
    line = np.flatnonzero(middle[:, 0] == 2)
    for parted, count in ((line, 2), (line[:2], 1), (np.zeros(0, np.int64), 1)):
        chart = project_flat(replace(sheet, parted=parted)).chart
        assert chart.min() == 0 and chart.max() + 1 == count


def test_thousands_of_charts_are_packed_soon():
    random = np.random.default_rng(4)
    meshes = [rectangles(random.uniform(0.1, 2, (600, 2)), seed) for seed in range(5)]
    charts, began = [flat_charts(mesh) for mesh in meshes], time.process_time()
    packed = finished(pack_charts(meshes, charts, 1024))
    assert time.process_time() - began < 10
    corners = [uvs[mesh.triangles].astype(np.float64) for mesh, uvs in zip(meshes, packed, strict=True)]
    assert np.abs(signed_areas(np.concatenate(corners))).sum() > 0.4


def test_packing_is_the_same_each_time():
    mesh = pieces(101, 5)
    first, second = (finished(pack_charts([mesh], [flat_charts(mesh)], 211))[0] for _ in range(2))
    assert (first == second).all()


@pytest.mark.parametrize("align", [True, False])
def test_places_do_not_depend_on_the_number_of_loops_in_a_block(align, monkeypatch):
    for mesh in (pieces(101, 5), steps(53, 6)):
        packed = []
        for block in (1 << 13, 7):
            monkeypatch.setattr(array_ops, "_BLOCK", block)
            packed.append(finished(pack_charts([mesh], [flat_charts(mesh)], 211, align=align))[0])
        np.testing.assert_array_equal(*packed)


def test_charts_that_do_not_fit_are_refused():
    mesh = rectangles(np.ones((400, 2)))
    assert finished(pack_charts([mesh], [flat_charts(mesh)], 48)) is None
    assert finished(pack_charts([mesh], [flat_charts(mesh)], 1)) is None


def test_long_charts_do_not_make_an_immense_page(monkeypatch):
    mesh, heights = rectangles([(1e5, 1e-3), (3e4, 1e-3)]), []
    monkeypatch.setattr(
        packing, "AtlasBitmap", lambda *args: heights.append(atlas_bitmap.AtlasBitmap(*args)) or heights[-1]
    )
    finished(pack_charts([mesh], [flat_charts(mesh)], 127))
    assert max((made.height for made in heights), default=0) < 4 * 127


def test_surfaces_without_area_have_uvs():
    mesh = polygons(np.zeros((3, 4, 3)))
    (uvs,) = finished(pack_charts([mesh], [flat_charts(mesh)], 64))
    assert uvs.shape == (12, 2) and np.isfinite(uvs).all()


def test_meshes_that_do_not_fit_one_square_go_to_several():
    meshes = [rectangles(np.full((9, 2), 0.5 + index)) for index in range(11)]
    charts = [flat_charts(mesh) for mesh in meshes]
    squares = [PackJob((0, 1), 256), PackJob(tuple(range(2, 11)), 24)]
    unwrapped = finished(unwrap(meshes, charts, squares))
    first, *rest = unwrapped.squares
    assert (first.square, first.meshes) == (0, (0, 1))
    assert len(rest) > 1 and all(filled.square == 1 for filled in rest)
    assert sorted(index for filled in rest for index in filled.meshes) == list(range(2, 11))


def test_torn_polygon_is_laid_flat_without_folding():
    points = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0.9, 0.05, 0.8)]], np.float64)
    triangles = np.array([[(0, 1, 2), (0, 2, 3)]])
    (flat,) = flatten(points, triangles)
    covered = signed_areas(flat[triangles[0]])
    assert (covered > 0).all()
    assert covered.sum() == pytest.approx(areas(points[0][triangles[0]]).sum())


def test_torn_polygons_of_all_sizes_are_numbered_without_gaps_and_keep_their_area():
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    mesh = polygons(square + np.arange(4001)[:, None, None] * (2.0, 0, 0))
    began = time.process_time()
    nothing = np.zeros((len(mesh.triangles), 3, 2)), np.full(len(mesh.triangles), -1)
    made = make_charts(mesh, *nothing)
    assert time.process_time() - began < 1
    assert (made.chart == np.repeat(np.arange(4001), 2)).all()
    assert np.abs(signed_areas(made.uvs[mesh.triangles])) == pytest.approx(0.5)


def test_polygon_of_two_charts_is_torn():
    mesh = polygons([[(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]])
    made = make_charts(mesh, mesh.positions[mesh.triangles][..., :2], np.array([0, 1]))
    assert made.chart[0] == made.chart[1]


def test_doubled_polygons_have_charts_of_their_own():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    mesh = polygons([square, square[::-1]])
    made = make_charts(mesh, mesh.positions[mesh.triangles][..., :2], np.zeros(4, np.int64))
    assert (made.chart == [0, 0, 1, 1]).all()


def grid(columns, rows, height=lambda x, y: 0 * x):
    """Return a grid of unit quads over a height field."""
    x, y = (axis.reshape(-1) for axis in np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0)))
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    quads = np.stack([first, first + 1, first + columns + 2, first + columns + 1], axis=1)
    return of_quads(np.stack([x, y, height(x, y)], axis=1), quads)


def of_quads(positions, quads):
    loops = np.arange(0, 4 * len(quads), 4)[:, None]
    return PolygonMesh(
        name="Quads",
        positions=np.asarray(positions, np.float64),
        corners=np.asarray(quads).reshape(-1),
        starts=np.arange(0, 4 * len(quads) + 1, 4),
        triangles=(loops[:, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3),
        polygon=np.repeat(np.arange(len(quads)), 2),
    )


def split(mesh):
    """Return the same mesh with vertices of their own for each polygon."""
    return of_quads(mesh.positions[mesh.corners], np.arange(len(mesh.corners)).reshape(-1, 4))


@pytest.mark.parametrize("make", [lambda mesh: mesh, split])
def test_coplanar_neighbours_are_one_chart_and_creases_are_cut(make):
    """A sheet that is folded twice: three planes, of which two touch at a right angle, one at 60 degrees."""
    mesh = make(grid(9, 5, lambda x, y: np.maximum(x - 3, 0) * (x <= 5) + 2 * (x > 5) + 7 * (x > 7)))
    planar = project_flat(mesh)
    assert planar.chart.min() == 0
    uvs, space = planar.uvs, areas(mesh.positions[mesh.corners[mesh.triangles]])
    assert signed_areas(uvs) == pytest.approx(space)
    normals = np.round(polygon_normals(mesh), 6)
    assert len(np.unique(np.c_[normals, planar.chart[::2]], axis=0)) == planar.chart.max() + 1


def test_gently_bent_surface_is_projected_and_a_round_one_is_left_to_xatlas():
    assert (project_flat(grid(8, 3, lambda x, y: 0.02 * np.sin(x))).chart == 0).all()
    assert (project_flat(lattice(12, 3, tube)).chart == -1).all()


def lattice(columns, rows, surface):
    """Return a grid of quads, a function of two parameters in 0-1 each."""
    mesh = grid(columns, rows)
    u, v = mesh.positions[:, 0] / columns, mesh.positions[:, 1] / rows
    return of_quads(np.stack(surface(u, v), axis=1), mesh.corners.reshape(-1, 4))


def sphere(u, v):
    a, b = 2 * np.pi * u, np.pi * (0.01 + 0.98 * v)
    return np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), -np.cos(b)


def tube(u, v):
    return np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), 5 * v


@pytest.mark.parametrize(("surface", "most"), [(sphere, 10), (tube, 8)])
def test_large_round_surface_is_projected_in_few_directions(surface, most):
    mesh = lattice(83, 61, surface)
    began = time.process_time()
    planar = project_flat(mesh)
    assert time.process_time() - began < 5
    assert planar.chart.min() == 0 and planar.chart.max() < most
    assert not doubly_covered(planar.uvs, planar.chart, planar.chart.max() + 1).any()
    ratio = signed_areas(planar.uvs) / areas(mesh.positions[mesh.corners[mesh.triangles]])
    assert ratio.min() > 0.35 and ratio.max() < 1.5


def test_large_rough_field_is_one_chart():
    height = np.random.default_rng(2).normal(size=73 * 62) * 0.15
    planar = project_flat(grid(72, 61, lambda x, y: 3 * np.sin(x / 7) * np.cos(y / 9) + height))
    assert planar.chart.min() == 0 and planar.chart.max() < 6


def test_flat_surface_that_lies_on_itself_is_left_to_xatlas():
    """A strip of quads that turns once and a half around a point, in one plane."""
    angle = np.linspace(0, 3 * np.pi, 37)
    rim = np.stack([np.cos(angle), np.sin(angle), 1e-4 * angle], axis=1)
    first = np.arange(36)
    mesh = of_quads(
        np.r_[rim * (0.5, 0.5, 1), rim], np.stack([first, first + 37, first + 38, first + 1], axis=1)
    )
    assert (project_flat(mesh).chart == -1).all()


@pytest.mark.parametrize("seed", range(3))
def test_both_sides_of_a_sheet_are_one_chart_each_in_any_order(seed):
    sheet = grid(7, 4)
    quads = sheet.corners.reshape(-1, 4)
    both = np.random.default_rng(seed).permutation(np.r_[quads, quads[:, ::-1], quads])
    mesh = of_quads(sheet.positions, both)
    planar = project_flat(mesh)
    assert set(planar.chart) == {0, 1, 2}
    assert np.bincount(planar.chart).tolist() == [56, 56, 56]


@needs_xatlas
def test_both_sides_of_a_curved_sheet_have_few_charts():
    sheet = grid(12, 5, lambda x, y: np.cos(x))
    quads = sheet.corners.reshape(-1, 4)
    mesh = of_quads(sheet.positions, np.r_[quads, quads[:, ::-1]])
    ((uvs, chart),) = finished(segmentation.segment([mesh]))
    made = make_charts(mesh, uvs, chart)
    assert made.chart.min() == 0 and made.chart.max() < 12


@needs_xatlas
def test_atlases_are_destroyed_once_their_threads_have_waited(monkeypatch):
    monkeypatch.setattr(segmentation, "_SETTLED", 0.05)
    monkeypatch.setattr(segmentation, "_used", deque())
    ball, atlases = lattice(16, 16, sphere), []
    for _ in range(3):
        finished(segmentation.segment([ball]))
        atlases.append(weakref.ref(segmentation._used[-1][1]))
        time.sleep(0.1)
    assert [atlas() is None for atlas in atlases] == [True, True, False]


def test_polygons_without_area_need_no_chart():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    mesh = polygons([square, [(2, 2, 2)] * 4, [(0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 0, 0)], square])
    made = make_charts(mesh, np.zeros((8, 3, 2)), np.full(8, -1))
    assert made.chart.tolist() == [0, 0, -1, -1, -1, -1, 1, 1]
    (uvs,) = finished(pack_charts([mesh], [made], 61))
    assert np.isfinite(uvs).all() and np.abs(signed_areas(uvs[mesh.triangles])).sum() > 0.4


def test_triangles_that_reading_drops_need_no_chart():
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * 0.001
    mesh = polygons(square + np.arange(3)[:, None, None])
    mesh = dataclasses.replace(mesh, degenerate=np.array([1, 4, 5]))
    made = make_charts(mesh, np.zeros((6, 3, 2)), np.full(6, -1))
    assert made.chart.tolist() == [0, 0, 1, 1, -1, -1]


def test_polyomino_lies_along_the_axes_with_its_borders_between_texels():
    """An L whose convex hull has a smaller box when it is turned."""
    quads = grid(6, 6)
    middle = quads.positions[quads.corners].reshape(-1, 4, 3).mean(axis=1)
    members = (middle[:, 0] < 2) | (middle[:, 1] < 2)
    mesh = of_quads(quads.positions @ _turn(0.3), quads.corners.reshape(-1, 4)[members])
    planar = project_flat(mesh)
    (uvs,) = finished(pack_charts([mesh], [make_charts(mesh, planar.uvs, planar.chart)], 76))
    texels = uvs.astype(np.float64) * 76
    edges = np.abs(texels[mesh.after] - texels)
    assert np.minimum(edges[:, 0], edges[:, 1]).max() < 1e-3
    low, high = texels.min(axis=0), texels.max(axis=0)
    assert np.r_[low, high] == pytest.approx(np.round(np.r_[low, high]), abs=1e-3)


def _turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)])


def test_frame_and_corridor_are_cut_so_that_the_page_is_used():
    """A thin frame of 40 m around nothing, and a corridor of 90 m: in one piece each, most stays free."""
    quads = grid(40, 40)
    middle = quads.positions[quads.corners].reshape(-1, 4, 3).mean(axis=1)[:, :2]
    frame = of_quads(quads.positions, quads.corners.reshape(-1, 4)[(np.abs(middle - 20) > 19).any(axis=1)])
    meshes = [frame, grid(90, 2)]
    charts = [make_charts(mesh, *segments_of(mesh)) for mesh in meshes]
    packed = finished(pack_charts(meshes, charts, 256))
    corners = [uvs[mesh.triangles].astype(np.float64) for mesh, uvs in zip(meshes, packed, strict=True)]
    assert np.abs(signed_areas(np.concatenate(corners))).sum() > 0.6


def segments_of(mesh):
    planar = project_flat(mesh)
    return planar.uvs, planar.chart


@pytest.mark.parametrize("padding", [0, 1, 5])
def test_padding_is_kept(padding):
    mesh = pieces(60, 8)
    charts = flat_charts(mesh)
    (uvs,) = finished(pack_charts([mesh], [charts], 199, padding))
    assert padding <= least_gap(touched(mesh, charts, uvs, 199)) <= padding + 1


@needs_xatlas
@pytest.mark.parametrize("resolution", [512, 1024])
def test_levels_fill_their_page(resolution):
    mesh = level(4000, seed=3)
    began = time.process_time()
    (square,) = finished(unwrap([mesh], [None], [PackJob((0,), resolution)])).squares
    assert time.process_time() - began < 20
    assert np.abs(signed_areas(square.uvs[0][mesh.triangles].astype(np.float64))).sum() > 0.6


@needs_xatlas
def test_worker_cuts_and_packs_what_xatlas_would_lay_on_an_immense_page():
    """Meshes of very different size, one of them long and thin, through the process that unwraps."""
    random = np.random.default_rng(6)
    corners = random.normal(size=(40, 3, 3))
    long_one = polygons([[(0, 0, 0), (1e7, 1, 1), (0, 1, 0)], [(0, 0, 0), (0, 1, 0), (0, 0, 1)]], 3)
    meshes = (polygons(corners, 3), polygons(1e-4 * corners, 3), long_one)
    squares = (PackJob((0,), 256), PackJob((1,), 131), PackJob((2,), 64))
    worker = lambda: Worker(bake="engine.unwrap.unwrapping:unwrap")  # noqa: E731
    unwrapped = finished(run_apart(worker, (meshes, (None,) * 3, squares), 60))
    for filled in unwrapped.squares[:2]:
        (index,), (uvs,) = filled.meshes, filled.uvs
        mesh = meshes[index]
        covered = np.abs(signed_areas(uvs[mesh.triangles].astype(np.float64)))
        space = areas(mesh.positions[mesh.corners[mesh.triangles]])
        assert covered == pytest.approx(space * covered.sum() / space.sum(), rel=0.25)
        assert least_gap(touched(mesh, unwrapped.charts[index], uvs, squares[index].resolution)) >= PADDING


def book(pages):
    """Return quads that all have one edge in common, like the pages of a book, one of them doubled."""
    angle = np.linspace(0, 2 * np.pi, pages, endpoint=False)
    rim = [(np.cos(a), np.sin(a), z) for a in angle for z in (0, 1.3)]
    quads = [(0, 2 * k + 2, 2 * k + 3, 1) for k in range(pages)]
    return of_quads([(0, 0, 0), (0, 0, 1.3), *rim], [*quads, quads[0][::-1]])


def soup(faces, seed):
    """Return quads of any corners of a few points: bent, folded, without area, on each other."""
    random = np.random.default_rng(seed)
    return of_quads(random.normal(size=(9, 3)), random.integers(0, 9, (faces, 4)))


@needs_xatlas
@pytest.mark.parametrize("seed", range(3))
def test_nasty_meshes_of_all_sizes_share_a_page(seed):
    sizes = (1e4, 1e-3, 1.0, 30.0, 1e-6)
    made = (book(7), soup(40, seed), grid(5, 3), lattice(13, 7, sphere), soup(11, seed + 9))
    meshes = [
        replace(mesh, positions=mesh.positions * size + 100 * seed)
        for mesh, size in zip(made, np.roll(sizes, seed), strict=True)
    ]
    resolution = (509, 512, 777)[seed]
    unwrapped = finished(unwrap(meshes, [None] * 5, [PackJob(tuple(range(5)), resolution)]))
    (square,) = unwrapped.squares
    owner = np.full((resolution, resolution), -1)
    first = 0
    for mesh, charts, uvs in zip(meshes, unwrapped.charts, square.uvs, strict=True):
        assert np.isfinite(uvs).all() and uvs.min() >= 0 and uvs.max() <= 1
        space = areas(mesh.positions[mesh.corners[mesh.triangles]])
        used = charts.chart >= 0
        assert space[~used].sum() <= 1e-6 * space.sum()
        corners = uvs[mesh.triangles[used]].astype(np.float64) * resolution
        number = np.unique(charts.chart[used], return_inverse=True)[1].reshape(-1)
        box = np.full((number.max() + 1, 2), resolution)
        for chart, row, start, end in zip(*row_spans(corners, number, box), strict=True):
            texels = owner[row, start:end]
            assert ((texels == -1) | (texels == first + chart)).all()
            texels[:] = first + chart
        first += number.max() + 1


@needs_xatlas
def test_large_mesh_is_cut_in_pieces_and_stays_whole_otherwise(monkeypatch):
    """A tube of quads, in several pieces: polygons are in one piece each, charts numbered through."""
    monkeypatch.setattr(segmentation, "_PIECE", 300)
    monkeypatch.setattr(segmentation, "_BATCH", 1)
    mesh = lattice(46, 12, tube)
    steps = segmentation.segment([mesh])
    assert [next(steps) for _ in range(3)] == [0.0, 0.5, 0.625]
    ((uvs, chart),) = finished(segmentation.segment([mesh]))
    assert set(np.unique(chart)) - {-1} == set(range(chart.max() + 1)) and chart.max() >= 3
    assert (chart >= 0).mean() > 0.9
    known = chart >= 0
    space = areas(mesh.positions[mesh.corners[mesh.triangles[known]]])
    assert np.median(np.abs(signed_areas(uvs[known])) / space) == pytest.approx(1, rel=0.1)


@needs_xatlas
def test_pieces_of_a_large_mesh_hold_only_their_own_vertices(monkeypatch):
    """Else the time would grow with the square of the number of triangles."""
    monkeypatch.setattr(segmentation, "_PIECE", 300)
    cut, given = segmentation._segment_batch, []
    monkeypatch.setattr(
        segmentation, "_segment_batch", lambda pieces, cutting: given.extend(pieces) or cut(pieces, cutting)
    )
    mesh = lattice(46, 12, tube)
    finished(segmentation.segment([mesh]))
    assert len(given) > 3
    assert sum(len(piece.positions) for piece in given) < 2 * len(mesh.positions)


def _workers(work, made):
    def make():
        made.append(Worker(bake=f"worker_bakes:{work}"))
        return made[-1]

    return make


@pytest.fixture
def bakes(monkeypatch):
    monkeypatch.syspath_prepend(str(__import__("pathlib").Path(__file__).parent))


def test_process_that_hangs_is_killed_and_tried_once_more(bakes):
    made, began = [], time.monotonic()
    with pytest.raises(WorkerError, match="hung: no message for"):
        finished(run_apart(_workers("deaf", made), (None, None), 0.5))
    assert len(made) == 2 and time.monotonic() - began < 30
    assert not any(worker.alive for worker in made)


def test_process_that_dies_is_replaced_once(bakes):
    made = []
    with pytest.raises(WorkerError, match="exit status 3"):
        finished(run_apart(_workers("crash", made), (None, None), 60))
    assert len(made) == 2


def test_cancel_kills_in_the_middle_of_one_long_call(bakes):
    made = []
    work = run_apart(_workers("deaf", made), (np.zeros(1000), None), 60)
    while next(work) is None:
        pass
    process, began = made[0].process, time.monotonic()
    work.close()
    assert time.monotonic() - began < 1
    assert process.poll() is not None and len(made) == 1
