"""Which patch each sample of every patch's view meets: found once, or anew in every iteration."""

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
    """Return the build options of kernels that read or write samples of `size` bytes, perhaps with tints."""
    return ("-DNARROW",) if size == 2 else ("-DTINTED",) if tinted else ()


def directional_options(settings: Settings) -> tuple[str, ...]:
    """Return the build options of kernels that sum the L1 of light, if the settings ask for it."""
    projected = ("-DPROJECTED",) if settings.projected else ()
    return ("-DDIRECTIONAL", *projected) if settings.directional else ()


@dataclass(frozen=True)
class VisibilityBuffers:
    """Where an Identity writes on the OpenCL device.

    cache         a row of samples for each patch from `cached_from` on, uint16 or uint32: patch + 1 of a
                  front, `Background.outside` for the surroundings, else 0
    cached_from   the first patch of the cache
    back_light    float4 of each patch: E/pi of the backs that it sees, and the fraction of its view that no
                  back takes
    patches_seen  float of each patch: the fraction of its view that other patches take
    backs_seen    uint8 of each source + 1: becomes 1 where a back is seen
    back_l1       3 float4 of each patch, x, y and z: the L1 of the light of backs, see
                  kernels/gather/irradiance_l1.cl; None unless the settings ask for directional maps
    """

    cache: cl.Buffer
    cached_from: int
    back_light: cl.Buffer
    patches_seen: cl.Buffer
    backs_seen: cl.Buffer
    back_l1: cl.Buffer | None = None


class VisibilitySampler(Protocol):
    """A way to find what patches see.

    name        "raster" or "rays"
    samples     of each patch, a multiple of 4
    row_bytes   what they take in the cache, `sample_bytes` each
    batch       patches that are found at once: fewer take as long
    multiplier  (samples,) float32, sum 1, or None if all weigh the same
    tints       (64, 4) float32, see `tints.tint_palette`, or None if samples have none
    """

    name: str
    samples: int
    row_bytes: int
    batch: int
    multiplier: np.ndarray | None
    tints: np.ndarray | None

    def find(self, first: int, last: int, seen: VisibilityBuffers) -> Generator[float, None, None]:
        """Find what the patches first ... last see; yield the fraction done."""


@dataclass(frozen=True)
class SampleLayout:
    """How a `VisibilitySampler` samples views: all that is needed to look up what it has found.

    name, samples, row_bytes, multiplier, tints  as of the Identity
    """

    name: str
    samples: int
    row_bytes: int
    multiplier: np.ndarray | None
    tints: np.ndarray | None = None

    @classmethod
    def of(cls, identity: VisibilitySampler) -> SampleLayout:
        """Return how an identity samples."""
        return cls(identity.name, identity.samples, identity.row_bytes, identity.multiplier, identity.tints)

    @property
    def even(self) -> bool:
        """True if all samples weigh the same: they follow the cosine."""
        return self.multiplier is None

    @property
    def options(self) -> tuple[str, ...]:
        """The build options of kernels that read its samples."""
        return identity_options(self.sample_bytes, self.tints is not None)

    def tints_on(self, compute: ComputeDevice) -> cl.Buffer | None:
        """Return the tints on the OpenCL device, None if samples have none."""
        return None if self.tints is None else upload(compute, self.tints)

    @property
    def sample_bytes(self) -> int:
        """What a sample takes in the cache."""
        return self.row_bytes // self.samples


@dataclass(frozen=True)
class Background:
    """What is seen beside the fronts of patches, on the OpenCL device.

    emission  float4 of each patch + 1, radiance of backs; entry 0 is black
    outside   what is kept of samples that meet the sky: the entry after that of the last patch
    sky       float4 of each pixel, radiance, equirectangular; row 0 below
    width, height  of the sky, pixels
    open_sky  float4, E/pi of all of the sky, see `open_sky`; None if the sky is uniform or uneven
    dark      True if the sky is black
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
        """What kernels take of the sky: SKY_ARGUMENTS of kernels/visibility/unoccluded_sky.cl."""
        return self.sky, self.width, self.height, self.open_sky


def upload_background(
    compute: ComputeDevice,
    emission: np.ndarray,
    sky: np.ndarray,
    whole: Callable[[np.ndarray], np.ndarray | None] = open_sky,
) -> Background:
    """Upload emission, (n, 3) float32, and sky, (h, w, 3) float32, with what `whole` makes of the sky."""
    backs = upload_float4_once(compute, emission, first=1)
    pixels = upload_float4(compute, sky.reshape(-1, 3))
    size = np.int32(sky.shape[1]), np.int32(sky.shape[0])
    table = whole(sky)
    known = None if table is None else upload_float4(compute, table)
    return Background(backs, np.uint32(len(emission) + 1), pixels, *size, known, not sky.any())
