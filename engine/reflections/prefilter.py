"""GGX prefilter of cube maps: one level per roughness, for the split-sum approximation of specular light."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..array_ops import to_float4
from ..device.buffers import download, upload
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.time_slicer import sliced
from ..progress import run_as_fraction
from ..visibility.rays.receiver_records import RECEIVER
from .cube_faces import halved, mean_radiance, with_border

#: Width of the faces of the last level: its lobe is as wide as a hemisphere (chosen).
SMALLEST = 8

#: Samples of a texel of the first filtered level, and maximum number. Each level has four times as many as
#: the one before, for the same work: a light of 6 degrees is wrong by at most 8 % of its peak (measured).
_SAMPLES, _MOST_SAMPLES = 512, 8192

#: Levels by which samples are read coarser than their solid angle, so that they overlap (Krivanek and
#: Colbert, "Real-time Shading with Filtered Importance Sampling", 2008).
_COARSER = 1.0

#: Golden ratio; 0, 1, 2, ... divided by it, as fractions of a turn, are evenly spread angles.
_GOLDEN = (1 + np.sqrt(5)) / 2


def level_sizes(size: int) -> list[int]:
    """Return the face width of each level of a cube map of a width, a power of two."""
    sizes = [size]
    while sizes[-1] > SMALLEST:
        sizes.append(sizes[-1] // 2)
    return sizes


def roughness_of(level: int, levels: int) -> float:
    """Return the perceptual roughness of a level, the square root of GGX alpha: 0, then even steps to 1."""
    return level / (levels - 1)


def prefiltered(compute: ComputeDevice, faces: np.ndarray) -> Generator[float, None, list[np.ndarray]]:
    """Return all levels of a cube map, (6, s, s, 3) float32 each, the first unchanged; yield progress 0..1.

    The lobe is symmetric in the direction of the surface and of the light, so that every level has the mean
    radiance of the first; the small error of the samples is scaled away.

    faces:  (6, size, size, 3) float32, size a power of two above SMALLEST
    """
    sizes, mean = level_sizes(faces.shape[1]), mean_radiance(faces)
    texels = [6 * size * size for size in sizes]
    total, done = sum(texels[1:]), 0
    pyramid, made = _Pyramid(compute, faces), [faces]
    for level, size in enumerate(sizes[1:], 1):
        span = done / total, (done + texels[level]) / total
        samples = min(_SAMPLES << 2 * (level - 1), _MOST_SAMPLES)
        filtering = pyramid.filtered(size, roughness_of(level, len(sizes)), samples)
        filtered = yield from run_as_fraction(*span, filtering)
        found = mean_radiance(filtered)
        factor = np.divide(mean, found, out=np.ones(3), where=found > 0)
        made.append(filtered * factor.astype(np.float32))
        done += texels[level]
    return made


class _Pyramid:
    """Mip pyramid of a cube map on the OpenCL device."""

    def __init__(self, compute: ComputeDevice, faces: np.ndarray) -> None:
        self._compute, self._size = compute, faces.shape[1]
        mips = [faces]
        while mips[-1].shape[1] > 1:
            mips.append(halved(mips[-1]))
        bordered = [with_border(mip) for mip in mips]
        counts = [mip[..., 0].size for mip in bordered]
        firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        levels = np.stack([firsts, [mip.shape[1] for mip in mips]], axis=1).astype(np.int32)
        texels = np.concatenate([mip.reshape(-1, 3) for mip in bordered])
        self._count = len(mips)
        self._buffers = upload(compute, to_float4(texels)), upload(compute, levels)
        (self._kernel,) = compute.kernels((RECEIVER, "prefilter_cube.cl"), "prefilter_cube")

    def filtered(self, size: int, roughness: float, count: int) -> Generator[float, None, np.ndarray]:
        """Return the faces of a level, (6, size, size, 3) float32; yield progress 0..1.

        count:  samples of a texel
        """
        compute, texels = self._compute, 6 * size * size
        samples = lobe_samples(roughness, count, self._size, self._count)
        output = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * texels)
        inputs = (
            *self._buffers, np.int32(self._count), upload(compute, samples), np.int32(len(samples)),
            np.int32(size), output,
        )  # fmt: skip

        def launch(start: int, end: int) -> None:
            compute.run(self._kernel, end - start, *inputs, np.int32(start), np.int32(end))

        for end in sliced(compute.queue, 0, texels, launch, compute.slice_size(self._kernel, count)):
            yield end / texels
        wide = download(compute, output, (texels, 4))
        return np.ascontiguousarray(wide[:, :3]).reshape(6, size, size, 3)


def lobe_samples(roughness: float, count: int, size: int, levels: int) -> np.ndarray:
    """Return samples of the GGX lobe around z, (k, 4) float32: direction, and level of the mip pyramid.

    The half vectors have the density D(h) cos; their reflections count with the cosine of the light, z (Karis
    2013). A sample is read at the level whose texels have its solid angle.

    count:   number of half vectors; reflections below the surface are left out
    size:    face width of the first level of the pyramid
    levels:  number of its levels
    """
    alpha = roughness**2
    u = (np.arange(count) + 0.5) / count
    phi = 2 * np.pi * np.arange(count) / _GOLDEN
    squared = (1 - u) / (1 + (alpha**2 - 1) * u)
    z = 2 * squared - 1
    across = np.sqrt(np.maximum(1 - z * z, 0))
    # The density of a reflection is D(h) (n.h) / (4 v.h), with v = n.
    density = alpha**2 / (np.pi * (squared * (alpha**2 - 1) + 1) ** 2) / 4
    texel = 4 * np.pi / (6 * size * size)
    level = 0.5 * np.log2(1 / (count * density) / texel) + _COARSER
    samples = np.stack([across * np.cos(phi), across * np.sin(phi), z, level.clip(0, levels - 1)], axis=1)
    return samples[z > 0].astype(np.float32)
