"""Patches, or groups of them, on their way to workers: what all workers need of all of them."""

from __future__ import annotations

import mmap
import uuid
from dataclasses import dataclass

import numpy as np

from ..array_ops import any_in_rows, nonzero_rows
from ..direct.emitters import SampledTriangles
from ..numpy_pickle import NumpyPickle
from ..patches.patch_scene import PatchScene
from .stored_array import StoredArray


@dataclass(frozen=True)
class SparseRadiance(NumpyPickle):
    """Radiance of patches, most of which are dark.

    count   patches
    patch   (k,) uint32, those that are not dark
    values  (k, 3) float32
    """

    count: int
    patch: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, radiance: np.ndarray) -> SparseRadiance:
        """Take the radiance of all patches, (n, 3) float32."""
        return cls.among(radiance, nonzero_rows(radiance))

    @classmethod
    def among(cls, radiance: np.ndarray, patches: np.ndarray) -> SparseRadiance:
        """Take the radiance of all patches, of which all but some, (k,) int64, are dark."""
        values = radiance[patches]
        shines = any_in_rows(values)
        return cls(len(radiance), patches[shines].astype(np.uint32), values[shines])

    def of_all(self) -> np.ndarray:
        """Return the radiance of all patches, (n, 3) float32: where all are dark, it takes no memory."""
        pages = mmap.mmap(-1, max(12 * self.count, 1))
        radiance = np.frombuffer(pages, np.float32, 3 * self.count).reshape(-1, 3)
        radiance[self.patch] = self.values
        return radiance


@dataclass(frozen=True)
class PatchTable(NumpyPickle):
    """Patches, or groups of them, as all workers need them: how they are found, and what they emit.

    name            tells them from all others
    texel_to_patch  (atlases, r, r) uint32, see `PatchScene`
    emission        of backs that is seen, see `SolveJob.back_emission`
    back_to_back    see `PatchScene`
    """

    name: str
    texel_to_patch: StoredArray
    emission: SparseRadiance
    back_to_back: bool

    @classmethod
    def of(
        cls, texel_to_patch: np.ndarray, emission: SparseRadiance, back_to_back: bool, folder: str
    ) -> PatchTable:
        """Pack groups of patches; folder: in the memory of all workers, empty if there is none."""
        return cls(uuid.uuid4().hex, StoredArray.of(texel_to_patch, folder), emission, back_to_back)


@dataclass(frozen=True)
class SceneTable(PatchTable):
    """The patches of a scene, and what shines as shadow rays need it.

    glow      what their fronts emit
    backs     what their backs emit; None if it is the same
    shining   (s,) int64, triangles with a patch that emits
    sampled   (b,) int64, those that are sampled as lights
    radiance, back_radiance  (b, 3) float32, of these
    uniform   (b,) bool, it is the same all over the triangle
    """

    glow: SparseRadiance
    backs: SparseRadiance | None
    shining: np.ndarray
    sampled: np.ndarray
    radiance: np.ndarray
    back_radiance: np.ndarray
    uniform: np.ndarray

    @classmethod
    def of_scene(
        cls, parts: PatchScene, bright: SampledTriangles, back_to_back: bool, folder: str
    ) -> SceneTable:
        """Pack the patches of a scene, and what of it is sampled as lights; folder: as of `of`."""
        surfaces, stored = parts.surfaces, StoredArray.of(parts.texel_to_patch, folder)
        glow, left = (
            SparseRadiance.among(radiance, surfaces.shining)
            for radiance in (surfaces.emission, bright.back_left)
        )
        table = uuid.uuid4().hex, stored, left, back_to_back
        sampled = bright.triangles, bright.radiance, bright.back_radiance, bright.uniform
        told_apart = surfaces.back_emission is not None
        backs = SparseRadiance.among(surfaces.emission_of_backs, surfaces.shining) if told_apart else None
        return cls(*table, glow, backs, np.flatnonzero(bright.shining), *sampled)

    def bright(self, triangles: int, left: np.ndarray) -> SampledTriangles:
        """Return what is sampled.

        triangles  how many there are
        left       (n, 3) float32, see `SampledTriangles.back_left`; fronts are not needed
        """
        shining = np.zeros(triangles, bool)
        shining[self.shining] = True
        sampled = self.sampled, self.radiance, self.back_radiance, self.uniform
        return SampledTriangles(*sampled, left, left, shining)
