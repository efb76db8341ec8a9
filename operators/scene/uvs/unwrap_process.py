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

#: The generator that the process runs.
_WORK = "engine.unwrap.unwrapping:unwrap"

#: How long xatlas may be silent: about ten times what it takes for meshes as slow as any measured, s.
_PATIENCE, _PATIENCE_PER_TRIANGLE = 60.0, 2e-3


def unwrap_apart(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts | None], squares: Sequence[Square]
) -> Generator[Progress | None, None, Unwrapped]:
    """Do the work of `engine.unwrap.unwrapping.unwrap` in another process; closing kills that.

    Raises WorkerError if the process died or hung twice. Without xatlas Blender makes the charts.
    """
    from ....engine.worker.disposable import run_apart

    if not has_xatlas():
        charts = yield from _charts_by_blender(meshes, charts)
    triangles = sum(len(mesh.triangles) for mesh in meshes)
    arguments = (tuple(meshes), tuple(charts), tuple(squares))
    patience = _PATIENCE + _PATIENCE_PER_TRIANGLE * triangles
    try:
        return (yield from run_apart(lambda: new_worker(_WORK), arguments, patience))
    except WorkerError as error:
        raise WorkerError(f"Lightmap UVs could not be made. {error}") from error


def _charts_by_blender(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts | None]
) -> Generator[Progress | None, None, list[Charts]]:
    """Return the charts of all meshes; those that are not known are made by Blender's own operators."""
    complete = []
    for number, (mesh, known) in enumerate(zip(meshes, charts, strict=True)):
        yield Progress("Unwrapping", number / len(meshes))
        complete.append(known or make_charts(mesh, *blender_charts.segment(mesh)))
    return complete
