"""Visibility samplers: the item-buffer entry (patch ID) of each hemisphere sample of a patch."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..device.buffers import upload, upload_float4, upload_float4_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..settings import Settings
from .unoccluded_sky import open_sky


def identity_options(size: int, tinted: bool = False) -> tuple[str, ...]:
    """Return the build options of kernels for samples of `size` bytes, with or without tints."""
    return ("-DNARROW",) if size == 2 else ("-DTINTED",) if tinted else ()


def directional_options(settings: Settings) -> tuple[str, ...]:
    """Return the build options of kernels that sum L1, if directional maps are requested."""
    projected = ("-DPROJECTED",) if settings.projected else ()
    return ("-DDIRECTIONAL", *projected) if settings.directional else ()


@dataclass(frozen=True)
class VisibilityBuffers:
    """Output buffers of a `VisibilitySampler` on the OpenCL device.

    cache:         one row of samples per patch from `cached_from` on, uint16 or uint32: patch + 1 for a front
                   face, `Background.outside` for the background, else 0
    cached_from:   first patch of the cache
    back_light:    float4 of each patch: E/pi from visible back faces, and the fraction of its hemisphere
                   without back faces
    patches_seen:  float of each patch: fraction of its hemisphere covered by other patches
    backs_seen:    uint8 by source + 1: set to 1 if a sample hits its back face
    back_l1:       3 float4 of each patch, axes x, y and z: L1 of the light from back faces, see
                   kernels/visibility/irradiance_l1.cl; None without directional maps
    """

    cache: cl.Buffer
    cached_from: int
    back_light: cl.Buffer
    patches_seen: cl.Buffer
    backs_seen: cl.Buffer
    back_l1: cl.Buffer | None = None


class VisibilitySampler(Protocol):
    """Method that computes visibility samples of patches.

    name:        "raster" or "rays"
    samples:     number per patch, a multiple of 4
    row_bytes:   bytes per patch in the cache, `sample_bytes` per sample
    batch:       patches processed at once; fewer take the same time
    multiplier:  (samples,) float32 weights with sum 1, or None for equal weights
    tints:       (64, 4) float32, see `tints.tint_palette`, or None if samples have no tints
    """

    name: str
    samples: int
    row_bytes: int
    batch: int
    multiplier: np.ndarray | None
    tints: np.ndarray | None

    def find(self, first: int, last: int, seen: VisibilityBuffers) -> Generator[float, None, None]:
        """Compute the visibility samples of the patches first <= i < last; yield progress 0..1."""


@dataclass(frozen=True)
class SampleLayout:
    """Layout of cached samples, as far as kernels need it to read them.

    name, samples, row_bytes, multiplier, tints:  see `VisibilitySampler`
    """

    name: str
    samples: int
    row_bytes: int
    multiplier: np.ndarray | None
    tints: np.ndarray | None = None

    @classmethod
    def of(cls, sampler: VisibilitySampler) -> SampleLayout:
        """Return the sample layout of a visibility sampler."""
        return cls(sampler.name, sampler.samples, sampler.row_bytes, sampler.multiplier, sampler.tints)

    @property
    def even(self) -> bool:
        """True if all samples have equal weights, since they are cosine-distributed."""
        return self.multiplier is None

    @property
    def options(self) -> tuple[str, ...]:
        """Build options of kernels that read the samples."""
        return identity_options(self.sample_bytes, self.tints is not None)

    def tints_on(self, compute: ComputeDevice) -> cl.Buffer | None:
        """Upload the tint palette, (64, 4) float32; None if samples have no tints."""
        return None if self.tints is None else upload(compute, self.tints)

    @property
    def sample_bytes(self) -> int:
        """Bytes of a sample in the cache."""
        return self.row_bytes // self.samples


@dataclass(frozen=True)
class Background:
    """Radiance of everything except the front faces of patches, on the OpenCL device.

    emission:       float4 by patch + 1, radiance of back faces; entry 0 is black
    outside:        cache entry of samples that hit the sky: the one after the last patch
    sky:            float4 of each pixel, radiance, equirectangular; row 0 at the bottom
    width, height:  size of the sky, pixels
    open_sky:       float4, E/pi of the unoccluded sky, see `open_sky`; None if the sky is uniform or uneven
    dark:           True if the sky is black
    """

    emission: cl.Buffer
    outside: np.uint32
    sky: cl.Buffer
    width: np.int32
    height: np.int32
    open_sky: cl.Buffer | None
    dark: bool

    @property
    def sky_arguments(self) -> tuple:
        """Kernel arguments of the sky: SKY_ARGUMENTS of kernels/visibility/unoccluded_sky.cl."""
        return self.sky, self.width, self.height, self.open_sky


def upload_background(
    compute: ComputeDevice,
    emission: np.ndarray,
    sky: np.ndarray,
    whole: Callable[[np.ndarray], np.ndarray | None] = open_sky,
) -> Background:
    """Upload the light of visibility samples that hit no front face: emission of back faces, and the sky.

    emission:  (n, 3) float32, radiance of the back face of each patch
    sky:       (h, w, 3) float32, radiance, equirectangular
    whole:     computes the table of the unoccluded sky, see `unoccluded_sky.open_sky`
    """
    backs = upload_float4_once(compute, emission, first=1)
    pixels = upload_float4(compute, sky.reshape(-1, 3))
    size = np.int32(sky.shape[1]), np.int32(sky.shape[0])
    table = whole(sky)
    known = None if table is None else upload_float4(compute, table)
    return Background(backs, np.uint32(len(emission) + 1), pixels, *size, known, not sky.any())
