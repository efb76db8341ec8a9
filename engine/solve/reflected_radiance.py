"""Reflected and exitant radiance of patches, with substitutes."""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload, upload_float4_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, float4_once, rows_on_device
from ..device.opencl import cl


def reflected_light(
    reflectance: np.ndarray, irradiance: np.ndarray, substitute: np.ndarray | None
) -> np.ndarray:
    """Return the reflected radiance of patches, (n, 3) float32.

    reflectance:  (n, 3) float32
    irradiance:   (n, 3) float32, E/pi
    substitute:   (n,) uint32, patch whose reflected light replaces each patch's own; None if none
    """
    reflected: np.ndarray = reflectance * irradiance
    return reflected if substitute is None else reflected[substitute]


def exitant_radiance(
    compute: ComputeDevice,
    emission: np.ndarray,
    reflectance: Values,
    irradiance: Values,
    substitute: np.ndarray | None = None,
) -> cl.Buffer:
    """Compute the exitant radiance of patches on the device, float4 of each between two black entries.

    The arrays must not change afterwards: each is uploaded only once.

    emission:     (n, 3) float32, W/(m^2 sr)
    reflectance:  (n, 3) float32
    irradiance:   (n, 3) float32, E/pi
    substitute:   (n,) uint32, patch whose reflected light replaces each patch's own; None if none
    """
    (kernel,) = compute.kernels("exitant_radiance.cl", "exitant_radiance")
    count, radiance = len(emission), zeros(compute, 16 * (len(emission) + 2))
    surfaces = upload_float4_once(compute, emission, first=1), float4_once(compute, reflectance)
    light, stride = rows_on_device(compute, irradiance)
    others = None if substitute is None else upload(compute, substitute.astype(np.uint32, copy=False))
    compute.run(kernel, count, *surfaces, light, np.int32(stride), others, radiance, np.int32(count))
    return radiance
