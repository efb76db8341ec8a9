"""Groups of patches on their way to workers: once a bake, in a file within a machine."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from ..portable import Portable
from .machine_files import file_bytes
from .memory_folder import file_with


@dataclass(frozen=True)
class Squares(Portable):
    """Groups of the patches of a scene; see `solve.patch_groups.PatchGroups`.

    data    (n,) uint32, the patch that each patch follows; empty if it is in a file
    path    of a file in the memory of the client's machine; empty without one
    width   of a square, texels
    digest  hexadecimal: names the groups on workers
    """

    data: np.ndarray
    path: str
    width: int
    digest: str

    @classmethod
    def of(cls, leader: np.ndarray, width: int, folder: str) -> Squares:
        """Pack the patch that each patch follows.

        leader  (n,) uint32
        folder  in the memory of all workers; empty if there is none
        """
        leader = np.ascontiguousarray(leader, np.uint32)
        path = file_with(folder, leader.data)
        return cls(leader[:0] if path else leader, path, width, hashlib.sha256(leader.data).hexdigest())

    @property
    def leader(self) -> np.ndarray:
        """The patch that each patch follows, (n,) uint32."""
        return np.frombuffer(file_bytes(self.path), np.uint32) if self.path else self.data
