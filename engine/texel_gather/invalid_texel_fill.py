"""Fill of invalid patches with light from valid neighbours, for rays that hit their texels."""

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

#: Maximum distance in texels between an invalid patch and the valid ones that it takes light from.
_REACH = 2

#: Fraction of the brightest light nearby below which light counts as that bright in harmonic means.
_FAINTEST = 1e-4


class InvalidTexelFill:
    """Fill of invalid patches with the light of valid neighbours.

    A ray that hits the visible part of a texel whose centre is covered must find the light next to the
    centre. The fill is the harmonic mean of the neighbours. At a thin wall with light on one side it is dark;
    a bright value would light the foot of the wall on the dark side.

    texel_job:  patches, and the senders of light: the same patches, or patch groups
    hidden:  (n,) bool, invalid patches of the job
    """

    def __init__(self, texel_job: TexelGatherJob, hidden: np.ndarray) -> None:
        parts, self._hidden, self._solved = texel_job.job.parts, np.flatnonzero(hidden), texel_job.solved
        entries = entries_around(parts.texel_to_patch, parts.patches.key[self._hidden])

        # Most invalid patches are far from valid ones and stay black.
        self._reached = _within_reach(hidden, self._hidden, entries)
        reached, beside = self._hidden[self._reached], take_rows(entries, self._reached)

        # Number the remaining invalid patches and their neighbours from 1, in patch order.
        contacts = np.zeros(len(hidden) + 1, bool)
        contacts[beside] = contacts[reached + 1] = True
        contacts[0] = False
        chosen = np.flatnonzero(contacts)
        number = np.zeros(len(contacts), np.int64)
        number[chosen] = np.arange(1, len(chosen) + 1)
        self._mine, self._beside = number[reached + 1] - 1, number[beside]
        self._visible = ~hidden[chosen - 1]

        # Sender of light for each numbered patch: the patch itself, or its group.
        self._sender, self._groups = chosen - 1, None
        if len(self._hidden) and texel_job.solved is not texel_job.job:
            group = texel_job.solved.parts.texel_to_patch.ravel().take(parts.patches.key)
            self._sender = group[chosen - 1].astype(np.int64) - 1
            self._groups = _HiddenGroups(group, self._hidden)

    def seen(self, light: np.ndarray) -> np.ndarray:
        """Return values of the senders, (m, 3 g) float32; entries of invalid sources are filled.

        light:  (m, 3 g) float32, E/pi of g light groups side by side, whose sum is the weight; or reflectance
        """
        if not len(self._hidden):
            return light
        changed, others = self._others(light)
        seen = light.copy()
        seen[changed] = others
        return seen

    def replace(self, radiance: cl.Buffer, settled: Values) -> None:
        """Replace the exitant radiance of invalid senders on the device by the filled values.

        radiance:  exitant radiance of the senders, see `exitant_radiance`; modified
        settled:   (m, 3) float32, E/pi of the senders
        """
        if not len(self._hidden):
            return
        changed, light = self._others(settled)
        sent = take_rows(self._solved.emission, changed)
        if self._solved.settings.has_indirect:
            sent = sent + self._others(self._solved.parts.surfaces.reflectance)[1] * light
        replace_radiance(self._solved.opencl, radiance, changed, sent)

    def on_surfaces(self, solved: SolveJob) -> SolveJob:
        """Return a copy of a job in which invalid patches have the filled reflectance."""
        surfaces = solved.parts.surfaces
        seen = replace(surfaces, reflectance=self.seen(colors_on_host(surfaces.reflectance)))
        return replace(solved, parts=replace(solved.parts, surfaces=seen))

    def _others(self, light: Values) -> tuple[np.ndarray, np.ndarray]:
        """Return the invalid senders, (k,) int64, and their filled values, (k, 3 g) float32.

        light:  (m, 3 g) float32, values of all senders
        """
        contacts = values_at(light, self._sender)
        of_hidden = np.zeros((len(self._hidden), contacts.shape[1]), np.float32)
        if len(contacts):
            brightest = float(channel_sum(contacts).max())
            of_hidden[self._reached] = self._beside_hidden(contacts, max(_FAINTEST * brightest, 1e-30))
        if self._groups:
            return self._groups.changed, self._groups.mean(light, of_hidden)
        return self._hidden, of_hidden

    def _beside_hidden(self, light: np.ndarray, faintest: float) -> np.ndarray:
        """Return the harmonic mean of valid neighbours for invalid patches, (h, 3 g) float32; 0 without any.

        light:     (k, 3 g) float32, light of the numbered patches
        faintest:  minimum brightness in harmonic means
        """
        known, left, beside = self._visible.copy(), self._mine, self._beside
        total = channel_sum(light)
        for _ in range(_REACH):
            counts = (beside > 0) & known[beside - 1]
            reached = any_in_rows(counts)
            mine, contacts = left[reached], take_rows(beside, reached)
            counts = take_rows(counts, reached).astype(np.float32)
            sums = np.einsum("hk,hkc->hc", counts, take_rows(light, contacts - 1))
            light[mine] = sums * _darkened(total[contacts - 1], counts, faintest)[:, None]
            total[mine] = channel_sum(light[mine])
            known[mine] = True
            left, beside = left[~reached], take_rows(beside, ~reached)
        light[left] = 0
        return take_rows(light, self._mine)


def _within_reach(hidden: np.ndarray, patches: np.ndarray, entries: np.ndarray) -> np.ndarray:
    """Return the rows of invalid patches, (k,) int64, within `_REACH` texels of valid ones.

    hidden:   (n,) bool, invalid patches
    patches:  (h,) int64, their indices
    entries:  (h, 9) int64, index map entries around each, see `entries_around`
    """
    known = np.concatenate([[False], ~hidden])
    reached = np.zeros(len(patches), bool)
    for _ in range(_REACH):
        reached |= any_in_rows(known[entries])
        known[patches[reached] + 1] = True
    return np.flatnonzero(reached)


class _HiddenGroups:
    """Patch groups with invalid members.

    group:    (n,) uint32, group + 1 of each patch
    hidden:   (h,) int64, invalid patches
    changed:  (k,) int64, groups with invalid members
    """

    def __init__(self, group: np.ndarray, hidden: np.ndarray) -> None:
        members = np.bincount(group)[1:]
        of_hidden = group[hidden].astype(np.int64) - 1
        among = np.bincount(of_hidden, minlength=len(members))
        self.changed = np.flatnonzero(among)
        self._visible = (members - among)[self.changed]
        self._group = np.searchsorted(self.changed, of_hidden)

    def mean(self, light: Values, of_hidden: np.ndarray) -> np.ndarray:
        """Return the light of the groups `changed`, (k, 3 g) float32.

        It is the mean over the valid members and the filled invalid members. Members without light do not
        count: invalid patches far from valid ones have none.

        light:      (m, 3 g) float32, light of all groups
        of_hidden:  (h, 3 g) float32, filled light of the invalid patches
        """
        before, lit = values_at(light, self.changed), any_in_rows(of_hidden)
        visible = self._visible * any_in_rows(before)
        count = len(self.changed)
        number = visible + np.bincount(self._group[lit], minlength=count)
        sums = before * visible[:, None] + segment_sums(of_hidden[lit], self._group[lit], count)
        mean: np.ndarray = (sums / np.maximum(number, 1)[:, None]).astype(np.float32)
        return mean


def _darkened(total: np.ndarray, counts: np.ndarray, faintest: float) -> np.ndarray:
    """Return factors, (h,) float32, that turn a sum over neighbours into their harmonic mean.

    total:   (h, k) light of each neighbour, sum of the channels
    counts:  (h, k) float32, 1 for neighbours in the sum, else 0
    """
    number = channel_sum(counts)
    inverse = np.einsum("hk,hk->h", counts, 1 / np.maximum(total, faintest))
    sums = np.einsum("hk,hk->h", counts, total)
    factor: np.ndarray = np.minimum(number / np.maximum(inverse, 1e-30) / np.maximum(sums, 1e-30), 1 / number)
    return factor.astype(np.float32)
