"""Runs unwrapping in a separate process, because xatlas may crash or run for a long time."""

from __future__ import annotations

import os
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any

from ....engine.errors import WorkerError
from ....engine.progress import Progress, map_progress
from ....engine.unwrap.chart_options import ChartOptions
from ....engine.unwrap.charts import make_charts
from ....engine.unwrap.polygon_mesh import MeshCharts, PolygonMesh
from ....engine.unwrap.segmentation import has_xatlas
from ....engine.unwrap.unwrapping import PackJob, Unwrapped
from ...worker_manager import new_worker
from . import blender_charts

#: Generators that the worker process runs: the whole of unwrapping, or only the cutting into charts by
#: xatlas.
_UNWRAP = "engine.unwrap.unwrapping:unwrap"
_CUT = "engine.unwrap.unwrapping:cut"

#: Time without a message after which the worker counts as hung: a base, and an addition for each triangle, s.
#: It is about ten times what the slowest measured meshes took.
_PATIENCE, _PATIENCE_PER_TRIANGLE = 60.0, 2e-3

#: Meshes with at least _MANY triangles in total are cut in several processes at once. _MOST_PROCESSES limits
#: their number, which does not depend on the cores, since charts depend on the meshes that are cut together.
#: _CUTTING is the fraction of the progress that cutting stands for.
_MANY, _MOST_PROCESSES, _CUTTING = 200_000, 4, 0.6

KnownCharts = tuple[MeshCharts | None, ...]


def unwrap_in_process(
    meshes: Sequence[PolygonMesh],
    charts: Sequence[MeshCharts | None],
    squares: Sequence[PackJob],
    cutting: ChartOptions,
) -> Generator[Progress | None, None, tuple[Unwrapped, list[int]]]:
    """Run `engine.unwrap.unwrapping.unwrap` in another process; closing the generator ends that process.

    Returns the result and the indices of meshes that xatlas cannot cut. Blender's Smart UV Project cuts
    those, or all meshes if xatlas is not installed. Raises WorkerError if the process dies or hangs even
    without xatlas.
    """
    known, failed = tuple(charts), list[int]()
    if not has_xatlas():
        known = yield from _charts_by_blender(meshes, known)
    try:
        try:
            cut = yield from _cut_side_by_side(meshes, known, cutting)
            work = _run(_UNWRAP, meshes, (cut, tuple(squares), cutting))
            return (yield from _after(0.0 if cut is known else _CUTTING, work)), []
        except WorkerError:
            if all(known):
                raise
        known, failed = yield from _cut_each(meshes, known, cutting)
        return (yield from _run(_UNWRAP, meshes, (known, tuple(squares)))), failed
    except WorkerError as error:
        raise WorkerError(f"Lightmap UVs could not be made. {error}") from error


def _run(
    work: str, meshes: Sequence[PolygonMesh], arguments: tuple[object, ...] = (), attempts: int = 2
) -> Generator[Progress | None, None, Any]:
    """Run a generator of the engine on meshes in a separate process, with a time-out by triangle count."""
    from ....engine.worker.disposable import run_apart
    from ....engine.worker.process import UNWRAPPING

    patience = _PATIENCE + _PATIENCE_PER_TRIANGLE * sum(len(mesh.triangles) for mesh in meshes)
    make_worker = lambda: new_worker(work, UNWRAPPING)  # noqa: E731
    return (yield from run_apart(make_worker, (tuple(meshes), *arguments), patience, attempts))


def _after(
    part: float, work: Generator[Progress | None, None, Unwrapped]
) -> Generator[Progress | None, None, Unwrapped]:
    """Run the second part of a task whose fraction `part` is done, and adapt its progress."""

    def scaled(progress: Progress | None) -> Progress | None:
        return progress and replace(progress, overall=part + (1 - part) * progress.overall)

    return map_progress(work, scaled)


def _cut_side_by_side(
    meshes: Sequence[PolygonMesh], charts: KnownCharts, cutting: ChartOptions
) -> Generator[Progress | None, None, KnownCharts]:
    """Return the charts of all meshes, cut in several processes; `charts` itself if triangles are few.

    At most one process for each core runs at once.

    Raises WorkerError if one of the processes dies or hangs.
    """
    groups = _groups(meshes, [index for index, made in enumerate(charts) if made is None])
    if len(groups) < 2:
        return charts
    known, done = list(charts), [0.0] * len(groups)
    with ExitStack() as stack:
        works = [
            stack.enter_context(closing(_run(_CUT, [meshes[index] for index in group], (cutting,))))
            for group in groups
        ]
        left, cores = list(range(len(groups))), os.cpu_count() or 1
        while left:
            changed = False
            for number in tuple(left[:cores]):
                try:
                    progress = next(works[number])
                except StopIteration as stop:
                    left.remove(number)
                    for index, made in zip(groups[number], stop.value, strict=True):
                        known[index] = made
                    progress = Progress("Unwrapping", 1.0)
                if progress is not None:
                    done[number], changed = progress.fraction, True
            part = sum(done) / len(done)
            yield Progress("Unwrapping", part, _CUTTING * part) if changed else None
    return tuple(known)


def _groups(meshes: Sequence[PolygonMesh], chosen: Sequence[int]) -> list[list[int]]:
    """Return the mesh indices for each process; greedy: the largest mesh goes to the least loaded process."""
    triangles = sum(len(meshes[index].triangles) for index in chosen)
    if triangles < _MANY:
        return []
    count = min(_MOST_PROCESSES, len(chosen))
    groups: list[list[int]] = [[] for _ in range(count)]
    loads = [0] * count
    for index in sorted(chosen, key=lambda index: -len(meshes[index].triangles)):
        least = loads.index(min(loads))
        groups[least].append(index)
        loads[least] += len(meshes[index].triangles)
    return groups


def _cut_each(
    meshes: Sequence[PolygonMesh], charts: KnownCharts, cutting: ChartOptions
) -> Generator[Progress | None, None, tuple[KnownCharts, list[int]]]:
    """Cut all meshes; return their charts, and the indices of meshes that make xatlas fail.

    Bisection: if a group of meshes makes the process die or hang, its halves are tried separately. A single
    mesh that fails is cut by Blender. Raises WorkerError if the process cannot even be started.
    """
    yield from _run(_CUT, (), (cutting,))
    known, failed = list(charts), list[int]()
    groups = [[index for index, made in enumerate(charts) if made is None]]
    while groups:
        group = groups.pop()
        try:
            made = yield from _run(_CUT, [meshes[index] for index in group], (cutting,), attempts=1)
        except WorkerError:
            half = len(group) // 2
            if half:
                groups += [group[half:], group[:half]]
                continue
            failed += group
            made = [make_charts(meshes[group[0]], *blender_charts.segment(meshes[group[0]]))]
        for index, one in zip(group, made, strict=True):
            known[index] = one
    return tuple(known), failed


def _charts_by_blender(
    meshes: Sequence[PolygonMesh], charts: KnownCharts
) -> Generator[Progress | None, None, KnownCharts]:
    """Return the charts of all meshes, with unknown ones cut by Blender's Smart UV Project."""
    complete = []
    for number, (mesh, known) in enumerate(zip(meshes, charts, strict=True)):
        yield Progress("Unwrapping", number / len(meshes))
        complete.append(known or make_charts(mesh, *blender_charts.segment(mesh)))
    return tuple(complete)
