"""Radiosity state in host memory, for host gathers."""

from __future__ import annotations

from collections.abc import Generator, Mapping

import numpy as np

from ..device.device_array import Values, colors_on_host
from ..errors import DeviceError
from ..gather.device_l1 import L1
from ..gather.interface import Gather
from ..gather.shader_gather import ShaderGather
from .radiosity_state import PLAIN_COLUMNS, IterationStep, IterationSums, SolvedSurfaces, StartLight, areas_of
from .reflected_radiance import reflected_light


class HostRadiosity:
    """Radiosity state (`radiosity_state.Radiosity`) in host memory; iterations are never sparse.

    emission:  (n, 3) float32, emitted radiance visible to the patches, W/(m^2 sr)
    columns:   number of iterates kept
    """

    sparse = False

    def __init__(
        self,
        gather: Gather,
        surfaces: SolvedSurfaces,
        emission: np.ndarray,
        start: StartLight,
        columns: int = PLAIN_COLUMNS,
    ) -> None:
        self._sides, self._fronts = surfaces.sides, surfaces.fronts
        self._gather, self._emission = gather, emission
        self._reflectance = colors_on_host(surfaces.reflectance)
        self._sent = emission
        self._areas = areas_of(surfaces.area).astype(np.float64)
        self._sampled_light = start.sampled
        self._irradiance = np.zeros_like(emission) if start.gathers_direct else start.sampled
        self.count, self.area, self.columns = len(emission), float(self._areas.sum()), columns
        self._gathered = np.zeros((columns, self.count, 4), np.float32)
        self._defects = np.zeros((columns, self.count, 3), np.float32)
        self._substitute: np.ndarray | None = None
        if start.reflected is not None:
            reflected = colors_on_host(start.reflected)
            if start.direct_comes_first:
                self._gathered[-1, :, :3] = reflected
            else:
                self._irradiance = reflected + colors_on_host(start.known_direct)

    @property
    def radiance(self) -> np.ndarray:
        """Exitant radiance of the patches, (n, 3) float32."""
        return self._emission + reflected_light(self._reflectance, self._irradiance, self._substitute)

    def set_substitutes(self, substitute: np.ndarray) -> None:
        """Replace the reflected light of each patch by its substitute's light, (n,) uint32."""
        self._substitute = substitute

    def sweep(self, column: int) -> Generator[float, None, None]:
        """Gather from the current radiance into a column of the ring; yield progress 0..1."""
        self._sent = self.radiance
        gathered = yield from self._gather.gather(self._sent)
        self._gathered[column] = gathered
        if self._sides is not None:
            self._gathered[column, :, :3] = self._sides.blend(gathered[:, :3])
        self._gathered[column, :, :3] += self._sampled_light
        self._defects[column] = self._gathered[column, :, :3] - self._irradiance

    def sums(self, newest: int, least: float) -> IterationSums:
        """Return the sums over all patches after an iteration, for error estimate and acceleration."""
        total = self._gathered[newest, :, :3].sum(axis=1, dtype=np.float64)
        weight = 1 / np.maximum(total, least) ** 2
        differences = self._defects.astype(np.float64) - self._defects[newest]
        differences[newest] = self._defects[newest]
        reflecting = self._areas[:, None] * self._reflectance
        return IterationSums(
            np.einsum("n,inc,jnc->ijc", weight, differences, differences, optimize=True),
            (reflecting * self._defects[newest]).sum(axis=0),
            (reflecting * self._gathered[newest, :, 3:]).sum(axis=0),
            float(total.mean()),
        )

    def mix(self, weights: np.ndarray, ambient: np.ndarray, least: float) -> IterationStep:
        """Compute the next irradiance from weighted columns and ambient light; return its change."""
        used = np.flatnonzero(weights.any(axis=1))
        following = sum(self._gathered[column, :, :3] * weights[column].astype(np.float32) for column in used)
        following = np.maximum(following + ambient.astype(np.float32), 0)
        step = following - self._irradiance
        change = np.abs(step).sum(axis=1, dtype=np.float64)
        relative = change / np.maximum(following.sum(axis=1, dtype=np.float64), least)
        flux = np.pi * (self._areas * (self._reflectance * step).sum(axis=1, dtype=np.float64)).sum()
        self._irradiance = following
        return IterationStep(float(change.mean()), float(relative[: self._fronts].mean()), float(flux))

    def balance(self, newest: int, emission: np.ndarray, direct: Values) -> None:
        """Return None: radiance hemicubes do not separate sky from patches."""

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32.

        Raises DeviceError for hemicubes that are summed at once, without directions.
        """
        if not isinstance(self._gather, ShaderGather):
            raise DeviceError("Directional maps need rays. Choose method Automatic, Cached or Stream.")
        return (yield from self._gather.gather_l1(self._sent))

    def state(self) -> dict[str, np.ndarray]:
        """Return a copy of all arrays that iterations have changed, by name."""
        arrays = {"gathered": self._gathered, "defects": self._defects, "irradiance": self._irradiance}
        return {name: array.copy() for name, array in arrays.items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the arrays that `state` returned."""
        self._gathered, self._defects = state["gathered"].copy(), state["defects"].copy()
        self._irradiance = state["irradiance"].copy()

    def iterate(self, column: int) -> np.ndarray:
        """Return the light gathered in a column, (n, 4) float32: E/pi, and fraction without back faces."""
        return self._gathered[column].copy()

    def mixed(self, column: int) -> np.ndarray:
        """Return E/pi for the next iteration and a column's fraction without back faces, (n, 4) float32."""
        return np.concatenate([self._irradiance, self._gathered[column, :, 3:]], axis=1)
