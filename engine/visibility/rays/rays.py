"""Rays through the triangles of a scene, traced by OpenCL."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ...device.buffers import upload
from ...device.compute import Compute, Source
from ...device.kernel import Kernel
from ...device.record import Record
from ...scene.cutouts import EXTENSIONS, Cutouts
from ...scene.triangles import Triangles
from .bvh import build_bvh
from .treetop import Treetop

#: What light passes through on the triangles of a material; see `Cutouts`.
CUTOUT = Record(
    "Cutout",
    ("int", "first", "pixel of the alpha map"),
    ("int", "width", "pixels, 0 without a map"),
    ("int", "height", "pixels"),
    ("int", "extension", "index into EXTENSIONS: how the map goes on beyond its borders"),
    ("int", "nearest", "1 if the nearest pixel is taken, 0 if four are interpolated"),
    ("float", "alpha", "a factor of the map"),
    ("float", "threshold", "of alpha, from which on all light is stopped; -1 for none"),
    ("int", "culled", "1 if the back is see-through"),
)


class Rays:
    """A scene's triangles on the OpenCL device, for kernels/rays.cl and kernels that go on from it.

    culled     (m,) bool of each material: its back is see-through
    arguments  what kernels take for RAYS_ARGUMENTS
    top        of the hierarchy, see `Bvh`
    """

    def __init__(
        self, compute: Compute, triangles: Triangles, cutouts: Cutouts, before: Treetop | None = None
    ) -> None:
        """Build the hierarchy; before: `top` of the same triangles where they were."""
        self._compute, self._queue = compute, compute.queue
        self.culled = cutouts.culled
        reach = float(np.abs(triangles.box).max())
        bvh = build_bvh(compute, triangles.positions, reach, top=before)
        self._options, self._stack, self.top = bvh.options, bvh.stack, bvh.top
        arrays: list[np.ndarray] = []
        if cutouts.needed:
            self._options = (*bvh.options, "-DCUTOUTS")
            arrays = [cutouts.alpha, _cutout_records(cutouts), cutouts.uvs, triangles.material]
        self.arguments = (bvh.nodes, bvh.triangles, *(upload(compute, array) for array in arrays))

    def kernels(self, source: Source, *names: str, options: tuple[str, ...] = ()) -> list[Kernel]:
        """Return kernels of a program whose main files include kernels/rays.cl, in the order of the names."""
        return self._compute.kernels((CUTOUT, *source), *names, options=(*self._options, *options))

    def hierarchy_of(self, positions: np.ndarray) -> tuple[cl.Buffer, cl.Buffer] | None:
        """Return nodes and packets of other triangles, (k, 3, 3) float32, for the same kernels.

        Metres from `Triangles.origin`. None if they are deeper than the kernels' stacks.
        """
        bvh = build_bvh(self._compute, positions, float(np.abs(positions).max()))
        return (bvh.nodes, bvh.triangles) if bvh.stack <= self._stack else None

    def cast(
        self, origins: np.ndarray, directions: np.ndarray, backs: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the nearest triangle along each ray; of those that show their backs if `backs`.

        origins, directions: (m, 3) float, metres from `Triangles.origin` along the world's axes. Returns
        triangle (m,) int32, -1 for none; front (m,) bool; distance (m,) float32 in lengths of the direction.
        """
        count = len(origins)
        hits, distances = np.empty((count, 2), np.int32), np.empty(count, np.float32)
        write = cl.mem_flags.WRITE_ONLY
        outputs = [cl.Buffer(self._compute.context, write, array.nbytes) for array in (hits, distances)]
        rays = self._rays(origins, directions, 0.0)
        (kernel,) = self.kernels(("cast.cl",), "cast")
        self.run(kernel, count, *rays, np.int32(backs), *outputs, np.int32(count))
        for array, buffer in zip((hits, distances), outputs, strict=True):
            cl.enqueue_copy(self._queue, array, buffer)
        return hits[:, 0], hits[:, 1] != 0, distances

    def transmittance(self, origins: np.ndarray, directions: np.ndarray, distance: float) -> np.ndarray:
        """Return the fraction of light, (m,) float32, that comes through along each ray up to a distance.

        origins, directions: (m, 3) float as for `cast`; distance in lengths of the direction.
        """
        through = np.empty(len(origins), np.float32)
        output = cl.Buffer(self._compute.context, cl.mem_flags.WRITE_ONLY, through.nbytes)
        rays = self._rays(origins, directions, distance)
        (kernel,) = self.kernels(("pass.cl",), "pass")
        self.run(kernel, len(origins), *rays, output, np.int32(len(origins)))
        cl.enqueue_copy(self._queue, through, output)
        return through

    def run(self, kernel: Kernel, items: int, *arguments: object) -> None:
        """Run a kernel that takes RAYS_ARGUMENTS, then `arguments`; see `Compute.run`."""
        self._compute.run(kernel, items, *self.arguments, *arguments)

    def _rays(self, origins: np.ndarray, directions: np.ndarray, distance: float) -> list[cl.Buffer]:
        """Upload rays; return their device buffers."""
        rays = (_four(origins), _four(directions, distance))
        return [upload(self._compute, array) for array in rays]


def _four(vectors: np.ndarray, last: float = 0.0) -> np.ndarray:
    """Return (..., 3) as (..., 4) float32."""
    padded = np.full((*vectors.shape[:-1], 4), last, np.float32)
    padded[..., :3] = vectors
    return padded


def _cutout_records(cutouts: Cutouts) -> np.ndarray:
    """Return the records of materials, (m,) CUTOUT."""
    first, width, height, code = cutouts.maps.T
    alpha, threshold = cutouts.constants.T
    return CUTOUT.array(
        len(cutouts.maps),
        first=first,
        width=width,
        height=height,
        extension=code % len(EXTENSIONS),
        nearest=code >= len(EXTENSIONS),
        alpha=alpha,
        threshold=threshold,
        culled=cutouts.culled,
    )
