"""Directional lightmaps for normal mapping: L0 and L1, dominant direction, and spherical harmonics.

NumPy version; it calls the OpenCL version if L1 lies on the device.
"""

from __future__ import annotations

import numpy as np

from ..device.device_array import Values
from ..gather.device_l1 import L1, DeviceL1
from ..outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS
from ..patches.geometry import PatchGeometry
from ..scene.color import luminance
from ..settings import Settings
from .device_directional_maps import DeviceDirectionalMaps


def maps_of_directions(
    settings: Settings, irradiance: np.ndarray, sampled: np.ndarray, gathered: L1, geometry: PatchGeometry
) -> dict[str, Values]:
    """Return the directional maps that the settings request, by name, (n, 3) float32 each.

    irradiance  (n, 3) float32, E/pi
    sampled     (n, 3, 3) float32, L1 of light from shadow rays: axis, then RGB
    gathered    L1 of all other light, same layout
    geometry    position and normal of each point
    """
    if isinstance(gathered, DeviceL1):
        return _on_device(settings, DeviceDirectionalMaps(gathered, irradiance, sampled))
    l1 = sampled + gathered
    if settings.projected:
        return dict(projected_maps(irradiance, l1, geometry.normal))
    made: dict[str, Values] = {}
    if "directional" in settings.outputs:
        made |= directional_maps(irradiance, l1, geometry.normal)
    if "dominant_direction" in settings.outputs:
        made["dominant_direction"] = dominant_direction(irradiance, l1)
    return made


def _on_device(settings: Settings, device: DeviceDirectionalMaps) -> dict[str, Values]:
    """Return the requested maps, computed on the device."""
    if settings.projected:
        return dict(zip(PROJECTED_MAPS, device.projected(), strict=True))
    made: dict[str, Values] = {}
    if "directional" in settings.outputs:
        made |= zip(DIRECTIONAL_MAPS, device.tilted(), strict=True)
    if "dominant_direction" in settings.outputs:
        made["dominant_direction"] = device.dominant()
    return made


def directional_maps(irradiance: np.ndarray, l1: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return L0 and the three components of L1, (n, 3) float32 each, by name.

    The irradiance for a normal n' near n is E(n')/pi = E(n)/pi + L1 . (n' - n) = L0 + L1 . n'.

    irradiance  (n, 3) float32, E/pi
    l1          (n, 3, 3) float32, gradient of E/pi by the normal: world axis, then RGB
    normals     (n, 3) float32, unit, world space
    """
    axes = np.ascontiguousarray(l1.transpose(1, 0, 2))
    l0 = irradiance.copy()
    for along, l1_of_axis in zip(normals.T, axes, strict=True):
        l0 -= along[:, None] * l1_of_axis
    return dict(zip(DIRECTIONAL_MAPS, (l0, *axes), strict=True))


def dominant_direction(irradiance: np.ndarray, l1: np.ndarray) -> np.ndarray:
    """Return the dominant direction D, (n, 3) float32, world space, not normalized.

    D is the luminance of L1 divided by the luminance of E/pi, so that E(n')/pi is about E(n)/pi (1 + D . (n'
    - n)); see `directional_maps`.
    """
    light = luminance(irradiance)[:, None]
    return np.divide(luminance(l1), light, out=np.zeros_like(irradiance), where=light > 0)


def projected_maps(irradiance: np.ndarray, sums: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return radiance projected on the first two bands of spherical harmonics, (n, 3) float32, by name.

    The radiance L over the hemisphere of the normal gives the irradiance E(n')/pi = L0 + L1 . n' of these
    bands. L0 is the mean of L over the sphere; L1 is twice the mean of L times its direction (Ramamoorthi and
    Hanrahan 2001). The component of L1 along the normal is E(n) / (2 pi). The map "SH L1" holds L1 / (2 L0),
    clamped to length 1.

    irradiance  (n, 3) float32, E/pi
    sums        (n, 3, 3) float32, world axis, then RGB: the component along the normal is SH L0, the
                component across it is L1
    normals     (n, 3) float32, unit, world space
    """
    # One axis at a time: NumPy is slow on short rows.
    axes = np.ascontiguousarray(sums.transpose(1, 0, 2))
    along = [np.ascontiguousarray(component)[:, None] for component in normals.T]
    l0 = along[0] * axes[0] + along[1] * axes[1] + along[2] * axes[2]
    across, lit = 0.5 * irradiance - l0, l0 > 0
    parts = [
        np.divide(0.5 * (axis + component * across), l0, out=np.zeros_like(l0), where=lit)
        for axis, component in zip(axes, along, strict=True)
    ]
    longest = np.maximum(np.sqrt(parts[0] ** 2 + parts[1] ** 2 + parts[2] ** 2), 1)
    maps = (l0, *(part / longest for part in parts))
    return dict(zip(PROJECTED_MAPS, maps, strict=True))
