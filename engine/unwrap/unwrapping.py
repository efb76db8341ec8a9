"""Lightmap UVs for meshes, from arrays to arrays: the work of the process that unwraps."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ..progress import Progress, Schedule, Stage
from .charts import make_charts
from .packing import pack_charts
from .polygon_mesh import Charts, PolygonMesh
from .segmentation import segment

#: Seconds that a triangle takes to be in a chart, and a chart to be packed, before any was measured.
_CUTTING, _PACKING = 2e-4, 1e-3


@dataclass(frozen=True)
class Square:
    """Meshes whose charts lie side by side.

    meshes      their numbers
    resolution  texels of an image across the square
    """

    meshes: tuple[int, ...]
    resolution: int


@dataclass(frozen=True)
class FilledSquare:
    """A square, or one of those that its meshes were spread over because they did not fit.

    square  number of the one that was asked for
    meshes  their numbers
    uvs     of the loops of each mesh, (l, 2) float32
    """

    square: int
    meshes: tuple[int, ...]
    uvs: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Unwrapped:
    """The charts of each mesh, and where they lie; a mesh without a square has too many charts for one."""

    charts: tuple[Charts, ...]
    squares: tuple[FilledSquare, ...]


def unwrap(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts | None], squares: Sequence[Square]
) -> Generator[Progress, None, Unwrapped]:
    """Cut meshes into charts, those without, and fill squares with them.

    meshes   with finite coordinates
    charts   of each mesh where they are known, else None
    """
    missing = [mesh for mesh, made in zip(meshes, charts, strict=True) if made is None]
    triangles = sum(len(mesh.triangles) for mesh in missing)
    cutting = Stage("Unwrapping", pace=_CUTTING * triangles)
    packing = Stage("Unwrapping", pace=_PACKING * len(meshes))
    schedule = Schedule([cutting, packing])
    fresh = iter((yield from schedule.run(cutting, _cut(missing))))
    complete = tuple(made or next(fresh) for made in charts)
    packing.pace = _PACKING * sum(int(made.chart.max(initial=-1)) + 1 for made in complete)
    filled = yield from schedule.run(packing, _fill_all(meshes, complete, squares))
    return Unwrapped(complete, tuple(filled))


def _cut(meshes: Sequence[PolygonMesh]) -> Generator[float, None, list[Charts]]:
    """Return the charts of meshes."""
    segments = yield from segment(meshes)
    return [make_charts(mesh, *parts) for mesh, parts in zip(meshes, segments, strict=True)]


def _fill_all(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], squares: Sequence[Square]
) -> Generator[float, None, list[FilledSquare]]:
    """Fill all squares."""
    filled: list[FilledSquare] = []
    for number, square in enumerate(squares):
        work = _fill(meshes, charts, square, number)
        while True:
            try:
                part = next(work)
            except StopIteration as stop:
                filled += stop.value
                break
            yield (number + part) / len(squares)
    return filled


def _fill(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], square: Square, number: int
) -> Generator[float, None, list[FilledSquare]]:
    """Fill a square, or several if one has no room for all."""
    chosen = square.meshes
    packed = yield from pack_charts(
        [meshes[index] for index in chosen], [charts[index] for index in chosen], square.resolution
    )
    if packed is not None:
        return [FilledSquare(number, chosen, tuple(packed))]
    if len(chosen) == 1:
        return []
    ordered = sorted(chosen, key=lambda index: -meshes[index].area)
    half = len(ordered) // 2
    filled = []
    for part in (ordered[:half], ordered[half:]):
        filled += yield from _fill(meshes, charts, Square(tuple(part), square.resolution), number)
    return filled
