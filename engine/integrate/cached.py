"""Integrates identity hemicubes that are kept: every iteration is one streaming kernel."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ..device.compute import Compute
from ..hemicube import multiplier_map
from ..visibility.tiles import Tiles

#: Work items that add up one hemicube.
_GROUP = 64


def cache_bytes(tiles: Tiles, patches: int) -> int:
    """Return the memory that the identity hemicubes of so many patches take, bytes."""
    batches = -(-patches // tiles.capacity)
    return batches * tiles.width * tiles.height * tiles.layers * 4


class CachedIntegrator:
    """Keeps batches of identity hemicubes and sums what they see.

    emission  (n, 3) float32 radiance of each patch, seen on back faces
    sky       (h, w, 3) float32 radiance, equirectangular as `Scene.world`

    What does not depend on the patches' radiance, sky and backs, is summed only once.
    """

    def __init__(self, compute: Compute, tiles: Tiles, emission: np.ndarray, sky: np.ndarray) -> None:
        self._compute, self._queue, self._tiles = compute, compute.queue, tiles
        self._fixed, self._gather = compute.kernels(("hemicube.cl", "cached.cl"), "fixed", "gather")
        self._multiplier = self._constant(multiplier_map(tiles.n))
        self._sky = self._constant(_padded(sky.reshape(-1, 3)))
        self._sky_size = np.int32(sky.shape[1]), np.int32(sky.shape[0])
        self._emission = self._constant(_padded(emission, first=1))
        self._radiance = cl.Buffer(compute.context, cl.mem_flags.READ_ONLY, 16 * (len(emission) + 1))
        self._result = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 16 * tiles.capacity)
        self._frames = cl.Buffer(compute.context, cl.mem_flags.READ_ONLY, 4 * 16 * tiles.capacity)
        self._kept: list[tuple[cl.Buffer, cl.Buffer, int]] = []

    @property
    def batches(self) -> int:
        """Batches kept so far."""
        return len(self._kept)

    def set_radiance(self, radiance: np.ndarray) -> None:
        """Replace what the fronts of the patches send out: (n, 3) float32 radiance."""
        cl.enqueue_copy(self._queue, self._radiance, _padded(radiance, first=1))

    def keep(self, hemicubes: cl.Buffer, frames: np.ndarray) -> None:
        """Keep the identity hemicubes of a batch.

        hemicubes  (layers, height, width) uint32, see `visibility.targets`
        frames     (m, 4, 3) float32, from `Viewpoints.frames`
        """
        count = len(frames)
        padded = np.zeros((self._tiles.capacity, 4, 4), np.float32)
        padded[:count, :, :3] = frames
        cl.enqueue_copy(self._queue, self._frames, padded)
        cache = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, hemicubes.size)
        fixed = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 16 * count)
        self._fixed(
            self._queue,
            (_GROUP * count,),
            (_GROUP,),
            hemicubes, cache, self._multiplier, self._frames, self._emission, self._sky, *self._sky_size,
            fixed, *self._layout(), cl.LocalMemory(16 * _GROUP),
        )  # fmt: skip
        self._kept.append((cache, fixed, count))

    def gather(self, batch: int) -> np.ndarray:
        """Return E/pi and the share of front faces of a batch's patches, (m, 4) float32."""
        cache, fixed, count = self._kept[batch]
        self._gather(
            self._queue,
            (_GROUP * count,),
            (_GROUP,),
            cache, self._multiplier, self._radiance, fixed, self._result, *self._layout(),
            cl.LocalMemory(16 * _GROUP),
        )  # fmt: skip
        result = np.empty((count, 4), np.float32)
        cl.enqueue_copy(self._queue, result, self._result)
        return result

    def _layout(self) -> tuple[np.int32, np.int32, np.int32]:
        """Return columns and rows of tiles in a layer, and the width of a hemicube."""
        tiles = self._tiles
        return np.int32(tiles.columns), np.int32(tiles.rows), np.int32(tiles.n)

    def _constant(self, values: np.ndarray) -> cl.Buffer:
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._compute.context, flags, hostbuf=np.ascontiguousarray(values))


def _padded(values: np.ndarray, first: int = 0) -> np.ndarray:
    """Return (n, 3) float32 as (first + n, 4) float32, zeros around it."""
    padded = np.zeros((first + len(values), 4), np.float32)
    padded[first:, :3] = values
    return padded
