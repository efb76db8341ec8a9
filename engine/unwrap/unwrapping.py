"""Unwrapping of meshes to lightmap UVs; runs in a separate process, on arrays only."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..progress import Progress, Schedule, Stage, run_as_fraction
from .chart_options import USUAL, ChartOptions
from .charts import make_charts
from .packing import PADDING, pack_charts
from .polygon_mesh import MeshCharts, PolygonMesh, signed_areas
from .segmentation import segment

#: Estimated seconds per triangle for segmentation and per chart for packing, before any measurement.
_CUTTING, _PACKING = 2e-4, 1e-3

#: Maximum lightmap resolution.
_LARGEST = 16384


@dataclass(frozen=True)
class PackJob:
    """Meshes whose charts share one atlas square.

    meshes:      indices of the meshes
    resolution:  texels of an image across the square
    padding:     minimum distance between charts, texels
    align:       True to align axis-parallel chart borders to texel boundaries
    pages:       number of squares to spread the meshes over, as densely as all fit
    density:     minimum density, texels per metre, reached by adding squares; 0 for any
    """

    meshes: tuple[int, ...]
    resolution: int
    padding: int = PADDING
    pages: int = 1
    density: float = 0.0
    align: bool = True


@dataclass(frozen=True)
class PackResult:
    """Atlas square with packed charts; a job may need several.

    square:  index of the job
    meshes:  indices of the meshes
    uvs:     UVs of the loops of each mesh, (l, 2) float32
    """

    square: int
    meshes: tuple[int, ...]
    uvs: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Unwrapped:
    """Charts of each mesh, and filled squares.

    too_small:  for each mesh with too many charts for its square: its index, and the resolution that would
                suffice, or 0 if even the largest would not
    """

    charts: tuple[MeshCharts, ...]
    squares: tuple[PackResult, ...]
    too_small: tuple[tuple[int, int], ...] = ()


def unwrap(
    meshes: Sequence[PolygonMesh],
    charts: Sequence[MeshCharts | None],
    squares: Sequence[PackJob],
    cutting: ChartOptions = USUAL,
) -> Generator[Progress, None, Unwrapped]:
    """Segment meshes without charts, and pack all squares; yield progress.

    meshes:  meshes with finite coordinates
    charts:  charts of each mesh if known, else None
    """
    missing = [mesh for mesh, made in zip(meshes, charts, strict=True) if made is None]
    triangles = sum(len(mesh.triangles) for mesh in missing)
    cut_stage = Stage("Unwrapping", pace=_CUTTING * triangles)
    packing = Stage("Unwrapping", pace=_PACKING * len(meshes))
    schedule = Schedule([cut_stage, packing])
    fresh = iter((yield from schedule.run(cut_stage, _cut(missing, cutting))))
    complete = tuple(made or next(fresh) for made in charts)
    packing.pace = _PACKING * sum(int(made.chart.max(initial=-1)) + 1 for made in complete)
    filled = yield from schedule.run(packing, _fill_all(meshes, complete, squares))
    placed = {index for square in filled for index in square.meshes}
    too_small = []
    for square in squares:
        for index in square.meshes:
            if index not in placed:
                search = fitting_resolution(meshes[index], complete[index], square)
                too_small.append((index, (yield from _searched(schedule, search))))
    return Unwrapped(complete, tuple(filled), tuple(too_small))


def _searched(schedule: Schedule, search: Generator[float, None, int]) -> Generator[Progress, None, int]:
    """Run the search for a resolution that fits, the last work; yield progress, return its result."""
    while True:
        try:
            next(search)
        except StopIteration as stop:
            found: int = stop.value
            return found
        if schedule.due:
            yield schedule.progress(1.0)


def fitting_resolution(mesh: PolygonMesh, charts: MeshCharts, square: PackJob) -> Generator[float, None, int]:
    """Return the smallest of doubled resolutions at which a mesh fits its square; 0 if none does."""
    resolution = square.resolution
    while 2 * resolution <= _LARGEST:
        resolution *= 2
        packed = yield from pack_charts([mesh], [charts], resolution, square.padding, square.align)
        if packed is not None:
            return resolution
    return 0


def cut(
    meshes: Sequence[PolygonMesh], cutting: ChartOptions = USUAL
) -> Generator[Progress, None, tuple[MeshCharts, ...]]:
    """Segment meshes into charts, without packing; yield progress."""
    stage = Stage("Unwrapping", pace=_CUTTING * sum(len(mesh.triangles) for mesh in meshes))
    return tuple((yield from Schedule([stage]).run(stage, _cut(meshes, cutting))))


def _cut(meshes: Sequence[PolygonMesh], cutting: ChartOptions) -> Generator[float, None, list[MeshCharts]]:
    """Return the charts of meshes; yield progress 0..1."""
    segments = deque((yield from segment(meshes, cutting)))
    charts = []
    for mesh in meshes:
        charts.append(make_charts(mesh, *segments.popleft()))
        yield 1.0
    return charts


def _fill_all(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts], squares: Sequence[PackJob]
) -> Generator[float, None, list[PackResult]]:
    """Pack all squares; yield progress 0..1."""
    filled: list[PackResult] = []
    for number, square in enumerate(squares):
        work = _fill(meshes, charts, square, number)
        filled += yield from run_as_fraction(number / len(squares), (number + 1) / len(squares), work)
    return filled


def _fill(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts], square: PackJob, number: int
) -> Generator[float, None, list[PackResult]]:
    """Pack one job into the requested number of squares; add squares if the charts need more space."""
    pages = min(max(square.pages, 1), len(square.meshes))
    while True:
        filled: list[PackResult] = []
        for members in _spread(meshes, square.meshes, pages):
            filled += yield from _fill_one(meshes, charts, replace(square, meshes=members), number)
        sparse = [_density(meshes, page, square.resolution) < square.density for page in filled]
        if not any(sparse) or pages == len(square.meshes):
            return filled
        pages += 1


def _spread(meshes: Sequence[PolygonMesh], chosen: Sequence[int], pages: int) -> list[tuple[int, ...]]:
    """Distribute meshes over pages: largest first, each to the page with the least area."""
    areas = {index: meshes[index].area for index in chosen}
    groups: list[list[int]] = [[] for _ in range(pages)]
    total = [0.0] * pages
    for index in sorted(chosen, key=lambda index: -areas[index]):
        least = total.index(min(total))
        groups[least].append(index)
        total[least] += areas[index]
    return [tuple(sorted(group)) for group in groups if group]


def _density(meshes: Sequence[PolygonMesh], page: PackResult, resolution: int) -> float:
    """Return the texels per metre of a filled square."""
    flat = space = 0.0
    for index, uvs in zip(page.meshes, page.uvs, strict=True):
        flat += float(np.abs(signed_areas(uvs[meshes[index].triangles].astype(np.float64))).sum())
        space += meshes[index].area
    return resolution * float(np.sqrt(flat / space)) if space > 0 else np.inf


def _fill_one(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts], square: PackJob, number: int
) -> Generator[float, None, list[PackResult]]:
    """Pack the charts of one job into a square atlas, or into several if one is too small."""
    chosen = square.meshes
    packed = yield from pack_charts(
        [meshes[index] for index in chosen],
        [charts[index] for index in chosen],
        square.resolution,
        square.padding,
        square.align,
    )
    if packed is not None:
        return [PackResult(number, chosen, tuple(packed))]
    if len(chosen) == 1:
        return []
    filled = []
    for part in _spread(meshes, chosen, 2):
        filled += yield from _fill_one(meshes, charts, replace(square, meshes=part), number)
    return filled
