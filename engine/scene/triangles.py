"""Concatenated triangles of all meshes, relative to the median corner."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..array_ops import JoinedRows, adjacent_rows, joined_rows, map_blocks, run_starts
from .model import Scene

#: Approximate number of triangles from which the median corner is computed.
_SAMPLE = 1 << 12

#: Maximum texel size of a triangle as a multiple of the mean (chosen); charts of nearly no
#: area would have huge texels.
_COARSEST = 4.0

#: Bytes of the positions and lightmap UVs of a triangle.
_CORNERS = 60

#: Number of points of a row of `bounding_box` (chosen).
_WIDE = 256

#: Maximum ratio of two boxes' diagonals up to which they count as similar in size.
_ALIKE = 1.5


@dataclass(frozen=True)
class Triangles:
    """All triangles of a scene in one array, grouped by mesh.

    Back faces with patches come last, as separate triangles; rays hit only their fronts.

    positions:  (t, 3, 3) float32, m, relative to `origin`, world axes
    normals:    (t, 3, 3) float32, shading normals of the corners; see `all_normals`
    uvs:        (t, 3, 2) float32, lightmap UV
    material:   (t,) int32
    mesh:       (t,) int32
    atlas:      (t,) int32
    origin:     (3,) float64 that float32 represents exactly, m, relative to `Scene.origin`: the median corner
    span:       m, value of `diagonal`; None to compute it
    backs:      (s,) int32, back-face triangle of each front triangle, -1 for none; None if there are no back
                faces
    """

    positions: np.ndarray
    normals: np.ndarray | JoinedRows
    uvs: np.ndarray
    material: np.ndarray
    mesh: np.ndarray
    atlas: np.ndarray
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    span: float | None = None
    backs: np.ndarray | None = None

    @property
    def solid(self) -> int:
        """Number of triangles that are not back faces; they come first."""
        return len(self.mesh) if self.backs is None else len(self.backs)

    @property
    def all_normals(self) -> np.ndarray:
        """The shading normals as one array, (t, 3, 3) float32; for few triangles use `normals.take`."""
        return self.normals.whole if isinstance(self.normals, JoinedRows) else self.normals

    def in_atlas(self, atlas: int) -> slice | np.ndarray:
        """Return the triangles of an atlas: a slice if they are adjacent, else indices, (k,) int64."""
        starts, ends, atlases = self._atlas_runs
        runs = np.flatnonzero(atlases == atlas)
        if len(runs) > 1:
            return np.flatnonzero(self.atlas == atlas)
        return slice(int(starts[runs[0]]), int(ends[runs[0]])) if len(runs) else slice(0, 0)

    @cached_property
    def _atlas_runs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First and last + 1 triangle, and atlas, of each run of triangles of one atlas."""
        starts = run_starts(self.atlas)
        return starts, np.append(starts[1:], len(self.atlas)), self.atlas[starts]

    @cached_property
    def one_sided(self) -> np.ndarray:
        """Mask of triangles whose other side is a separate triangle, (t,) bool."""
        one_sided = np.zeros(len(self.mesh), bool)
        if self.backs is not None:
            one_sided[: self.solid] = self.backs >= 0
            one_sided[self.solid :] = True
        return one_sided

    @cached_property
    def uv_sizes(self) -> np.ndarray:
        """Length in the world per unit of lightmap UV, (t,) float32, m.

        It is the mean over all triangles where the UV area is 0, and at most `_COARSEST` times the mean.
        """
        area, of_uvs = np.empty(len(self.mesh), np.float32), np.empty(len(self.mesh), np.float32)

        def measure(rows: slice) -> None:
            first, second = np.moveaxis(self.positions[rows, 1:] - self.positions[rows, :1], 1, 0)
            area[rows] = np.linalg.norm(np.cross(first, second), axis=1)
            first, second = np.moveaxis(self.uvs[rows, 1:] - self.uvs[rows, :1], 1, 0)
            of_uvs[rows] = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])

        map_blocks(len(self.mesh), _CORNERS, measure)
        has_uvs = of_uvs > 0
        total = of_uvs.sum(dtype=np.float64)
        mean = area[has_uvs].sum(dtype=np.float64) / total if total else 0.0
        ratio = np.divide(area, of_uvs, out=np.full_like(area, mean), where=has_uvs)
        sizes: np.ndarray = np.sqrt(np.minimum(ratio, _COARSEST**2 * mean)).astype(np.float32)
        return sizes

    @cached_property
    def box(self) -> np.ndarray:
        """Bounding box of all triangles, lower and upper corner, (2, 3) float64, m."""
        return bounding_box(self.positions)

    @cached_property
    def diagonal(self) -> float:
        """Length of the box diagonal, m; ray offsets are fractions of it."""
        if self.span is not None:
            return self.span
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def fits(self, scene: Scene) -> bool:
        """Return True if this origin suits a scene: near its box, and the box of similar size."""
        parts = [mesh.positions.astype(np.float64) for mesh in scene.meshes if len(mesh.positions)]
        low = np.min([part.min(axis=(0, 1)) for part in parts], axis=0)
        high = np.max([part.max(axis=(0, 1)) for part in parts], axis=0)
        diagonal = float(np.linalg.norm(high - low))
        alike = diagonal / _ALIKE <= self.diagonal <= diagonal * _ALIKE
        return alike and bool(np.abs((low + high) / 2 - self.origin).max() <= diagonal)


def bounding_box(positions: np.ndarray) -> np.ndarray:
    """Return lower and upper corner of the box around points, (..., 3), as (2, 3) float64."""
    points = positions.reshape(-1, 3)
    if whole := len(points) // _WIDE * _WIDE:
        # NumPy compares long rows several times as fast as rows of three.
        rows = points[:whole].reshape(-1, 3 * _WIDE)
        ends = [end.reduce(rows).reshape(-1, 3) for end in (np.minimum, np.maximum)]
        points = np.concatenate([points[whole:], *ends])
    axes = points.T
    return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]], np.float64)


def join_meshes(scene: Scene, before: Triangles | None = None) -> Triangles:
    """Concatenate the meshes of a scene, and move the median corner to the origin.

    float32 is most precise near the origin. The centre of the bounding box would lose precision for most of
    the scene if a few triangles are far away. Back faces, which come last, do not count.

    before:  triangles before objects moved; if their origin still suits, unmoved triangles keep their bits
             and ray offsets
    """
    positions = np.concatenate([mesh.positions for mesh in scene.meshes]).astype(np.float32, copy=False)
    solid = sum(len(mesh.positions) for mesh in scene.meshes if mesh.front is None)
    origin, span = _median(positions[:solid]), None
    if before is not None and before.fits(scene):
        origin, span = before.origin.astype(np.float32), before.diagonal

    def move(rows: slice) -> None:
        # Three passes over one axis each are several times as fast as one over rows of three.
        for axis in range(3):
            positions[rows, :, axis] -= origin[axis]

    map_blocks(len(positions), 72, move)
    counts = [len(mesh.positions) for mesh in scene.meshes]
    return Triangles(
        positions=positions,
        normals=_normals(scene),
        uvs=_joined([mesh.uvs for mesh in scene.meshes], np.float32),
        material=_joined([mesh.material for mesh in scene.meshes], np.int32),
        mesh=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        atlas=np.repeat(np.array([mesh.atlas for mesh in scene.meshes], np.int32), counts),
        origin=origin.astype(np.float64),
        span=span,
        backs=_backs(scene),
    )


def _joined(arrays: list[np.ndarray], dtype: type) -> np.ndarray:
    """Concatenate arrays of meshes, contiguous and of a type; the array of a single mesh is not copied."""
    return np.ascontiguousarray(joined_rows(arrays), dtype)


def _normals(scene: Scene) -> np.ndarray | JoinedRows:
    """Return `Triangles.normals`; those of front faces that are adjacent in memory are not copied."""
    fronts = [mesh.normals for mesh in scene.meshes if mesh.front is None]
    backs = [mesh.normals for mesh in scene.meshes if mesh.front is not None]
    known = adjacent_rows(fronts) if backs else None
    if known is None:
        return _joined([*fronts, *backs], np.float32)
    return JoinedRows([known, joined_rows(backs)])


def _backs(scene: Scene) -> np.ndarray | None:
    """Return `Triangles.backs`; meshes of back faces come last."""
    fronts = [mesh.front for mesh in scene.meshes if mesh.front is not None]
    if not fronts:
        return None
    count = sum(len(mesh.positions) for mesh in scene.meshes if mesh.front is None)
    front = np.concatenate(fronts)
    backs = np.full(count, -1, np.int32)
    backs[front] = np.arange(count, count + len(front), dtype=np.int32)
    return backs


def _median(positions: np.ndarray) -> np.ndarray:
    """Return the approximate median corner of triangles, (t, 3, 3) float32."""
    sample = positions[:: max(1, len(positions) // _SAMPLE)].reshape(-1, 3)
    middle = [(len(sample) - 1) // 2, len(sample) // 2]
    median: np.ndarray = np.partition(sample, middle, axis=0)[middle].mean(axis=0)
    return median
