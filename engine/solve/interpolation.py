"""Interpolation of irradiance from patch groups to patches by local linear regression."""

from __future__ import annotations

import numpy as np

from ..device.buffers import download, upload, upload_once
from ..device.device_rows import device_rows
from ..device.opencl import cl
from ..patches.patch_scene import PatchScene
from ..scene.color import channel_sum
from ..visibility.rays.ray_scene import RayScene
from .patch_groups import SOURCE

#: Range to which the local light is clamped before it scales the tolerance, as fractions of the mean.
_DARK, _BRIGHT = 0.05, 2.0


class Interpolation:
    """Planes fitted to the irradiance of the groups around each of n patches, by OpenCL.

    representative:  (m,) int64, representative patch of each group
    """

    def __init__(
        self,
        rays: RayScene,
        patch_scene: PatchScene,
        group: np.ndarray,
        representative: np.ndarray,
        width: int,
        opening: cl.Buffer | None,
        beside_backs: np.ndarray | None = None,
    ) -> None:
        """Store the group of each patch, (n,) int64, and the width of groups, texels; see `numbered`.

        opening:       float32 of each patch, see `openness`; None for no test of nearby geometry
        beside_backs:  (n,) bool, patches from which back faces with patches of their own are visible.
                       Irradiance varies quickly there, so no plane is fitted. None if there are none
        """
        self.representative, self._opening = representative, opening
        self._apart = None if beside_backs is None else beside_backs[representative]
        self._compute, self._receivers = rays.compute, rays.receivers
        self._interpolate, self._spread = self._compute.kernels(SOURCE, "interpolate", "spread")
        patches = patch_scene.patches
        numbers = group.astype(np.int32), representative.astype(np.int32)
        self._count = len(patches)
        self._where = (
            device_rows(self._compute, patch_scene.entries),
            np.int32(patches.resolution), np.int32(width),
            *(upload_once(self._compute, array) for array in (patches.atlas, patches.texel)),
            *(upload(self._compute, array) for array in numbers),
        )  # fmt: skip

    def fit(
        self, layers: list[np.ndarray], beside: np.ndarray, tolerance: float, lowest: float = 0.0
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Fit planes; return the light of each patch, (n, 4) float32 per layer, and a mask of good fits.

        A patch whose openness differs from the openness of the groups does not fit either.

        layers:     (m, 4) float32 each, of the groups: E/pi, and fraction of the hemisphere without back
                    faces; the first layer decides the fit
        beside:     (n,) float32, other light of each patch, E/pi, sum of the channels
        tolerance:  maximum residual of a plane, as a fraction of all light of the patch
        lowest:     lower bound of the light; minus infinity for signed values
        """
        compute, count = self._compute, self._count
        write = cl.mem_flags.WRITE_ONLY
        values = cl.Buffer(compute.context, write, 16 * count * len(layers))
        fits = cl.Buffer(compute.context, write, 4 * count)
        mean = channel_sum(layers[0][:, :3]).mean() + beside.mean()
        light = np.stack(layers)
        if self._apart is not None:
            light[0, self._apart, 3] = 0
        compute.run(
            self._interpolate, count, *self._where, self._receivers,
            upload(compute, light), np.int32(len(layers)), np.int32(len(layers[0])),
            upload(compute, beside), self._opening,
            *map(np.float32, (_DARK * mean, _BRIGHT * mean, tolerance, lowest)),
            values, fits, np.int32(count),
        )  # fmt: skip
        fitting = np.empty(count, np.int32)
        cl.enqueue_copy(compute.queue, fitting, fits)
        return list(download(compute, values, (len(layers), count, 4))), fitting != 0

    def put_back(
        self, layers: list[np.ndarray], values: list[np.ndarray], fits: np.ndarray, lowest: float = 0.0
    ) -> None:
        """Add a correction for curvature to interpolated light (twicing, Tukey 1977).

        A plane underestimates a maximum and overestimates a minimum of the light. The residuals of the groups
        at their representatives are smoothed with the same weights and added.

        layers:  (m, 4) float32 each, of the groups; see `fit`
        values:  (n, 4) float32 each, of the patches, from `fit`; changed in place
        fits:    (n,) bool, True for interpolated patches
        lowest:  lower bound of the light; see `fit`
        """
        compute, count, representative = self._compute, self._count, self.representative
        rest = np.stack([layer - value[representative] for layer, value in zip(layers, values, strict=True)])
        rest[:, ~fits[representative]] = 0
        rest[..., 3] = 0
        light, fitting = upload(compute, layers[0]), upload(compute, fits.astype(np.int32))
        chosen = upload(compute, representative.astype(np.int32))
        smooth = self._spread_over(
            light, fitting, chosen, upload(compute, rest), len(layers), len(representative)
        )
        found = self._spread_over(light, fitting, None, smooth, len(layers), count)
        for value, more in zip(values, download(compute, found, (len(layers), count, 4)), strict=True):
            np.maximum(value + more, lowest, out=value)

    def _spread_over(
        self,
        light: cl.Buffer,
        fits: cl.Buffer,
        chosen: cl.Buffer | None,
        values: cl.Buffer,
        layers: int,
        count: int,
    ) -> cl.Buffer:
        """Interpolate group values to chosen patches, or to all that fit: float4 of each, layer by layer."""
        compute = self._compute
        spread = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count * layers)
        compute.run(
            self._spread, count, *self._where, self._receivers, light, fits, chosen, values,
            np.int32(layers), np.int32(len(self.representative)), spread, np.int32(count),
        )  # fmt: skip
        return spread
