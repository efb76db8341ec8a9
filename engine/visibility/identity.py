"""Which patch each sample of every patch's view meets: found once, or anew in every iteration."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pyopencl as cl

from ..device.buffers import upload_float4
from ..device.compute import Compute
from ..settings import Settings


def identity_options(size: int) -> tuple[str, ...]:
    """Return the build options of kernels that read or write samples of `size` bytes."""
    return ("-DNARROW",) if size == 2 else ()


def directional_options(settings: Settings) -> tuple[str, ...]:
    """Return the build options of kernels that sum the L1 of light, if the settings ask for it."""
    projected = ("-DPROJECTED",) if settings.projected else ()
    return ("-DDIRECTIONAL", *projected) if settings.directional else ()


@dataclass(frozen=True)
class SeenBuffers:
    """Where an Identity writes on the OpenCL device.

    cache         a row of samples for each patch from `cached_from` on, uint16 or uint32: patch + 1, or 0
    cached_from   the first patch of the cache
    static_light  float4 of each patch: E/pi of sky and backs, which no bounce changes, and the fraction of
                  the view that is no back
    patches_seen  float of each patch: the fraction of its view that other patches take
    static_l1     3 float4 of each patch, x, y and z: the L1 of the static light, see kernels/tilt.cl; None
                  unless the settings ask for directional maps
    """

    cache: cl.Buffer
    cached_from: int
    static_light: cl.Buffer
    patches_seen: cl.Buffer
    static_l1: cl.Buffer | None = None


class Identity(Protocol):
    """A way to find what patches see.

    name        "raster" or "rays"
    samples     of each patch, a multiple of 4
    row_bytes   what they take in the cache, `sample_bytes` each
    batch       patches that are found at once: fewer take as long
    multiplier  (samples,) float32, sum 1, or None if all weigh the same
    """

    name: str
    samples: int
    row_bytes: int
    batch: int
    multiplier: np.ndarray | None

    def find(self, first: int, last: int, seen: SeenBuffers) -> Generator[float, None, None]:
        """Find what the patches first ... last see; yield the fraction done."""


@dataclass(frozen=True)
class Surroundings:
    """What is seen beside the fronts of patches, on the OpenCL device.

    emission  float4 of each patch + 1, radiance of backs; entry 0 is black
    sky       float4 of each pixel, radiance, equirectangular; row 0 below
    width, height  of the sky, pixels
    """

    emission: cl.Buffer
    sky: cl.Buffer
    width: np.int32
    height: np.int32


def surroundings(compute: Compute, emission: np.ndarray, sky: np.ndarray) -> Surroundings:
    """Upload emission, (n, 3) float32, and sky, (h, w, 3) float32."""
    backs = upload_float4(compute, emission, first=1)
    pixels = upload_float4(compute, sky.reshape(-1, 3))
    return Surroundings(backs, pixels, np.int32(sky.shape[1]), np.int32(sky.shape[0]))
