"""Probes as Bevy's IrradianceVolume stores them: a 3D texture of ambient cubes."""

from __future__ import annotations

import numpy as np

from .godot_probes import Y_UP
from .spherical_harmonics import ambient_cube, with_axes


def bevy_voxels(coefficients: np.ndarray, resolution: tuple[int, int, int]) -> np.ndarray:
    """Return E/pi of the sides of ambient cubes, (3 Rz, 2 Ry, Rx, 3) float32, for an `IrradianceVolume`.

    Axes have y up: Rx, Ry, Rz are the resolutions along x, z and -y of the volume. Blocks along the depth
    hold the sides of the world's x, y and z axes; the first half of the height holds the positive sides, as
    irradiance_volume.wgsl of Bevy 0.18 reads them.

    coefficients:  (n, 9, 3) float32, radiance SH L2 in Blender's axes, x fastest
    """
    x, y, z = resolution
    cubes = ambient_cube(with_axes(coefficients, Y_UP)).reshape(z, y, x, 3, 2, 3)

    # From (z, y, x, axis, side) of the volume to (axis, -y, side, z, x).
    voxels = cubes[:, ::-1].transpose(3, 1, 4, 0, 2, 5)
    return np.ascontiguousarray(voxels.reshape(3 * y, 2 * z, x, 3))
