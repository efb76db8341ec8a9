"""Maps that tell where light comes from, which shade normal maps: by NumPy, or on the device that has L1."""

from __future__ import annotations

import numpy as np

from ..device.device_array import Values
from ..gather.device_l1 import L1, DeviceL1
from ..patches.geometry import PatchGeometry
from ..scene.color import luminance
from ..settings import Settings
from .device_directional_maps import DeviceDirectionalMaps
from .outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS


def maps_of_directions(
    settings: Settings, irradiance: np.ndarray, sampled: np.ndarray, gathered: L1, geometry: PatchGeometry
) -> dict[str, Values]:
    """Return the maps of directions that the settings name, (n, 3) float32 each, by name.

    irradiance  (n, 3) float32, E/pi
    sampled     (n, 3, 3) float32, L1 of the light that shadow rays sample
    gathered    the same of all other light
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
    """Return the same, made on the device."""
    if settings.projected:
        return dict(zip(PROJECTED_MAPS, device.projected(), strict=True))
    made: dict[str, Values] = {}
    if "directional" in settings.outputs:
        made |= zip(DIRECTIONAL_MAPS, device.tilted(), strict=True)
    if "dominant_direction" in settings.outputs:
        made["dominant_direction"] = device.dominant()
    return made


def directional_maps(irradiance: np.ndarray, l1: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return the maps that shade normal maps, (n, 3) float32 each, by name.

    irradiance  (n, 3) float32, E/pi
    l1          (n, 3, 3) float32, of each axis of the world its rgb
    normals     (n, 3) float32, unit, world space

    E(n')/pi = E(n)/pi + l1 . (n' - n) is L0 + L1 . n'.
    """
    axes = np.ascontiguousarray(l1.transpose(1, 0, 2))
    l0 = irradiance.copy()
    for along, l1_of_axis in zip(normals.T, axes, strict=True):
        l0 -= along[:, None] * l1_of_axis
    return dict(zip(DIRECTIONAL_MAPS, (l0, *axes), strict=True))


def dominant_direction(irradiance: np.ndarray, l1: np.ndarray) -> np.ndarray:
    """Return where most light comes from, (n, 3) float32, in world space; see `directional_maps`.

    It is the luminance of l1 in parts of that of E/pi: E(n')/pi is about E(n)/pi (1 + D . (n' - n)).
    """
    light = luminance(irradiance)[:, None]
    return np.divide(luminance(l1), light, out=np.zeros_like(irradiance), where=light > 0)


def projected_maps(irradiance: np.ndarray, sums: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return light projected on the first two bands of spherical harmonics, (n, 3) float32 each, by name.

    irradiance  (n, 3) float32, E/pi
    sums        (n, 3, 3) float32, of each axis of the world its rgb: along the normal SH L0, across it L1
    normals     (n, 3) float32, unit, world space

    Light L of the normal's hemisphere gives the irradiance E(n')/pi = L0 + L1 . n' of these bands, with L0
    the mean of L over the sphere, and L1 twice that of L times its direction (Ramamoorthi and Hanrahan
    2001): the part of L1 along the normal is E(n)/2 pi. SH L1 is L1 / (2 L0), whose length is at most 1.
    """
    # Axis by axis: NumPy is slow along short rows.
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
