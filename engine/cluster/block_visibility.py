"""Visibility samples of a block of patches, in the memory of a worker's device."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download
from ..device.opencl import cl
from ..gather.gather_pass import GatherPass
from ..gather.half_radiance import HalfRadiance
from ..plan.choose_gather import caching_gather
from ..plan.visibility_trial import make_sampler, untried_visibility
from ..progress import finished
from ..scene.color import colors_of
from .patch_rows import SentRows, unpacked
from .patch_table import PatchTable
from .prepared_scene import prepared
from .radiance_exchange import MappedRadiance, write_rows
from .scene_payload import ScenePayload


class BlockVisibility:
    """Patches or patch groups of a block, which gather from all sources.

    views:  (m, 2) float32, see `RemoteDevices.views`
    bytes:  device memory of the samples
    """

    def __init__(self, shipment: ScenePayload, table: PatchTable, rows: SentRows) -> None:
        self._first, self._sources = unpacked(rows).first, prepared(shipment).sources(table)
        with self._sources.working():
            lookers = self._sources.part(rows)
            identity = make_sampler(lookers, untried_visibility(lookers.settings))
            self.bytes = identity.row_bytes * lookers.count
            sweep, compute = caching_gather(lookers, identity), lookers.opencl
            self._gather = GatherPass(compute, sweep, np.zeros((lookers.count, 3), np.float32))

            # The block owns the samples, so they are removed from the job's session cache.
            lookers.kept.clear()

            # The first gather computes the visibility.
            gathered = self._gathered(self._sources.darkness)
            seen = download(compute, self._gather.patches_seen, (lookers.count,))
            self.views = np.stack([gathered[:, 3], seen], axis=1)

    def gather(self, light: HalfRadiance | MappedRadiance) -> np.ndarray:
        """Gather from the radiance of all sources; return E/pi, (m, 3) float32."""
        with self._sources.working():
            return colors_of(self._gathered(self._sources.table(light)))

    def gather_to(self, light: MappedRadiance, path: str) -> None:
        """Gather from the radiance of all sources and write E/pi into the file of a `RadianceExchange`."""
        write_rows(path, self._first, self.gather(light), light.count)

    def gather_l1(self, light: HalfRadiance | MappedRadiance) -> np.ndarray:
        """Return the irradiance gradients (L1) for the same radiance, (m, 3, 3) float32."""
        with self._sources.working():
            self._gathered(self._sources.table(light))
            return np.asarray(finished(self._gather.gather_l1()))

    def _gathered(self, radiance: cl.Buffer) -> np.ndarray:
        return finished(self._gather.gather_from(radiance))
