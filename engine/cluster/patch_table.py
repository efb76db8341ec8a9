"""Tables of patches or patch groups, packed for transfer: data of all patches that each worker needs."""

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
    """Radiance of patches, most of which are black.

    count:   number of patches
    patch:   (k,) uint32, patches that are not black
    values:  (k, 3) float32, their radiance
    """

    count: int
    patch: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, radiance: np.ndarray) -> SparseRadiance:
        """Pack the radiance of all patches, (n, 3) float32."""
        return cls.among(radiance, nonzero_rows(radiance))

    @classmethod
    def among(cls, radiance: np.ndarray, patches: np.ndarray) -> SparseRadiance:
        """Pack the radiance of all patches, of which only some, (k,) int64, may be non-zero."""
        values = radiance[patches]
        shines = any_in_rows(values)
        return cls(len(radiance), patches[shines].astype(np.uint32), values[shines])

    def of_all(self) -> np.ndarray:
        """Return the radiance of all patches, (n, 3) float32; untouched pages take no memory."""
        pages = mmap.mmap(-1, max(12 * self.count, 1))
        radiance = np.frombuffer(pages, np.float32, 3 * self.count).reshape(-1, 3)
        radiance[self.patch] = self.values
        return radiance


@dataclass(frozen=True)
class PatchTable(NumpyPickle):
    """Patches or patch groups as sources for all workers: index map and emission.

    name:            unique name
    texel_to_patch:  (atlases, r, r) uint32, see `PatchScene`
    emission:        radiance that visible back faces emit, see `SolveJob.back_emission`
    back_to_back:    see `PatchScene.back_to_back`
    """

    name: str
    texel_to_patch: StoredArray
    emission: SparseRadiance
    back_to_back: bool

    @classmethod
    def of(
        cls, texel_to_patch: np.ndarray, emission: SparseRadiance, back_to_back: bool, folder: str
    ) -> PatchTable:
        """Pack patches or patch groups.

        folder:  folder of files that all workers can map; empty if there is none
        """
        return cls(uuid.uuid4().hex, StoredArray.of(texel_to_patch, folder), emission, back_to_back)


@dataclass(frozen=True)
class SceneTable(PatchTable):
    """Patches of a scene, and all emission that shadow rays sample.

    glow:                     emission of front faces
    backs:                    emission of back faces; None if equal
    shining:                  (s,) int64, triangles with a patch whose back emits
    sampled:                  (b,) int64, triangles sampled as lights
    radiance, back_radiance:  (b, 3) float32, radiance of the front and the back of the sampled triangles
    uniform:                  (b,) bool, True if radiance is constant over the triangle
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
        cls, patch_scene: PatchScene, bright: SampledTriangles, back_to_back: bool, folder: str
    ) -> SceneTable:
        """Pack the patches of a scene and its sampled triangles.

        folder:  see `PatchTable.of`
        """
        surfaces, stored = patch_scene.surfaces, StoredArray.of(patch_scene.texel_to_patch, folder)
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
        """Return the sampled triangles.

        triangles:  number of triangles of the scene
        left:       (n, 3) float32, see `SampledTriangles.back_left`; front faces are not needed
        """
        shining = np.zeros(triangles, bool)
        shining[self.shining] = True
        sampled = self.sampled, self.radiance, self.back_radiance, self.uniform
        return SampledTriangles(*sampled, left, left, shining)
