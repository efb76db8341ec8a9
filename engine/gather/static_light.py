"""The light that no bounce changes: of the surroundings, where kept samples meet them, and of backs."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ..device.buffers import upload, zeros
from ..device.compute import Compute
from ..device.slices import sliced
from ..settings import Settings
from ..visibility.identity import Sampling, Surroundings, directional_options, identity_options
from ..visibility.rays.receivers import RECEIVER_SOURCE
from ..visibility.views.directions import r2_sequence
from ..visibility.views.hemicube import rotation_salt
from .kept_samples import Backs, Rows


class StaticLight:
    """The static light of `count` patches, summed up from their samples.

    receivers  records of the patches, see `RayScene.receivers`
    light      float4 of each patch: E/pi, and the fraction of the view that is no back
    l1         3 float4 of each patch, x, y and z, see kernels/tilt.cl; None unless the settings ask for it
    """

    def __init__(
        self,
        compute: Compute,
        sampling: Sampling,
        surroundings: Surroundings,
        receivers: cl.Buffer,
        settings: Settings,
        count: int,
    ) -> None:
        self._compute, self._surroundings, self._receivers = compute, surroundings, receivers
        options = (*identity_options(sampling.sample_bytes), *directional_options(settings))
        options += ("-DCOSINE",) if sampling.even else ()
        source = (*RECEIVER_SOURCE, "hemicube.cl", "tilt.cl", "identity.cl", "views.cl", "static_light.cl")
        (self._add,) = compute.kernels(source, "add_surroundings", options=options)
        pattern = r2_sequence(sampling.samples) if sampling.multiplier is None else sampling.multiplier
        self._samples = (
            upload(compute, pattern), np.int32(sampling.samples), np.int32(settings.hemicube),
            np.uint32(rotation_salt(settings.seed)), np.int32(settings.rotate),
        )  # fmt: skip
        self.light = zeros(compute, 16 * count)
        self.l1 = zeros(compute, 48 * count) if settings.directional else None

    def sum_up(self, rows: Rows, backs: Backs) -> None:
        """Sum up the static light of the patches whose rows these are."""
        if self._surroundings.dark:
            self._take(rows, backs)
            return
        sky = self._surroundings
        (group,) = self._add.group(self._compute.group)

        def launch(start: int, end: int) -> None:
            self._add(
                self._compute.queue, (group * (end - start),), (group,),
                rows.cache, np.int32(rows.first), sky.outside, self._receivers, *self._samples,
                sky.sky, sky.width, sky.height, np.int32(start),
                backs.light, backs.l1, self.light, self.l1, cl.LocalMemory(16 * group),
            )  # fmt: skip

        for _ in sliced(self._compute.queue, rows.first, rows.last, launch):
            pass

    def _take(self, rows: Rows, backs: Backs) -> None:
        """Take the light of backs: the surroundings are black."""
        for size, source, target in ((16, backs.light, self.light), (48, backs.l1, self.l1)):
            if source is not None and target is not None:
                cl.enqueue_copy(
                    self._compute.queue, target, source, byte_count=size * (rows.last - rows.first),
                    src_offset=size * rows.first, dst_offset=size * rows.first,
                )  # fmt: skip
