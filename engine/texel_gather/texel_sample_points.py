"""Texel samples as receivers of a final gather."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..array_ops import any_in_rows, take_rows
from ..device.buffers import replace_rows_once
from ..device.opencl import cl
from ..direct.lighting import DirectLighting
from ..patches.geometry import PatchGeometry
from ..patches.patch_list import PatchList
from ..patches.patch_scene import PatchScene
from ..patches.sides import Sides, own_sides
from ..plan.solve_job import SolveJob
from ..plan.solver_choice import SolverChoice
from ..postprocess.texel_samples import TexelSamples, joined_samples, on_lightmap
from ..scene.model import Scene
from ..settings import Settings
from ..validity.push_off import PushOffs, push_off_points, pushed_barycentrics

#: Weight of a sample after push-off. It is small, so that such samples count only in texels without other
#: valid ones.
_PUSHED = 1e-3


@dataclass(frozen=True)
class TexelGatherJob:
    """Input of the gather at texel samples.

    scene:     scene of the bake
    job:       patches of all texels
    solved:    senders of light: the patches of the job, or patch groups
    choice:    choice of the gather
    lighting:  direct light of the patches
    """

    scene: Scene
    job: SolveJob
    solved: SolveJob
    choice: SolverChoice
    lighting: DirectLighting


def with_other_sides(samples: TexelSamples, patch_scene: PatchScene) -> tuple[TexelSamples, Sides | None]:
    """Add a point on the other side to each sample of a translucent surface; return samples and pairs.

    The pairs are None if there are no translucent surfaces.

    samples:      texel samples
    patch_scene:  patches of the texels
    """
    if patch_scene.sides is None:
        return samples, None
    resolution = patch_scene.patches.resolution
    row, column = np.divmod(samples.texel, resolution)
    entry = patch_scene.texel_to_patch[samples.atlas, row, column].astype(np.int64)
    own = np.concatenate(
        [np.ones((1, 3), np.float32), own_sides(len(patch_scene.patches), patch_scene.sides)]
    )[entry]
    chosen = np.flatnonzero((own < 1).any(axis=1))
    if not len(chosen):
        return samples, None
    there = samples.subset(chosen)
    backs = patch_scene.triangles.backs
    triangle = there.triangle if backs is None else backs[there.triangle]
    others = replace(there, triangle=triangle, barycentric=there.barycentric[:, [0, 2, 1]])
    pairs = np.stack([chosen, len(samples) + np.arange(len(chosen))], axis=1)
    return joined_samples([samples, others]), Sides(pairs, np.repeat(own[chosen, None], 2, axis=1))


class TexelSamplePoints:
    """Texel samples as receivers of a final gather.

    settings:     settings of the gather for each of the `texel_samples` samples of a texel
    patch_scene:  samples as patches, with the scene's triangles
    rays:         ray tracer with the samples as origins
    """

    def __init__(self, texel_job: TexelGatherJob, samples: TexelSamples, settings: Settings) -> None:
        self._job, self.settings = texel_job.job, settings

        # A sample represents a fraction of its texel.
        self._side = math.sqrt(settings.texel_samples)
        self._place(samples)

    def _place(self, samples: TexelSamples) -> None:
        patch_scene = self._job.patch_scene
        steps, where = patch_scene.geometry.steps, (samples.triangle, samples.barycentric)
        geometry = PatchGeometry(patch_scene.triangles, steps, *where, width=1 / self._side)
        patches = PatchList(
            patch_scene.patches.resolution,
            samples.atlas,
            samples.texel,
            samples.triangle,
            samples.barycentric,
        )
        self.samples, self.patch_scene = samples, patch_scene.seen_from(patches, geometry)
        self.rays = self._job.rays.of(self.patch_scene)

    def push_out(self, lit: np.ndarray, lit_backs: cl.Buffer | None) -> PushOffs:
        """Move samples inside geometry to just outside of it; return the push-offs.

        Samples that were moved count as outside.

        lit:        (s,) bool, samples that a back face lights, which never count as inside
        lit_backs:  see `validity.lit_backs`
        """
        samples, patch_scene = self.samples, self.patch_scene
        geometric = patch_scene.geometry.steps.geometric
        push_offs = push_off_points(self.rays, len(samples), self._side, geometric, lit_backs)
        push_offs = push_offs.without(lit)
        has_offset = np.flatnonzero(any_in_rows(push_offs.offset))
        if not len(has_offset):
            return push_offs
        inside = push_offs.rows[has_offset]
        geometry = patch_scene.geometry.subset(inside)
        moved, stays = pushed_barycentrics(geometry, take_rows(push_offs.offset, has_offset))
        inside, moved, triangle = inside[stays], take_rows(moved, stays), geometry.triangle[stays]
        push_offs.inside[inside] = False
        position = on_lightmap(patch_scene.triangles, triangle, moved, patch_scene.patches.resolution)
        self._place(self._with_rows(inside, moved, _PUSHED * samples.weight[inside], position))
        return push_offs

    def _with_rows(
        self, rows: np.ndarray, barycentric: np.ndarray, weight: np.ndarray, position: np.ndarray
    ) -> TexelSamples:
        """Return the texel samples with new values in some rows, (k,) int64; fields as in `TexelSamples`."""
        compute, numbers, changed = self._job.opencl, rows.astype(np.uint32), dict[str, np.ndarray]()
        for name, values in (("barycentric", barycentric), ("weight", weight), ("position", position)):
            before = getattr(self.samples, name)
            changed[name] = before.copy()
            changed[name][rows] = values
            if len(rows):
                replace_rows_once(compute, before, changed[name], numbers)
        return replace(self.samples, **changed)
