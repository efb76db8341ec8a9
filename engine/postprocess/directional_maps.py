"""Directional lightmaps for normal mapping: L0 and L1, dominant direction, and spherical harmonics.

Computed by OpenCL if L1 lies on the device, else by NumPy.
"""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload, upload_rows_once
from ..device.device_array import DeviceArray, Values
from ..device.opencl import cl
from ..gather.device_l1 import L1, DeviceL1
from ..outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS
from ..patches.geometry import PatchGeometry
from ..scene.color import luminance
from ..settings import Settings
from ..visibility.rays.receiver_records import RECEIVER


def maps_of_directions(
    settings: Settings, irradiance: np.ndarray, sampled: np.ndarray, gathered: L1, geometry: PatchGeometry
) -> dict[str, Values]:
    """Return the directional maps that the settings request, by name, (n, 3) float32 each.

    irradiance:  (n, 3) float32, E/pi
    sampled:     (n, 3, 3) float32, L1 of light from shadow rays: axis, then RGB
    gathered:    L1 of all other light, same layout
    geometry:    position and normal of each point
    """
    if isinstance(gathered, DeviceL1):
        return _on_device(settings, _DeviceMaps(gathered, irradiance, sampled))
    l1 = sampled + gathered
    if settings.projected:
        return dict(projected_maps(irradiance, l1, geometry.normal))
    made: dict[str, Values] = {}
    if "directional" in settings.outputs:
        made |= directional_maps(irradiance, l1, geometry.normal)
    if "dominant_direction" in settings.outputs:
        made["dominant_direction"] = dominant_direction(irradiance, l1)
    return made


def _on_device(settings: Settings, device: _DeviceMaps) -> dict[str, Values]:
    """Return the directional maps that the settings request, computed by OpenCL kernels."""
    if settings.projected:
        return dict(zip(PROJECTED_MAPS, device.projected(), strict=True))
    made: dict[str, Values] = {}
    if "directional" in settings.outputs:
        made |= zip(DIRECTIONAL_MAPS, device.tilted(), strict=True)
    if "dominant_direction" in settings.outputs:
        made["dominant_direction"] = device.dominant()
    return made


class _DeviceMaps:
    """Directional maps of n points, computed by OpenCL kernels; NumPy versions are functions of this module.

    gathered:    L1 of gathered light, on the device
    irradiance:  (n, 3) float32, E/pi
    sampled:     (n, 3, 3) float32, L1 of light from shadow rays: axis, then RGB
    """

    def __init__(self, gathered: DeviceL1, irradiance: np.ndarray, sampled: np.ndarray) -> None:
        self._compute, self._count, self._receivers = gathered.compute, len(gathered), gathered.receivers
        rows, stride = upload_rows_once(self._compute, irradiance)
        axes = upload(self._compute, sampled.transpose(1, 0, 2))
        self._given = rows, np.int32(stride), axes, gathered.buffer

    def tilted(self) -> list[DeviceArray]:
        """Return L0 and the x, y and z components of L1, (n, 3) float32 each."""
        return self._made("tilted_maps", 4, self._receivers)

    def dominant(self) -> DeviceArray:
        """Return the dominant direction, luminance of L1 divided by luminance of E/pi, (n, 3) float32."""
        (direction,) = self._made("dominant_direction", 1)
        return direction

    def projected(self) -> list[DeviceArray]:
        """Return SH L0 and the x, y and z components of SH L1, (n, 3) float32 each."""
        return self._made("projected_maps", 4, self._receivers)

    def _made(self, name: str, maps: int, *arguments: cl.Buffer) -> list[DeviceArray]:
        """Run a kernel that writes `maps` arrays; return them, (n, 3) float32 each."""
        compute, count = self._compute, self._count
        (kernel,) = compute.kernels((RECEIVER, "directional_maps.cl"), name)
        buffers = [cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 12 * count) for _ in range(maps)]
        compute.run(kernel, count, *self._given, *arguments, *buffers, np.int32(count))
        return [DeviceArray(compute, buffer, count) for buffer in buffers]


def directional_maps(irradiance: np.ndarray, l1: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return L0 and the three components of L1, (n, 3) float32 each, by name.

    The irradiance for a normal n' near n is E(n')/pi = E(n)/pi + L1 . (n' - n) = L0 + L1 . n'.

    irradiance:  (n, 3) float32, E/pi
    l1:          (n, 3, 3) float32, gradient of E/pi by the normal: world axis, then RGB
    normals:     (n, 3) float32, unit, world space
    """
    axes = np.ascontiguousarray(l1.transpose(1, 0, 2))
    l0 = irradiance.copy()
    for along, l1_of_axis in zip(normals.T, axes, strict=True):
        l0 -= along[:, None] * l1_of_axis
    return dict(zip(DIRECTIONAL_MAPS, (l0, *axes), strict=True))


def dominant_direction(irradiance: np.ndarray, l1: np.ndarray) -> np.ndarray:
    """Return the dominant direction D, (n, 3) float32, world space, not normalized.

    D is the luminance of L1 divided by the luminance of E/pi, so that E(n')/pi is about E(n)/pi (1 + D . (n'
    - n)); see `directional_maps`. The luminance has the weights of Rec.709 in each working space.
    """
    light = luminance(irradiance)[:, None]
    return np.divide(luminance(l1), light, out=np.zeros_like(irradiance), where=light > 0)


def projected_maps(irradiance: np.ndarray, sums: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return radiance projected on the first two bands of spherical harmonics, (n, 3) float32, by name.

    The radiance L over the hemisphere of the normal gives the irradiance E(n')/pi = L0 + L1 . n' of these
    bands. L0 is the mean of L over the sphere; L1 is twice the mean of L times its direction (Ramamoorthi and
    Hanrahan 2001). The component of L1 along the normal is E(n) / (2 pi). The map "SH L1" holds L1 / (2 L0),
    clamped to length 1.

    irradiance:  (n, 3) float32, E/pi
    sums:        (n, 3, 3) float32, world axis, then RGB: the component along the normal is SH L0, the
                 component across it is L1
    normals:     (n, 3) float32, unit, world space
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
