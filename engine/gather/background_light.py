"""Background light: sky and emissive back faces, constant over all iterations."""

from __future__ import annotations

from collections.abc import Generator

from ..device.buffers import unfilled
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..settings import Settings
from ..visibility.sampler import Background, SampleLayout
from ..visibility.views.directions import r2_sequence
from .row_kernel import RowKernel
from .visibility_cache import BackfaceLight, SampleRows


class BackgroundLight:
    """Background light of `count` patches, summed over their cached visibility samples.

    receivers:  records of the patches, see `RayScene.receivers`
    light:      float4 of each patch: E/pi in rgb; in a the fraction of the hemisphere without back faces
    l1:         3 float4 of each patch, axes x, y and z, see irradiance_l1.cl; None without directional maps
    complete:   True once all patches are summed; set by the caller that has summed all rows
    """

    complete = False

    def __init__(
        self,
        compute: ComputeDevice,
        sampling: SampleLayout,
        background: Background,
        receivers: cl.Buffer,
        settings: Settings,
        count: int,
    ) -> None:
        self._compute, self._background = compute, background
        self._add = RowKernel(
            compute=compute,
            sampling=sampling,
            receivers=receivers,
            settings=settings,
            pattern=r2_sequence(sampling.samples),
            name="add_background",
            file="background_light.cl",
        )
        self.light = unfilled(compute, 16 * count)
        self.l1 = unfilled(compute, 48 * count) if settings.directional else None

    def sum_up(self, rows: SampleRows, backs: BackfaceLight) -> Generator[float, None, None]:
        """Sum the background light over the samples of the patches in these rows; yield progress 0..1."""
        if self._background.dark:
            self._take(rows, backs)
            return
        sky, results = self._background, (self.light, self.l1)
        seen = sky.outside, *sky.sky_arguments
        yield from self._add.run(rows, *seen, backs.light, backs.l1, *results)

    def _take(self, rows: SampleRows, backs: BackfaceLight) -> None:
        """Copy the light of back faces as the result, since the background is black."""
        for size, source, target in ((16, backs.light, self.light), (48, backs.l1, self.l1)):
            if source is not None and target is not None:
                cl.enqueue_copy(
                    self._compute.queue, target, source, byte_count=size * (rows.last - rows.first),
                    src_offset=size * rows.first, dst_offset=size * rows.first,
                )  # fmt: skip
