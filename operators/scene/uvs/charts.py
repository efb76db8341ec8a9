"""Lightmap UVs for polygon meshes: charts and packing by xatlas, or by Blender where there is no xatlas.

xatlas works on triangles and may cut a polygon along its diagonals, where Blender can store only
one UV per polygon corner. So charts are made first, polygons that came out torn become charts of
their own, and then the charts, in world size, are packed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import blender_charts
from .polygon_mesh import Charts, PolygonMesh, areas, signed_areas
from .resting_atlases import RestingAtlases

#: Least distance of two charts, texels.
PADDING = 4

#: Attempts to find the scale at which all charts fit on one page.
_ATTEMPTS = 24

#: Mean area of a chart, texels, below which its light could not be stored.
_LEAST_CHART = 0.01

#: Corners are the same if they agree to this many parts of the mesh's size.
_DOUBLED_STEPS = 1 << 18

#: Square root of the texels that charts are laid out on before they are packed, and longest chart there.
_DRAFT = 887
_LONGEST_DRAFT = 1 << 17

_UNPACKED = 0xFFFFFFFF


def has_xatlas() -> bool:
    """Return whether xatlas is there: no wheel of it fits every Python."""
    try:
        _xatlas()
    except ImportError:
        return False
    return True


def _xatlas():
    import xatlas

    return xatlas


_atlases = RestingAtlases(lambda: _xatlas().Atlas())


def destroy_atlases() -> None:
    """Free what xatlas holds for the charts that were made and packed."""
    _atlases.destroy()


def make_charts(mesh: PolygonMesh) -> Charts:
    """Return a mesh's charts such that every loop has one UV; coordinates have to be finite."""
    uvs, chart = _segment(mesh) if has_xatlas() else blender_charts.segment(mesh)
    torn = np.union1d(_torn_polygons(mesh, uvs, chart), _doubled_polygons(mesh))
    loop_uvs = np.zeros((len(mesh.corners), 2))
    loop_uvs[mesh.triangles.reshape(-1)] = uvs.reshape(-1, 2)

    # Triangles in the order of their polygons: those of each torn one follow each other.
    order = np.argsort(mesh.polygon, kind="stable")
    first, last = (np.searchsorted(mesh.polygon[order], torn, side) for side in ("left", "right"))
    unused = chart.max(initial=-1) + 1
    for number, (polygon, start, end) in enumerate(zip(torn, first, last, strict=True)):
        loops = slice(mesh.starts[polygon], mesh.starts[polygon + 1])
        triangles = order[start:end]
        local = mesh.triangles[triangles] - mesh.starts[polygon]
        loop_uvs[loops] = _flatten(mesh.positions[mesh.corners[loops]], local)
        chart[triangles] = unused + number
    return Charts(loop_uvs, chart)


def _segment(mesh: PolygonMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return xatlas' UV of each triangle corner, (t, 3, 2) metres, and chart, (t,), -1 for none."""
    vertices = mesh.corners[mesh.triangles]
    positions = mesh.positions - (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2
    scale = _unit_area_scale(positions[vertices])
    with _atlases.atlas() as atlas:
        atlas.add_mesh((positions * scale).astype(np.float32), vertices.astype(np.uint32))
        atlas.generate(pack_options=_drafting(positions[vertices] * scale))
        _, indices, uvs = atlas.get_mesh(0)
        _, charts = atlas.get_mesh_vertex_assignment(0)
        size = np.array([atlas.width, atlas.height]) / max(atlas.texels_per_unit, 1e-30) / scale
    chart = charts[indices].astype(np.int64)
    chart[chart == _UNPACKED] = -1
    return (uvs * size)[indices], chart.min(axis=1)


def _drafting(corners: np.ndarray):
    """Return options for a layout that only shows the charts, (t, 3, 3) corners of a mean area of 1.

    xatlas would choose a density by the area alone, and lay out a long thin mesh on an immense page.
    """
    options = _xatlas().PackOptions()
    longest = float(np.ptp(corners.reshape(-1, 3), axis=0).max(initial=0.0))
    options.texels_per_unit = min(_DRAFT / np.sqrt(len(corners)), _LONGEST_DRAFT / max(longest, 1e-30))
    return options


def _unit_area_scale(corners: np.ndarray) -> float:
    """Return the factor that gives triangles a mean area of 1: xatlas drops those below 1e-7."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    mean = area.mean() / 2
    return 1 / np.sqrt(mean) if mean > 0 else 1.0


def _torn_polygons(mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the polygons with a loop that has two UVs, or with a triangle that has none."""
    loops = mesh.triangles.reshape(-1)
    low = np.full((len(mesh.corners), 2), np.inf)
    high = -low
    np.minimum.at(low, loops, uvs.reshape(-1, 2))
    np.maximum.at(high, loops, uvs.reshape(-1, 2))
    bad = (low != high).any(axis=1)[mesh.triangles].any(axis=1) | (chart < 0)
    return np.unique(mesh.polygon[bad])


def _doubled_polygons(mesh: PolygonMesh) -> np.ndarray:
    """Return the polygons that lie on an earlier one with the same corners, in any order.

    Such a pair, as models have it to be seen from both sides, comes out of xatlas as one spot of a chart.
    """
    corners = mesh.positions[mesh.corners]
    size = np.ptp(mesh.positions, axis=0).max()
    steps = np.round((corners - mesh.positions.min(axis=0)) / max(size, 1e-30) * _DOUBLED_STEPS)
    starts = mesh.starts[:-1]
    keys = np.concatenate(
        [np.add.reduceat(steps, starts), np.add.reduceat(steps**2, starts), np.diff(mesh.starts)[:, None]],
        axis=1,
    )
    _, first = np.unique(keys, axis=0, return_index=True)
    return np.setdiff1d(np.arange(len(starts)), first)


def _flatten(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return a polygon's corners, (n, 3), in a plane, (n, 2), without overlap and with its area.

    The polygon is projected along its mean normal; one that folds over itself there is laid on a
    circle instead, where any triangulation of it stays flat.
    """
    centred = points - points.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    axis = np.linalg.svd(centred - np.outer(centred @ normal, normal) / max(normal @ normal, 1e-30))[2][0]
    length = np.linalg.norm(normal)
    other = np.cross(normal / length, axis) if length > 0 else np.zeros(3)
    flat = np.stack([centred @ axis, centred @ other], axis=1)
    if (signed_areas(flat[triangles]) < 0).any():
        flat = _on_circle(points)
    area = areas(points[triangles]).sum()
    return flat * np.sqrt(area / max(np.abs(signed_areas(flat[triangles])).sum(), 1e-30))


def _on_circle(points: np.ndarray) -> np.ndarray:
    """Return points on the unit circle, (n, 2), with arcs in proportion to the polygon's edges."""
    edges = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    angle = 2 * np.pi * np.r_[0, np.cumsum(edges)[:-1]] / max(edges.sum(), 1e-30)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def pack_charts(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], resolution: int
) -> list[np.ndarray] | None:
    """Return UVs of each mesh's loops, (l, 2) float32, all charts packed into one unit square.

    Charts are in proportion to world area, do not overlap and keep PADDING texels of a
    `resolution` x `resolution` image between them. None if they do not fit; the density is the largest
    one found at which they do.
    """
    area = sum(np.abs(signed_areas(c.uvs[m.triangles])).sum() for m, c in zip(meshes, charts, strict=True))
    if area == 0:
        return [np.zeros((len(mesh.corners), 2), np.float32) for mesh in meshes]
    low, high, best = 0.0, np.inf, None
    scale = min(resolution * np.sqrt(0.7 / area), np.sqrt(2) * resolution / _longest_chart(meshes, charts))
    least = np.sqrt(_LEAST_CHART * sum(len(np.unique(c.chart)) for c in charts) / area)
    if not has_xatlas():
        return _pack_by_blender(meshes, charts, resolution, least * np.sqrt(area))
    for _ in range(_ATTEMPTS):
        if scale < least:
            break
        packed, size = _pack_at(meshes, charts, scale)
        if size <= resolution - 1:
            low, best = scale, packed
            guess = scale * (resolution - 1) / size
        else:
            high = scale
            guess = scale * min(0.97, (resolution - 1) / size)
        if high < 1.02 * low or (best is not None and size in (resolution - 1, resolution - 2)):
            break
        scale = guess if low < guess < high else (low + high) / 2
    if best is None:
        return None
    return [(uvs / resolution).astype(np.float32) for uvs in best]


def _pack_by_blender(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], resolution: int, least: float
) -> list[np.ndarray] | None:
    """Return UVs as `pack_charts` does; None if all charts together get less than `least` texels squared."""
    packed = blender_charts.pack(meshes, charts, resolution, PADDING)
    if packed is None:
        return None
    area = sum(
        np.abs(signed_areas(uvs[mesh.triangles])).sum() for mesh, uvs in zip(meshes, packed, strict=True)
    )
    if not np.sqrt(area) * resolution >= least:
        return None
    return [uvs.astype(np.float32) for uvs in packed]


def _longest_chart(meshes: Sequence[PolygonMesh], charts: Sequence[Charts]) -> float:
    """Return the greatest width or height of a chart, metres."""
    longest = 0.0
    for mesh, chart in zip(meshes, charts, strict=True):
        _, number = np.unique(chart.chart, return_inverse=True)
        corners = chart.uvs[mesh.triangles]
        low, high = np.full((2, number.max(initial=-1) + 1, 2), np.inf)
        np.minimum.at(low, number, corners.min(axis=1))
        np.minimum.at(high, number, -corners.max(axis=1))
        longest = max(longest, float((-high - low).max(initial=0.0)))
    return longest


def _pack_at(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], scale: float
) -> tuple[list[np.ndarray], int]:
    """Return where the loops are packed, in texels at `scale` texels per metre, and the page size they need.

    xatlas takes meshes at the same address for instances, so all inputs have to live until it is done.
    It keeps 2 * padding + 1 texels between charts, and puts chart borders on texel centres; half a
    texel further on they lie between texels.
    """
    options = _xatlas().PackOptions()
    options.padding, options.texels_per_unit = PADDING // 2, 1.0
    options.bruteForce = sum(chart.chart.max(initial=-1) + 1 for chart in charts) < 64
    inputs = [_uv_mesh(mesh, chart, scale) for mesh, chart in zip(meshes, charts, strict=True)]
    with _atlases.atlas() as atlas:
        for arrays in inputs:
            atlas.add_uv_mesh(*arrays)
        atlas.generate(pack_options=options)
        size = np.array([atlas.width, atlas.height])
        texels = [
            _packed_loops(atlas, index, mesh, chart, size)
            for index, (mesh, chart) in enumerate(zip(meshes, charts, strict=True))
        ]
    return texels, int(size.max())


def _uv_mesh(mesh: PolygonMesh, charts: Charts, scale: float) -> tuple[np.ndarray, ...]:
    """Return texel coordinates of the loops, loops of the triangles and charts, as xatlas wants them."""
    uvs = (charts.uvs * scale).astype(np.float32)
    return uvs, mesh.triangles.astype(np.uint32), charts.chart[:, None].astype(np.uint32)


def _packed_loops(atlas, index: int, mesh: PolygonMesh, charts: Charts, size: np.ndarray) -> np.ndarray:
    """Return where one mesh's loops have been packed, (l, 2) texels."""
    loops, _, uvs = atlas.get_mesh(index)
    page, _ = atlas.get_mesh_vertex_assignment(index)
    packed = page != _UNPACKED
    texels = np.full((len(mesh.corners), 2), np.nan)
    texels[loops[packed]] = uvs[packed] * size + 0.5
    lost = np.isnan(texels[mesh.triangles]).any(axis=(1, 2))
    for chart in np.unique(charts.chart[lost]):
        _move_lost(texels, charts.uvs, np.unique(mesh.triangles[charts.chart == chart]))
    return np.nan_to_num(texels, nan=0.5)


def _move_lost(texels: np.ndarray, uvs: np.ndarray, loops: np.ndarray) -> None:
    """Move loops of triangles too small for xatlas as the rest of their chart has been moved."""
    known = loops[~np.isnan(texels[loops, 0])]
    lost = loops[np.isnan(texels[loops, 0])]
    if len(known) < 3:
        return
    frame = np.c_[uvs[known], np.ones(len(known))]
    affine = np.linalg.lstsq(frame, texels[known], rcond=None)[0]
    texels[lost] = np.c_[uvs[lost], np.ones(len(lost))] @ affine
