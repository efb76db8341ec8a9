"""Patches of a block, packed for transfer to a worker."""

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
    """Consecutive patches or patch groups; see `PatchList`.

    first:        index of the first patch
    texel:        (m,) int32
    triangle:     (m,) int32
    barycentric:  (m, 3) float32
    """

    first: int
    texel: StoredArray
    triangle: StoredArray
    barycentric: StoredArray

    @classmethod
    def of(cls, patches: PatchList, folder: str) -> PatchRows:
        """Pack all patches. folder: in the shared memory of all workers, empty if there is none."""
        columns = (patches.texel, patches.triangle, patches.barycentric)
        with ThreadPoolExecutor(len(columns), "rows") as threads:
            stored = threads.map(lambda column: StoredArray.of(column, folder), columns)
            return cls(0, *stored)

    def part(self, first: int, last: int) -> PatchRows:
        """Return the patches first <= i < last of these."""
        columns = (self.texel, self.triangle, self.barycentric)
        return PatchRows(self.first + first, *(column.rows(first, last) for column in columns))

    @property
    def in_files(self) -> bool:
        """True if all columns are stored in files, so that a transfer sends only their paths."""
        return all(column.path for column in (self.texel, self.triangle, self.barycentric))

    def opened(
        self, triangles: Triangles, steps: TexelSteps, resolution: int
    ) -> tuple[PatchList, PatchGeometry]:
        """Return the patch list and geometry; call only in tasks."""
        texel, triangle = self.texel.opened(), self.triangle.opened()
        geometry = PatchGeometry(triangles, steps, triangle, self.barycentric.opened())
        atlas = triangles.atlas.take(triangle)
        return PatchList(resolution, atlas, texel, triangle, geometry.barycentric), geometry


#: Rows as a task argument; pickled if they are in files, which needs fewer tasks.
SentRows = PatchRows | bytes


def unpacked(rows: SentRows) -> PatchRows:
    """Unpickle rows if necessary."""
    if isinstance(rows, PatchRows):
        return rows
    opened: PatchRows = pickle.loads(rows)
    return opened
