"""Unwrapping in a process of its own, which xatlas may bring down or keep busy for long."""

from __future__ import annotations

from collections.abc import Generator, Sequence

from ....engine.errors import WorkerError
from ....engine.progress import Progress
from ....engine.unwrap.charts import make_charts
from ....engine.unwrap.polygon_mesh import Charts, PolygonMesh
from ....engine.unwrap.segmentation import has_xatlas
from ....engine.unwrap.unwrapping import Square, Unwrapped
from ...worker_owner import new_worker
from . import blender_charts

#: The generators that the process runs: all of the work, or only the part that xatlas does.
_UNWRAP = "engine.unwrap.unwrapping:unwrap"
_CUT = "engine.unwrap.unwrapping:cut"

#: How long xatlas may be silent: about ten times what it takes for meshes as slow as any measured, s.
_PATIENCE, _PATIENCE_PER_TRIANGLE = 60.0, 2e-3

KnownCharts = tuple[Charts | None, ...]


def unwrap_apart(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts | None], squares: Sequence[Square]
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
            return (yield from _run(_UNWRAP, meshes, (known, tuple(squares)))), []
        except WorkerError:
            if all(known):
                raise
        known, failed = yield from _cut_each(meshes, known)
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


def _cut_each(
    meshes: Sequence[PolygonMesh], charts: KnownCharts
) -> Generator[Progress | None, None, tuple[KnownCharts, list[int]]]:
    """Return the charts of all meshes, and those that xatlas cannot cut: it is tried on ever smaller halves.

    Raises WorkerError if the process cannot even be started.
    """
    yield from _run(_CUT, ())
    known, failed = list(charts), []
    groups = [[index for index, made in enumerate(charts) if made is None]]
    while groups:
        group = groups.pop()
        try:
            made = yield from _run(_CUT, [meshes[index] for index in group], attempts=1)
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
