"""Radiosity state on the OpenCL device: iterations read and write irradiance there."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import fields
from functools import cached_property

import numpy as np

from ..device.buffers import download, unfilled, upload, upload_float4_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import KEPT_PART, DeviceArray, Values, float4_on_device, float4_once
from ..device.opencl import cl
from ..gather.device_l1 import L1
from ..gather.interface import DeviceGather
from ..patches.sides import Sides
from .radiosity_state import (
    FluxSums,
    IterationStep,
    IterationSums,
    SolvedSurfaces,
    StartLight,
    areas_of,
    wait_for,
)

#: Work items of reductions, and items per group of the final sum, for a GPU and for a CPU. A GPU needs many
#: items to hide memory latency, and many items keep float32 sums accurate. Powers of two are multiples of
#: every work group.
_ITEMS, _ADDING = (16384, 512), (256, 1)

#: Floats per patch in buffers of irradiance.
_STRIDE = 4

#: Lower bound of the total area, m^2, since a scene of slivers may have area 0.
_LEAST_AREA = 1e-30


class DeviceRadiosity:
    """Radiosity state (`radiosity_state.Radiosity`) on the OpenCL device.

    emission:      float4 by patch + 1 on the device, radiance visible to the patches; entry 0 is black
    start:         with sampled light that is blended already for translucent surfaces
    columns:       number of iterates kept
    sparse:        True for gathers that support sparse iterations
    radiance:      float4 by patch + 1; entry 0 and the last (background) are black
    patches_seen:  float of each patch: fraction of its hemisphere covered by other patches
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sweep: DeviceGather,
        surfaces: SolvedSurfaces,
        emission: cl.Buffer,
        start: StartLight,
        columns: int,
        sparse: bool = False,
    ) -> None:
        self.count = len(surfaces.reflectance)
        self._sides = None if surfaces.sides is None else _Sides(compute, surfaces.sides)
        self._compute, self._queue, self._sweep, self.sparse = compute, compute.queue, sweep, sparse
        self._fronts = self.count if surfaces.fronts is None else surfaces.fronts
        self.columns, self._pairs = columns, np.triu_indices(columns)
        self._products, self._mix, self._balance, self._add_up = compute.kernels(
            "iterate_sums.cl", "iterate_products", "mix_iterates", "balance", "add_up",
            options=(f"-DCOLUMNS={columns}",),
        )  # fmt: skip
        (self._send_out,) = compute.kernels("exitant_radiance.cl", "exitant_radiance")
        self._emission, self._reflectance = emission, float4_once(compute, surfaces.reflectance)

        # The first sums need areas, so the first iteration does not wait for the thread that computes them.
        self._areas = surfaces.area
        self._substitute: cl.Buffer | None = None
        self._set_start(start)
        kind = int(compute.processor)
        self._items, self._adding = _ITEMS[kind], self._add_up.group(_ADDING[kind])[0]

        # Number of sums of iterate_sums.cl: one per pair of columns and three more. The flux balance has
        # fewer.
        self._numbers = len(self._pairs[0]) + 3
        self._sums, self._totals = (
            unfilled(compute, 16 * self._numbers * items) for items in (self._items, 1)
        )
        self._mixture = np.zeros((columns + 1, 4), np.float32)
        self._weights = upload(compute, self._mixture)

    def _set_start(self, start: StartLight) -> None:
        """Create the buffers that iterations change, with the light before the first iteration."""
        compute, size = self._compute, 16 * self.count
        self._sampled_light = upload_float4_once(compute, start.sampled)
        self.patches_seen = zeros(compute, 4 * self.count)
        self._gathered, self._defects = (zeros(compute, size * self.columns) for _ in range(2))
        first = None if start.gathers_direct else self._sampled_light
        if start.reflected is not None:
            held = float4_on_device(compute, start.reflected)
            if start.direct_comes_first:
                cl.enqueue_copy(self._queue, self._gathered, held, dst_offset=size * (self.columns - 1))
            else:
                first = DeviceArray(compute, held, self.count, _STRIDE).plus(start.known_direct).buffer
        self._irradiance = zeros(compute, size) if first is None else unfilled(compute, size)
        if first is not None:
            cl.enqueue_copy(self._queue, self._irradiance, first)
        self.radiance = zeros(compute, size + 32)
        self._make_radiance()

    @cached_property
    def area(self) -> float:
        """Total area, m^2."""
        return float(areas_of(self._areas).sum(dtype=np.float64))

    @cached_property
    def _area(self) -> cl.Buffer:
        """Fractions of the total area; bright light times large areas would overflow float32."""
        area = areas_of(self._areas)
        return self._compute.shared.of(
            area, "fractions", lambda: upload(self._compute, _fractions(area, self.area))
        )

    def outputs(self, column: int) -> tuple:
        """Return the arguments with which gather.cl writes an iterate to a column of the ring."""
        ring = (self._gathered, self._defects, np.int32(column), np.int32(self.count))
        return (self._sampled_light, self._irradiance, *ring)

    def sweep(self, column: int) -> Generator[float, None, None]:
        """Gather from the current radiance into a column of the ring; yield progress 0..1."""
        yield from self._sweep.gather(self, column)
        if self._sides is not None:
            self._sides.blend(self.outputs(column))
        yield from wait_for(self._areas)

    def sums(self, newest: int, least: float) -> IterationSums:
        """Return the sums over all patches after an iteration, for error estimate and acceleration."""
        self._compute.run(
            self._products, self._items,
            self._gathered, self._defects, np.int32(newest), self._reflectance, self._area,
            self.patches_seen, np.float32(least), np.int32(self.count), self._sums,
        )  # fmt: skip
        sums, (rows, columns) = self._read_sums(self._numbers), self._pairs
        products = np.zeros((self.columns, self.columns, 3))
        products[rows, columns] = products[columns, rows] = sums[:-3]
        return IterationSums(products, sums[-3] * self.area, sums[-2] * self.area, sums[-1, 0] / self.count)

    def mix(self, weights: np.ndarray, ambient: np.ndarray, least: float) -> IterationStep:
        """Set the irradiance to a weighted sum of earlier iterates plus an ambient term; return the change.

        weights:  factor of each stored iterate, for each channel
        ambient:  E/pi added to all patches, (3,)
        least:    minimum E/pi in error weights
        """
        self._mixture[:-1, :3], self._mixture[-1, :3] = weights, ambient
        self._mixture[:-1, 3] = weights[:, 0]
        cl.enqueue_copy(self._queue, self._weights, self._mixture, is_blocking=False)
        self._compute.run(
            self._mix, self._items,
            self._gathered, self._weights, self.patches_seen,
            self._reflectance, self._area, np.float32(least), np.int32(self._fronts), np.int32(self.count),
            self._irradiance, self._sums,
        )  # fmt: skip
        self._make_radiance()
        change, relative, flux = self._read_sums(1)[0]
        return IterationStep(change / self.count, relative / self._fronts, np.pi * flux * self.area)

    def set_substitutes(self, substitute: np.ndarray) -> None:
        """Replace the reflected light of each patch by its substitute's light, (n,) uint32."""
        self._substitute = upload(self._compute, substitute.astype(np.uint32, copy=False))
        self._make_radiance()

    def balance(self, newest: int, emission: np.ndarray, direct: Values) -> FluxSums:
        """Return the flux balance after an iteration, summed on the device."""
        emitted = upload_float4_once(self._compute, emission, first=1)
        first = (
            float4_on_device(self._compute, direct)
            if isinstance(direct, DeviceArray)
            else upload_float4_once(self._compute, direct)
        )
        self._compute.run(
            self._balance, self._items,
            self._gathered, self._defects, np.int32(newest), self._reflectance, emitted, first, self._area,
            self.patches_seen, np.int32(self.count), self._sums,
        )  # fmt: skip
        return FluxSums(*(self._read_sums(len(fields(FluxSums))) * self.area))

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        return (yield from self._sweep.gather_l1())

    def state(self) -> dict[str, np.ndarray]:
        """Return a copy of all arrays that iterations have changed, by name."""
        return {
            name: download(self._compute, buffer, (buffer.size // 4,))
            for name, buffer in self._state_buffers().items()
        }

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the arrays that `state` returned."""
        for name, buffer in self._state_buffers().items():
            cl.enqueue_copy(self._queue, buffer, state[name])

    def iterate(self, column: int) -> Values:
        """Return column `column` of the ring, float4 of each patch: E/pi, fraction without back faces."""
        return self._light(self._gathered, 16 * self.count * column)

    def mixed(self, column: int) -> Values:
        """Return E/pi for the next iteration and a column's fraction without back faces, (n, 4) float32."""
        return self._light(self._irradiance, 0)

    def _light(self, buffer: cl.Buffer, first: int) -> Values:
        """Return a copy of the float4 of all patches that start at byte `first` of a buffer."""
        compute, size = self._compute, 16 * self.count
        if size > compute.device.global_mem_size // KEPT_PART:
            return download(compute, buffer, (self.count, 4), first)
        light = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_copy(self._queue, light, buffer, src_offset=first, byte_count=size)
        return DeviceArray(compute, light, self.count, _STRIDE)

    def _state_buffers(self) -> dict[str, cl.Buffer]:
        """Return the buffers that an iteration changes and the next iteration reads, by name."""
        return {
            "gathered": self._gathered,
            "defects": self._defects,
            "irradiance": self._irradiance,
            "radiance": self.radiance,
            "patches_seen": self.patches_seen,
        }

    def _make_radiance(self) -> None:
        """Compute the exitant radiance of the current irradiance."""
        self._compute.run(
            self._send_out, self.count, self._emission, self._reflectance, self._irradiance,
            np.int32(_STRIDE), self._substitute, self.radiance, np.int32(self.count),
        )  # fmt: skip

    def _read_sums(self, numbers: int) -> np.ndarray:
        """Add the partial sums of all work items; return `numbers` vectors of three sums, float64."""
        self._add_up(
            self._queue, (self._adding * numbers,), (self._adding,),
            self._sums, np.int32(self._items), self._totals, cl.LocalMemory(16 * self._adding),
        )  # fmt: skip
        return download(self._compute, self._totals, (numbers, 4))[:, :3].astype(np.float64)


class _Sides:
    """Pairs of patches on both sides of translucent surfaces."""

    def __init__(self, compute: ComputeDevice, sides: Sides) -> None:
        self._compute, self._count = compute, len(sides.pairs)
        own = np.zeros((self._count, 2, 4), np.float32)
        own[:, :, :3] = sides.own
        self._arguments = upload(compute, sides.pairs.astype(np.uint32)), upload(compute, own)
        (self._kernel,) = compute.kernels("sides.cl", "blend_sides")

    def blend(self, outputs: tuple) -> None:
        """Blend the gathered light of both sides of translucent patches in `DeviceRadiosity.outputs`."""
        count = np.int32(self._count)
        self._compute.run(self._kernel, self._count, *self._arguments, *outputs, count)


def _fractions(area: np.ndarray, whole: float) -> np.ndarray:
    """Divide areas, (n,), by `whole`; return float32."""
    fractions: np.ndarray = (area / max(whole, _LEAST_AREA)).astype(np.float32, copy=False)
    return fractions
