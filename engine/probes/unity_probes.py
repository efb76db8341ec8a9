"""Probes as Unity and VRChat store them: SphericalHarmonicsL2, and the 3D textures of VRC Light Volumes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .spherical_harmonics import BASIS_FACTORS, IRRADIANCE_FACTORS, with_axes

#: Axes of Unity, as rows in Blender's axes. Importers such as glTFast reverse the x axis of glTF, whose axes
#: are Blender's (x, z, -y).
UNITY = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])

#: Factor of L1 in the textures of VRC Light Volumes: packing multiplies it by 0.5 * 1.13 where the result is
#: not above L0 (DeringSingleSH of Texture3DAtlasGenerator.cs).
_UNPACKED = 1 / (0.5 * 1.13)

#: Cosine of the angle between axes above which a volume is sheared; float32 matrices are off by less.
_SHEAR = 1e-4


@dataclass(frozen=True)
class UnityVolume:
    """Probes of a volume in Unity's axes; x varies fastest among the probes, then y.

    resolution:  number of probes along the local x, y and z axes
    matrix:      (4, 4) float64, from the cube [-1/2, 1/2]^3 to world axes, m
    harmonics:   (n, 3, 9) float32, SphericalHarmonicsL2 [channel, coefficient]
    """

    resolution: tuple[int, int, int]
    matrix: np.ndarray
    harmonics: np.ndarray

    @property
    def is_sheared(self) -> bool:
        """True if no position, rotation and size describe the box."""
        axes = self.matrix[:3, :3] / np.linalg.norm(self.matrix[:3, :3], axis=0)
        return bool(np.abs(axes.T @ axes - np.eye(3)).max() > _SHEAR)


def unity_volume(
    coefficients: np.ndarray, resolution: tuple[int, int, int], matrix: np.ndarray
) -> UnityVolume:
    """Return a volume for Unity. Its local axes are Blender's, changed in the same way as the world's.

    Unity evaluates c0 - c6 + c1 y + c2 z + c3 x + c4 xy + c5 yz + 3 c6 z^2 + c7 xz + c8 (x^2 - y^2) for a
    normal (SphericalHarmonics.cs of the High Definition Render Pipeline) and shows albedo times that, so the
    constants of basis and cosine lobe are in the coefficients.

    coefficients:  (n, 9, 3) float32, radiance SH L2 in Blender's axes, x fastest
    matrix:        (4, 4) float64, from the unit cube [-1, 1]^3 to Blender's world space, m
    """
    x, y, z = resolution
    turned = with_axes(coefficients, UNITY) * (BASIS_FACTORS * IRRADIANCE_FACTORS)[:, None]
    grid = turned.reshape(z, y, x, 9, 3)[:, ::-1, ::-1].transpose(1, 0, 2, 4, 3)
    axes = np.eye(4)
    axes[:3, :3] = UNITY
    return UnityVolume(
        (x, z, y),
        axes @ matrix @ axes.T @ np.diag([2.0, 2.0, 2.0, 1.0]),
        np.ascontiguousarray(grid, np.float32).reshape(-1, 3, 9),
    )


def light_volume_textures(harmonics: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the RGBA texels of the three textures of a VRC Light Volume, (n, 4) float16 each.

    Texture0 holds L0 and z of L1 of red, Texture1 x of L1 of all channels and z of green, Texture2 y of L1
    and z of blue (LightVolume.cs). Values above the range of half floats are clamped.

    harmonics:  (n, 3, 9) float32, see `UnityVolume`
    """
    half = np.finfo(np.float16)
    l0 = harmonics[:, :, 0]
    y, z, x = (_UNPACKED * harmonics[:, :, number] for number in (1, 2, 3))
    columns = [[l0, z[:, :1]], [x, z[:, 1:2]], [y, z[:, 2:]]]
    first, second, third = (
        np.concatenate(parts, axis=1).clip(half.min, half.max).astype(np.float16) for parts in columns
    )
    return first, second, third
