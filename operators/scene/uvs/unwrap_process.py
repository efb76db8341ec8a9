"""Unwrapping in a process of its own, which xatlas may bring down or keep busy for long."""

from __future__ import annotations

import os
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace

from ....engine.errors import WorkerError
from ....engine.progress import Progress, map_progress
from ....engine.unwrap.chart_options import ChartOptions
from ....engine.unwrap.charts import make_charts
from ....engine.unwrap.polygon_mesh import MeshCharts, PolygonMesh
from ....engine.unwrap.segmentation import has_xatlas
from ....engine.unwrap.unwrapping import PackJob, Unwrapped
from ...worker_manager import new_worker
from . import blender_charts

#: The generators that the process runs: all of the work, or only the part that xatlas does.
_UNWRAP = "engine.unwrap.unwrapping:unwrap"
_CUT = "engine.unwrap.unwrapping:cut"

#: How long xatlas may be silent: about ten times what it takes for meshes as slow as any measured, s.
_PATIENCE, _PATIENCE_PER_TRIANGLE = 60.0, 2e-3

#: Triangles from which on meshes are cut in several processes at once, how many these are at most, and what
#: part of all work that is.
_MANY, _MOST_PROCESSES, _CUTTING = 200_000, 4, 0.6

KnownCharts = tuple[MeshCharts | None, ...]


def unwrap_in_process(
    meshes: Sequence[PolygonMesh],
    charts: Sequence[MeshCharts | None],
    squares: Sequence[PackJob],
    cutting: ChartOptions,
) -> Generator[Progress | None, None, tuple[Unwrapped, list[int]]]:
    """Do the work of `engine.unwrap.unwrapping.unwrap` in another process; closing kills that.

    Returns what that does, and the meshes, by number, that xatlas cannot cut: Blender makes their charts, as
    it does for all where there is no xatlas. Raises WorkerError if the process dies or hangs without xatlas,
    too.
    """
    known, failed = tuple(charts), []
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
) -> Generator:
    """Do some work on meshes in a process of its own."""
    from ....engine.worker.disposable import run_apart
    from ....engine.worker.process import UNWRAPPING

    patience = _PATIENCE + _PATIENCE_PER_TRIANGLE * sum(len(mesh.triangles) for mesh in meshes)
    make_worker = lambda: new_worker(work, UNWRAPPING)  # noqa: E731
    return (yield from run_apart(make_worker, (tuple(meshes), *arguments), patience, attempts))


def _after(
    part: float, work: Generator[Progress | None, None, Unwrapped]
) -> Generator[Progress | None, None, Unwrapped]:
    """Do work of which some part is done already."""

    def told(progress: Progress | None) -> Progress | None:
        return progress and replace(progress, overall=part + (1 - part) * progress.overall)

    return map_progress(work, told)


def _cut_side_by_side(
    meshes: Sequence[PolygonMesh], charts: KnownCharts, cutting: ChartOptions
) -> Generator[Progress | None, None, KnownCharts]:
    """Return the charts of all meshes, cut in a process for each core; of few triangles those known before.

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
        left = list(range(len(groups)))
        while left:
            told = False
            for number in tuple(left):
                try:
                    progress = next(works[number])
                except StopIteration as stop:
                    left.remove(number)
                    for index, made in zip(groups[number], stop.value, strict=True):
                        known[index] = made
                    progress = Progress("Unwrapping", 1.0)
                if progress is not None:
                    done[number], told = progress.fraction, True
            part = sum(done) / len(done)
            yield Progress("Unwrapping", part, _CUTTING * part) if told else None
    return tuple(known)


def _groups(meshes: Sequence[PolygonMesh], chosen: Sequence[int]) -> list[list[int]]:
    """Return which meshes each process cuts: the largest first, each to the one with the fewest triangles."""
    triangles = sum(len(meshes[index].triangles) for index in chosen)
    if triangles < _MANY:
        return []
    count = min(os.cpu_count() or 1, _MOST_PROCESSES, len(chosen))
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
    """Return the charts of all meshes, and those that xatlas cannot cut: it is tried on ever smaller halves.

    Raises WorkerError if the process cannot even be started.
    """
    yield from _run(_CUT, (), (cutting,))
    known, failed = list(charts), []
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
    """Return the charts of all meshes; those that are not known are made by Blender's own operators."""
    complete = []
    for number, (mesh, known) in enumerate(zip(meshes, charts, strict=True)):
        yield Progress("Unwrapping", number / len(meshes))
        complete.append(known or make_charts(mesh, *blender_charts.segment(mesh)))
    return tuple(complete)
