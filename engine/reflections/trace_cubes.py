"""Radiance of cube maps by rays from a point: light from surfaces, with their textures, and from the sky."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ..array_ops import to_float4
from ..device.buffers import download, lasting_buffer, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.time_slicer import sliced
from ..patches.patch_scene import PatchScene
from ..scene.cutouts import EXTENSIONS
from ..scene.model import Scene
from ..scene.texture import Texture
from ..visibility.rays.ray_tracer import RayTracer
from ..visibility.rays.receiver_records import RECEIVER
from .surface_colors import SurfaceColors, TexturedPart, texture_corners
from .visible_lights import VisibleLights

#: Rays along each axis of a texel (chosen).
SIDE = 2

#: Maximum number of samples in memory at once; each takes 64 bytes (chosen).
_BATCH = 1 << 21

#: Maximum size of the textures that stay on the device between cube maps, bytes (chosen).
_KEPT_TEXTURES = 1 << 29


@dataclass(frozen=True)
class PatchLight:
    """Light of the solved patches.

    light:  (n, 4) float32, E/pi of each patch and its weight in interpolation
    dark:   luminance below which a back face indicates the inside of geometry
    """

    light: np.ndarray
    dark: float


class CubeTracer:
    """Rays of cube maps through a scene with known light.

    scene:        scene with charts for all objects
    patch_scene:  its patches
    light:        light of the patches
    """

    def __init__(
        self,
        compute: ComputeDevice,
        rays: RayTracer,
        scene: Scene,
        patch_scene: PatchScene,
        light: PatchLight,
    ) -> None:
        self._compute, self._rays, self._scene, self._patch_scene = compute, rays, scene, patch_scene
        triangles = self._triangles = patch_scene.triangles
        self._colors = SurfaceColors(scene.materials)
        self._textures = dict[int, cl.Buffer]()
        self._kept_bytes = 0
        (self._trace,) = rays.kernels(
            (RECEIVER, "trace_cube.cl"), "trace_cube", options=("-DDITHERED", f"-DSIDE={SIDE}")
        )
        (self._shade,) = compute.kernels("shade_cube.cl", "add_textured")
        backs = None if triangles.backs is None else upload_once(compute, triangles.backs)
        arrays = triangles.atlas, patch_scene.texel_to_patch
        lookups = lasting_buffer(compute, triangles.uvs), *(upload_once(compute, array) for array in arrays)
        sky = np.atleast_3d(scene.world.astype(np.float32)).reshape(-1, 3)
        height, width = scene.world.shape[:2] if scene.world.ndim == 3 else (1, 1)
        padded = np.zeros((len(light.light) + 2, 4), np.float32)
        padded[1:-1] = light.light
        self._inputs = (
            *rays.arguments, *lookups, np.int32(patch_scene.patches.resolution), backs,
            upload_once(compute, triangles.material), upload(compute, self._colors.constants),
            np.int32(self._colors.count), upload(compute, padded), np.int32(triangles.solid),
            np.float32(light.dark), upload(compute, to_float4(sky)), np.int32(width), np.int32(height),
        )  # fmt: skip
        lights = [light.relative_to(triangles.origin) for light in scene.lights]
        self._lights = VisibleLights(rays, lights)
        self._size = int(triangles.mesh.size).bit_length()

    def faces(self, position: np.ndarray, size: int) -> Generator[float, None, tuple[np.ndarray, float]]:
        """Return the radiance around a point, (6, size, size, 3) float32; yield progress 0..1.

        The second value is the fraction of the rays that do not hit the inside of geometry.

        position:  (3,) float64, m, relative to `Scene.origin`
        """
        point = np.asarray(position, np.float64) - self._triangles.origin
        count, at_once = 6 * size * size, max(1, _BATCH // SIDE**2)
        parts, outside = [], 0.0
        for first in range(0, count, at_once):
            last = min(first + at_once, count)
            batch = _Batch(self._compute, SIDE**2 * first, SIDE**2 * last)
            for end in self._traced(point, size, batch):
                yield end / (SIDE**2 * count)
            outside += self._add_textured(batch)
            parts.append(batch.texels())
        faces = np.concatenate(parts).reshape(6, size, size, 3)
        self._lights.add(faces, point)
        return faces, outside / (SIDE**2 * count)

    def _traced(self, point: np.ndarray, size: int, batch: _Batch) -> Generator[int, None, None]:
        """Trace the samples of a batch; yield the end of each slice."""
        inputs = *self._inputs, to_float4(point[None])[0], np.int32(size), np.int32(batch.first)

        def launch(start: int, end: int) -> None:
            arguments = (*inputs, *batch.buffers, np.int32(start), np.int32(end))
            self._compute.run(self._trace, end - start, *arguments)

        slices = self._compute.slice_size(self._trace, self._size)
        yield from sliced(self._compute.queue, batch.first, batch.last, launch, slices)

    def _add_textured(self, batch: _Batch) -> float:
        """Add textured emission and reflection to a batch; return the number of `_Batch.outside`."""
        surfaces, triangles = batch.hits()
        hit = np.bincount(surfaces + 1, minlength=2 * self._colors.count + 1)[1:]
        for surface, parts in self._colors.textured.items():
            if hit[surface]:
                chosen = np.flatnonzero(surfaces == surface)
                self._shade_surface(batch, chosen, triangles[chosen], parts)
        return batch.outside()

    def _shade_surface(
        self, batch: _Batch, chosen: np.ndarray, triangles: np.ndarray, parts: Sequence[TexturedPart]
    ) -> None:
        """Add the textured emission and reflection of one surface to the samples that hit it.

        chosen:     (k,) int64, indices of the samples
        triangles:  (k,) int64, triangle that each sample hits
        """
        compute = self._compute
        hit, places = np.unique(triangles, return_inverse=True)
        rows = (upload(compute, values.astype(np.int32)) for values in (chosen, places))
        samples = *rows, batch.weights
        for part in parts:
            texture = part.texture
            corners = texture_corners(self._scene.meshes, self._triangles.mesh, hit, texture)
            height, width = texture.pixels.shape[:2]
            compute.run(
                self._shade, len(chosen), *samples, upload(compute, corners),
                self._pixels(texture), np.int32(width), np.int32(height),
                np.int32(EXTENSIONS.index(texture.extension)), np.int32(texture.smooth),
                np.int32(texture.srgb), to_float4(part.color[None])[0],
                batch.received if part.reflects else batch.through, batch.radiance, np.int32(len(chosen)),
            )  # fmt: skip
        compute.queue.finish()

    def _pixels(self, texture: Texture) -> cl.Buffer:
        """Return the pixels of a texture on the device; kept for the next cube map if there is memory."""
        key = id(texture.pixels)
        if key not in self._textures:
            pixels = upload(self._compute, texture.pixels)
            if self._kept_bytes + texture.pixels.nbytes > _KEPT_TEXTURES:
                return pixels
            self._kept_bytes += texture.pixels.nbytes
            self._textures[key] = pixels
        return self._textures[key]


class _Batch:
    """Consecutive samples of a cube map on the OpenCL device.

    first, last:  index of the first sample, and of the first one after the batch
    """

    def __init__(self, compute: ComputeDevice, first: int, last: int) -> None:
        self._compute, self.first, self.last = compute, first, last
        self.count = last - first
        flags = cl.mem_flags.READ_WRITE
        sizes = 8, 8, 16, 16, 16
        buffers = tuple(cl.Buffer(compute.context, flags, size * self.count) for size in sizes)
        self.hit_buffer, self.weights, self.received, self.through, self.radiance = self.buffers = buffers

    def hits(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface that each sample hits, -1 for the sky, and the triangle, two (k,) int32."""
        surfaces, triangles = download(self._compute, self.hit_buffer, (self.count, 2)).view(np.int32).T
        return surfaces, triangles

    def outside(self) -> float:
        """Return the number of samples that do not hit the inside of geometry."""
        return float(download(self._compute, self.received, (self.count, 4))[:, 3].sum(dtype=np.float64))

    def texels(self) -> np.ndarray:
        """Return the mean radiance of each texel, (k, 3) float32."""
        samples = download(self._compute, self.radiance, (self.count, 4))
        means: np.ndarray = samples.reshape(-1, SIDE**2, 4)[..., :3].mean(axis=1)
        return means
