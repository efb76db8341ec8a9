"""The light of all patches on the OpenCL device: a sweep reads it there and leaves it there."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np
import pyopencl as cl

from ..anderson import COLUMNS
from ..device.compute import Compute
from ..solve import Step, Sums
from ..visibility.identity import with_fourth

#: Work items of the kernels that sum over patches, and of a group that adds their sums up, on a GPU.
_ITEMS, _ADDING = 2048, 256

#: float4 sums of `products` in kernels/solve.cl.
_PRODUCTS = COLUMNS * (COLUMNS + 1) // 2
_SUMS = _PRODUCTS + 3


class Light(Protocol):
    """What a sweep reads and writes on the device.

    count         patches that gather
    radiance      float4 of each patch that is seen + 1; entry 0 is black
    patches_seen  float of each patch: the share of its view that patches take
    """

    count: int
    radiance: cl.Buffer
    patches_seen: cl.Buffer

    def outputs(self, column: int) -> tuple:
        """Return what the kernels of kernels/gather.cl take to write a column of the ring."""


class Sweep(Protocol):
    """How patches gather on the device."""

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather from `light.radiance` into a column of its ring; yield the fraction done."""


class DeviceRadiosity:
    """See `solve.Radiosity`; parameters as of `host_radiosity.HostRadiosity`.

    radiance      float4 of each patch + 1; entry 0 is black
    patches_seen  float of each patch: the share of its view that other patches take
    """

    def __init__(
        self,
        compute: Compute,
        sweep: Sweep,
        reflectance: np.ndarray,
        emission: np.ndarray,
        area: np.ndarray,
        lights: np.ndarray,
        glowing: bool,
    ) -> None:
        self._compute, self._queue, self._sweep = compute, compute.queue, sweep
        self.count, self.area = len(emission), float(area.sum(dtype=np.float64))
        start = np.zeros_like(emission) if glowing else lights
        self._lights, self._irradiance = self._upload(with_fourth(lights)), self._upload(with_fourth(start))
        self._emission = self._upload(with_fourth(emission, first=1))
        self.radiance = self._upload(with_fourth(emission + reflectance * start, first=1))
        self._reflectance = self._upload(with_fourth(reflectance))
        self._area = self._upload(area.astype(np.float32))
        self.patches_seen = self._zeros(4 * self.count)
        self._gathered, self._defects = (self._zeros(16 * self.count * COLUMNS) for _ in range(2))
        names = ("products", "mix_iterates", "add_up")
        options = (f"-DCOLUMNS={COLUMNS}",)
        self._products, self._mix, self._add_up = compute.kernels("solve.cl", *names, options=options)
        gpu = compute.group > 1
        self._items: int = _ITEMS if gpu else compute.device.max_compute_units
        self._adding = _ADDING if gpu else 1
        self._sums, self._totals = self._zeros(16 * _SUMS * self._items), self._zeros(16 * _SUMS)
        self._weights = self._zeros(16 * COLUMNS)

    def outputs(self, column: int) -> tuple:
        """Return what the kernels of kernels/gather.cl take to write a column of the ring."""
        ring = (self._gathered, self._defects, np.int32(column), np.int32(self.count))
        return (self._lights, self._irradiance, *ring)

    def sweep(self, column: int) -> Generator[float, None, None]:
        """Gather from the current radiance into a column of the ring; yield the fraction done."""
        yield from self._sweep.gather(self, column)

    def sums(self, newest: int, least: float) -> Sums:
        """Return the sums after a sweep; see `solve.Radiosity.sums`."""
        self._products(
            self._queue, (self._items,), None,
            self._gathered, self._defects, np.int32(newest), self._reflectance, self._area,
            self.patches_seen, np.float32(least), np.int32(self.count), self._sums,
        )  # fmt: skip
        sums = self._read_sums(_SUMS)
        products = np.zeros((COLUMNS, COLUMNS, 3))
        rows, columns = np.triu_indices(COLUMNS)
        products[rows, columns] = products[columns, rows] = sums[:_PRODUCTS]
        total = sums[_PRODUCTS + 2, 0] / self.count
        return Sums(products, sums[_PRODUCTS], sums[_PRODUCTS + 1], total)

    def mix(self, weights: np.ndarray, ambient: np.ndarray, least: float) -> Step:
        """Make the next irradiance; see `solve.Radiosity.mix`."""
        cl.enqueue_copy(self._queue, self._weights, with_fourth(weights))
        self._mix(
            self._queue, (self._items,), None,
            self._gathered, self._weights, cl.cltypes.make_float4(*ambient, 0), self.patches_seen,
            self._reflectance, self._emission, self._area, np.float32(least), np.int32(self.count),
            self._irradiance, self.radiance, self._sums,
        )  # fmt: skip
        change, relative, flux = self._read_sums(1)[0]
        return Step(change / self.count, relative / self.count, np.pi * flux)

    def iterate(self, column: int) -> np.ndarray:
        """Return E/pi and the share that is no back, (n, 4) float32, of a column."""
        gathered = np.empty((self.count, 4), np.float32)
        cl.enqueue_copy(self._queue, gathered, self._gathered, src_offset=column * gathered.nbytes)
        return gathered

    def _read_sums(self, numbers: int) -> np.ndarray:
        """Return the sums of all work items together, (numbers, 3) float64."""
        self._add_up(
            self._queue, (self._adding * numbers,), (self._adding,),
            self._sums, np.int32(self._items), self._totals, cl.LocalMemory(16 * self._adding),
        )  # fmt: skip
        totals = np.empty((numbers, 4), np.float32)
        cl.enqueue_copy(self._queue, totals, self._totals)
        return totals[:, :3].astype(np.float64)

    def _upload(self, values: np.ndarray) -> cl.Buffer:
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._compute.context, flags, hostbuf=np.ascontiguousarray(values))

    def _zeros(self, size: int) -> cl.Buffer:
        buffer = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_fill_buffer(self._queue, buffer, np.zeros(1, np.float32), 0, size)
        return buffer
