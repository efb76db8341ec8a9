"""Hemicube integration by the paper's three OpenCL kernels: multiply, reduce row, reduce column."""

from __future__ import annotations

import moderngl
import numpy as np

from ..device.buffers import upload, upload_float4
from ..device.cl_device import ComputeDevice
from ..device.host_copy import HostCopy
from ..device.opencl import cl
from ..visibility.raster.tiles import Tiles
from ..visibility.views.hemicube import multiplier_map
from ..visibility.views.viewpoints import FRAME, frame_records


class HemicubeIntegrator:
    """Integrator of a texture array of hemicubes to one value each (paper, IV.C and V.C)."""

    def __init__(self, compute: ComputeDevice, tiles: Tiles, sky: np.ndarray) -> None:
        """Build the kernels for a layout of hemicubes.

        sky:  (h, w, 3) float32 radiance, equirectangular as `Scene.world`; used where alpha is 2
        """
        self._queue, self._tiles = compute.queue, tiles
        self._multiply, self._reduce_row, self._reduce_column = compute.kernels(
            (FRAME, "integrate.cl"), "multiply", "reduce_row", "reduce_column"
        )
        flags = cl.mem_flags
        multiplier = multiplier_map(tiles.n)
        self._multiplier = upload(compute, multiplier)
        texels = tiles.width * tiles.height * tiles.layers
        self._workspace = cl.Buffer(compute.context, flags.READ_WRITE, 16 * texels)
        self._rows = cl.Buffer(compute.context, flags.READ_WRITE, 16 * tiles.capacity * tiles.n)
        self._frames = cl.Buffer(compute.context, flags.READ_ONLY, FRAME.dtype.itemsize * tiles.capacity)
        self._sky_size = np.int32(sky.shape[1]), np.int32(sky.shape[0])
        self._sky = upload_float4(compute, sky.reshape(-1, 3))
        self._irradiance = cl.Buffer(compute.context, flags.WRITE_ONLY, 16 * tiles.capacity)
        sizes = compute.work_sizes
        self._multiply_group = self._multiply.group(*sizes.multiply)
        self._reduce_row_group = self._reduce_row.group(*sizes.reduce_row)
        self._reduce_column_group = self._reduce_column.group(min(tiles.n, *sizes.reduce_column))
        self._columns = cl.LocalMemory(16 * self._reduce_column_group[0])

    def integrate(self, hemicubes: cl.Buffer, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the fraction of front faces for the first m slots, (m, 4) float32.

        rgb is E/pi, the multiplier-weighted mean radiance above the horizon; a is the weighted mean of the
        front flag.
        hemicubes:  (layers, height, width, 4) float32 radiance and front flag
        frames:     (m, 4, 3) float32, the rows of `Viewpoints.frame` and the horizon
        """
        tiles, count = self._tiles, len(frames)
        padded = FRAME.array(tiles.capacity)
        padded[:count] = frame_records(frames)
        cl.enqueue_copy(self._queue, self._frames, padded)
        width, height, n = np.int32(tiles.width), np.int32(tiles.height), np.int32(tiles.n)
        layers = -(-count // tiles.per_layer)
        self._multiply(
            self._queue,
            _rounded_up((tiles.width, tiles.height, layers), self._multiply_group),
            self._multiply_group,
            hemicubes, self._multiplier, self._frames, self._workspace,
            self._sky, *self._sky_size, width, height, np.int32(layers), n,
        )  # fmt: skip
        hemicube_rows = layers * tiles.rows
        self._reduce_row(
            self._queue,
            _rounded_up((tiles.width, hemicube_rows), self._reduce_row_group),
            self._reduce_row_group,
            self._workspace, self._rows, width, np.int32(hemicube_rows), n,
        )  # fmt: skip
        self._reduce_column(
            self._queue,
            (hemicube_rows * tiles.columns * self._reduce_column_group[0],),
            self._reduce_column_group,
            self._rows, self._irradiance, n, self._columns,
        )  # fmt: skip
        result = np.empty((count, 4), np.float32)
        cl.enqueue_copy(self._queue, result, self._irradiance)
        return result


class CopiedIntegrator:
    """Integrator that copies drawn hemicubes to OpenCL through the host, for OpenGL without compute."""

    name = "opencl"

    def __init__(
        self, compute: ComputeDevice, tiles: Tiles, texture: moderngl.TextureArray, sky: np.ndarray
    ) -> None:
        self._copy = HostCopy(compute, texture)
        self._integrator = HemicubeIntegrator(compute, tiles, sky)

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the fraction of front faces for the first m slots, (m, 4) float32."""
        return self._integrator.integrate(self._copy.update(), frames)


def _rounded_up(size: tuple[int, ...], group: tuple[int, ...]) -> tuple[int, ...]:
    """Round a global size up to whole work groups."""
    return tuple(-(-length // step) * step for length, step in zip(size, group, strict=True))
