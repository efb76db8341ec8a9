"""What texels show that have several display samples: the mean of those that are seen."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..runs import run_numbers, run_starts
from ..segment_sums import segment_sums
from .display_samples import DisplaySamples
from .texel_planes import TexelPlanes, steps_around
from .texels_beyond import TexelsBeyond

#: A sample that weighs less than this part of the heaviest of its texel was moved out of something.
_MOVED = 0.01


class TexelMeans:
    """Means over the samples of each texel, weighted by area.

    visible  (s,) bool, samples that somebody sees; texels without any are filled as hidden ones
    texels   (k,) int64, atlas * r * r + texel, that have samples that are seen
    beyond   (b,) int64, hidden ones beside texels that are seen for the greater part

    What is seen of a texel that something cuts lies beside its centre: its mean goes on to there by the slope
    of a plane through the samples of 3 x 3 texels (`TexelPlanes`). Where most of it is seen, texels beyond it
    are read, too: they show the mean of the planes around such texels beside them. Where light bends, they
    and texels that are hardly seen get what makes the display right at the samples (`TexelsBeyond`).
    """

    def __init__(self, samples: DisplaySamples, visible: np.ndarray, resolution: int) -> None:
        chosen = np.flatnonzero(visible & (samples.weight > 0))
        keys = samples.keys(resolution)
        firsts = run_starts(keys)
        self._all = keys[firsts]
        self._starts = run_starts(keys[chosen])
        self.texels, self._texel = keys[chosen[self._starts]], run_numbers(self._starts, len(chosen))
        self._chosen, self._weight = chosen, samples.weight[chosen].astype(np.float64)
        self._total = np.bincount(self._texel, self._weight, len(self.texels))
        self._cut, self._off_centre, mostly_seen = self._cut_texels(firsts, samples.weight, resolution)
        place = _from_centres(samples.position[chosen], keys[chosen], resolution)
        self._centroid = self._sums(place)[self._cut] / self._total[self._cut, None]
        cut = self.texels[self._cut]
        self._planes = TexelPlanes(self.texels, self._starts, place, self._weight, cut, resolution)

        # Hidden texels that are read, and the steps to them from those whose planes go on there.
        hidden, steps = self.hidden, steps_around(cut[mostly_seen], self.hidden, resolution)
        near = np.zeros(len(hidden), bool)
        for _, there, _ in steps:
            near[there] = True
        self.beyond = hidden[near]
        self._plane = np.concatenate([mostly_seen[texel] for texel, _, _ in steps])
        self._target = np.concatenate([(np.cumsum(near) - 1)[there] for _, there, _ in steps])
        back = [np.tile(np.negative(step, dtype=float), (len(there), 1)) for _, there, step in steps]
        self._step = np.concatenate(back)
        hardly_seen = np.delete(self._cut, mostly_seen)
        beyond = np.concatenate([hardly_seen, np.arange(len(self.texels), len(self.shown))])
        self._beyond = TexelsBeyond(samples, chosen, self.shown, beyond, resolution)

    @cached_property
    def hidden(self) -> np.ndarray:
        """Texels none of whose samples is seen, (h,) int64, atlas * r * r + texel."""
        unseen = np.ones(len(self._all), bool)
        unseen[np.searchsorted(self._all, self.texels)] = False
        return self._all[unseen]

    @property
    def shown(self) -> np.ndarray:
        """Texels that `of` has light of: `texels`, then those `beyond`, (k + b,) int64."""
        return np.concatenate([self.texels, self.beyond])

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the light of texels that are `shown`, (k + b, c) float32.

        values: (s, c) or (s,), of the samples
        """
        chosen = (values if values.ndim == 2 else values[:, None])[self._chosen].astype(np.float64)
        means = self._sums(chosen) / self._total[:, None]
        if len(self._cut):
            planes = self._planes.through(chosen)
            rise = self._planes.rise(planes, self._off_centre, self._centroid[self._off_centre])
            off = means[self._cut[self._off_centre]] - rise
            means[self._cut[self._off_centre]] = self._planes.bounded(off, chosen, self._off_centre)
            means = np.concatenate([means, self._light_beyond(planes, chosen)])
            means = self._beyond.fitted(means, chosen)
        return means.astype(np.float32)

    def _light_beyond(self, planes: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Return the light of texels `beyond`, (b, c), from planes (t, 3, c) and chosen samples' (m, c)."""
        plane = planes[self._plane]
        light = plane[:, 0] + np.einsum("pd,pdc->pc", self._step, plane[:, 1:])
        light = self._planes.bounded(light, chosen, self._plane)
        number = np.bincount(self._target, minlength=len(self.beyond))
        return segment_sums(light, self._target, len(self.beyond)) / number[:, None]

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """Return sums of values of chosen samples, (m, c), times their weights, over each texel, (k, c)."""
        return segment_sums(values * self._weight[:, None], self._texel, len(self.texels))

    def _cut_texels(
        self, firsts: np.ndarray, weight: np.ndarray, resolution: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the numbers of texels that something cuts or hides a neighbour of, (t,) int64.

        The other arrays, int64, have the numbers among these of texels that it cuts, some of whose samples
        are hidden or were moved, and of those half of which at least is seen.

        firsts: the first sample of each texel, (a,) int64; weight: (s,) float32, of all samples
        """
        if not len(self.texels):
            return self._starts, self._starts, self._starts
        heaviest = np.maximum.reduceat(self._weight, self._starts)
        whole = self._weight > _MOVED * heaviest[self._texel]
        seen = np.bincount(self._texel, whole, len(self.texels))
        number = np.add.reduceat(weight > 0, firsts, dtype=np.int64)
        number = number[np.searchsorted(self._all, self.texels)]
        beside = seen < number
        for _, there, _ in steps_around(self.hidden, self.texels, resolution):
            beside[there] = True
        cut = np.flatnonzero(beside)
        off_centre = np.flatnonzero(seen[cut] < number[cut])
        return cut, off_centre, np.flatnonzero(2 * seen[cut] >= number[cut])


def _from_centres(position: np.ndarray, keys: np.ndarray, resolution: int) -> np.ndarray:
    """Return positions, (m, 2) texels, from the centres of the texels that they are in, (m, 2) float64."""
    row, column = np.divmod(keys % resolution**2, resolution)
    place: np.ndarray = position - np.stack([column, row], axis=1) - 0.5
    return place
