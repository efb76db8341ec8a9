"""The patches of a block on their way to the worker that works for them."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from ..numpy_pickle import NumpyPickle
from ..patches.geometry import PatchGeometry, TexelSteps
from ..patches.patch_list import PatchList
from ..scene.triangles import Triangles
from .stored_array import StoredArray


@dataclass(frozen=True)
class PatchRows(NumpyPickle):
    """Some patches, or groups of them, one after another; see `PatchList`.

    first        the first one's number
    texel        (m,) int32
    triangle     (m,) int32
    barycentric  (m, 3) float32
    """

    first: int
    texel: StoredArray
    triangle: StoredArray
    barycentric: StoredArray

    @classmethod
    def of(cls, patches: PatchList, folder: str) -> PatchRows:
        """Pack all patches; folder: in the memory of all workers, empty if there is none."""
        columns = (patches.texel, patches.triangle, patches.barycentric)
        with ThreadPoolExecutor(len(columns), "rows") as threads:
            stored = threads.map(lambda column: StoredArray.of(column, folder), columns)
            return cls(0, *stored)

    def part(self, first: int, last: int) -> PatchRows:
        """Return some of them."""
        columns = (self.texel, self.triangle, self.barycentric)
        return PatchRows(self.first + first, *(column.rows(first, last) for column in columns))

    @property
    def in_files(self) -> bool:
        """Whether nothing of it travels but where it is."""
        return all(column.path for column in (self.texel, self.triangle, self.barycentric))

    def opened(
        self, triangles: Triangles, steps: TexelSteps, resolution: int
    ) -> tuple[PatchList, PatchGeometry]:
        """Return the patches and where they are; called in tasks alone."""
        texel, triangle = self.texel.opened(), self.triangle.opened()
        geometry = PatchGeometry(triangles, steps, triangle, self.barycentric.opened())
        atlas = triangles.atlas.take(triangle)
        return PatchList(resolution, atlas, texel, triangle, geometry.barycentric), geometry


#: Rows as tasks take them: pickled if they are in files, which takes fewer tasks than sending them.
SentRows = PatchRows | bytes


def unpacked(rows: SentRows) -> PatchRows:
    """Return rows that came as the argument of a task."""
    if isinstance(rows, PatchRows):
        return rows
    opened: PatchRows = pickle.loads(rows)
    return opened
