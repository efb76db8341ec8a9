"""Patches that nobody sees, as they look to those who see the rest of their texels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..array_ops import any_in_rows, segment_sums, take_rows
from ..device.device_array import Values, colors_on_host, values_at
from ..device.opencl import cl
from ..patches.texels_around import entries_around
from ..plan.solve_job import SolveJob
from ..scene.color import channel_sum
from ..solve.exitant_radiance import replace_radiance
from .texel_sample_points import TexelGatherJob

#: Texels between a hidden patch and the visible ones that it may have light from, at most.
_REACH = 2

#: Light below this part of the brightest near hidden patches counts as that much in harmonic means.
_FAINTEST = 1e-4


class InvalidTexelFill:
    """Gives hidden patches the light of visible patches beside them.

    A ray that meets the visible part of a texel whose centre is hidden has to find the light beside the
    centre. The harmonic mean of the patches there is taken: where a thin wall has light on one side and none
    on the other it is dark; a bright one would light the foot of the wall on its dark side.

    what    patches, and those that send light out: the same, or groups of them
    hidden  (n,) bool, patches of the job that nobody sees
    """

    def __init__(self, what: TexelGatherJob, hidden: np.ndarray) -> None:
        parts, self._hidden, self._solved = what.job.parts, np.flatnonzero(hidden), what.solved
        entries = entries_around(parts.texel_to_patch, parts.patches.key[self._hidden])

        # Most are far from what is seen, and stay black.
        self._reached = _within_reach(hidden, self._hidden, entries)
        reached, beside = self._hidden[self._reached], take_rows(entries, self._reached)

        # The others and the patches around them are numbered from 1 on, in the order of all patches.
        near = np.zeros(len(hidden) + 1, bool)
        near[beside] = near[reached + 1] = True
        near[0] = False
        chosen = np.flatnonzero(near)
        number = np.zeros(len(near), np.int64)
        number[chosen] = np.arange(1, len(chosen) + 1)
        self._mine, self._beside = number[reached + 1] - 1, number[beside]
        self._visible = ~hidden[chosen - 1]

        # The patch or the group that sends out the light of each.
        self._sender, self._groups = chosen - 1, None
        if len(self._hidden) and what.solved is not what.job:
            group = what.solved.parts.texel_to_patch.ravel().take(parts.patches.key)
            self._sender = group[chosen - 1].astype(np.int64) - 1
            self._groups = _HiddenGroups(group, self._hidden)

    def seen(self, light: np.ndarray) -> np.ndarray:
        """Return E/pi, (m, 3 g) float32, of the patches that send light out, of hidden ones from beside them.

        light: (m, 3 g) float32, E/pi of g groups of lights side by side, weighed by their sum; or reflectance
        """
        if not len(self._hidden):
            return light
        changed, others = self._others(light)
        seen = light.copy()
        seen[changed] = others
        return seen

    def replace(self, radiance: cl.Buffer, settled: Values) -> None:
        """Let hidden patches send out, on the device, what those beside them do.

        radiance  as of `exitant_radiance`, of the patches that send light out, in which that of hidden ones
                  changes
        settled   (m, 3) float32, their E/pi
        """
        if not len(self._hidden):
            return
        changed, light = self._others(settled)
        sent = take_rows(self._solved.emission, changed)
        if self._solved.settings.has_indirect:
            sent = sent + self._others(self._solved.parts.surfaces.reflectance)[1] * light
        replace_radiance(self._solved.opencl, radiance, changed, sent)

    def on_surfaces(self, solved: SolveJob) -> SolveJob:
        """Return a job whose hidden patches reflect what those beside them do, as in `seen`."""
        surfaces = solved.parts.surfaces
        seen = replace(surfaces, reflectance=self.seen(colors_on_host(surfaces.reflectance)))
        return replace(solved, parts=replace(solved.parts, surfaces=seen))

    def _others(self, light: Values) -> tuple[np.ndarray, np.ndarray]:
        """Return which of the patches that send light out change, (k,) int64, and to what, (k, 3 g) float32.

        light: (m, 3 g) float32, of all of them
        """
        near = values_at(light, self._sender)
        of_hidden = np.zeros((len(self._hidden), near.shape[1]), np.float32)
        if len(near):
            brightest = float(channel_sum(near).max())
            of_hidden[self._reached] = self._beside_hidden(near, max(_FAINTEST * brightest, 1e-30))
        if self._groups:
            return self._groups.changed, self._groups.mean(light, of_hidden)
        return self._hidden, of_hidden

    def _beside_hidden(self, light: np.ndarray, faintest: float) -> np.ndarray:
        """Return the light of hidden patches, (h, 3 g) float32, black where no visible patch is near.

        light: (k, 3 g) float32, of those that are numbered; faintest: what counts as that much
        """
        known, left, beside = self._visible.copy(), self._mine, self._beside
        total = channel_sum(light)
        for _ in range(_REACH):
            counts = (beside > 0) & known[beside - 1]
            reached = any_in_rows(counts)
            mine, near = left[reached], take_rows(beside, reached)
            counts = take_rows(counts, reached).astype(np.float32)
            sums = np.einsum("hk,hkc->hc", counts, take_rows(light, near - 1))
            light[mine] = sums * _darkened(total[near - 1], counts, faintest)[:, None]
            total[mine] = channel_sum(light[mine])
            known[mine] = True
            left, beside = left[~reached], take_rows(beside, ~reached)
        light[left] = 0
        return take_rows(light, self._mine)


def _within_reach(hidden: np.ndarray, patches: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """Return the rows of hidden patches, (k,) int64, that visible ones are near, see `_REACH`.

    hidden   (n,) bool
    patches  (h,) int64, the hidden ones
    entries  (h, 9) int64, what is around each, see `entries_around`
    """
    known = np.concatenate([[False], ~hidden])
    reached = np.zeros(len(patches), bool)
    for _ in range(_REACH):
        reached |= any_in_rows(known[entries])
        known[patches[reached] + 1] = True
    return np.flatnonzero(reached)


class _HiddenGroups:
    """Groups of patches that hidden ones are in.

    group    (n,) uint32, of each patch, + 1
    hidden   (h,) int64
    changed  (k,) int64, the groups that have any
    """

    def __init__(self, group: np.ndarray, hidden: np.ndarray) -> None:
        members = np.bincount(group)[1:]
        of_hidden = group[hidden].astype(np.int64) - 1
        among = np.bincount(of_hidden, minlength=len(members))
        self.changed = np.flatnonzero(among)
        self._visible = (members - among)[self.changed]
        self._group = np.searchsorted(self.changed, of_hidden)

    def mean(self, light: Values, of_hidden: np.ndarray) -> np.ndarray:
        """Return the light of groups that are `changed`, (k, 3 g) float32.

        It is the mean over the group's visible patches and over its hidden ones near visible patches.
        Patches without light do not count: hidden ones farther off, which nobody sees, have none.

        light: (m, 3 g) float32, of groups; of_hidden: (h, 3 g) float32
        """
        before, lit = values_at(light, self.changed), any_in_rows(of_hidden)
        visible = self._visible * any_in_rows(before)
        count = len(self.changed)
        number = visible + np.bincount(self._group[lit], minlength=count)
        sums = before * visible[:, None] + segment_sums(of_hidden[lit], self._group[lit], count)
        mean: np.ndarray = (sums / np.maximum(number, 1)[:, None]).astype(np.float32)
        return mean


def _darkened(total: np.ndarray, counts: np.ndarray, faintest: float) -> np.ndarray:
    """Return the factors, (h,) float32, that make harmonic means of sums of patches' light.

    total (h, k) of all channels together; counts (h, k) float32, 1 for those that are added up, else 0
    """
    number = channel_sum(counts)
    inverse = np.einsum("hk,hk->h", counts, 1 / np.maximum(total, faintest))
    sums = np.einsum("hk,hk->h", counts, total)
    factor: np.ndarray = np.minimum(number / np.maximum(inverse, 1e-30) / np.maximum(sums, 1e-30), 1 / number)
    return factor.astype(np.float32)
