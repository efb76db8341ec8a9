"""Probes for Unity and VRChat: their own formulas give E/pi of the engine at normals in all directions."""

import numpy as np
import pytest

from engine.probes.spherical_harmonics import irradiance, windowed
from engine.probes.unity_probes import UNITY, light_volume_textures, unity_volume
from engine.scene.probe_volume import ProbeVolume

RANDOM = np.random.default_rng(23)
NORMALS = RANDOM.normal(size=(40, 3))
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)


def coefficients(count):
    """Return radiance SH of random probes, (n, 9, 3) float32, with E/pi that is nowhere negative."""
    made = RANDOM.uniform(-0.6, 0.6, (count, 9, 3)).astype(np.float32)
    made[:, 0] += 3
    return windowed(made)


def shade_sh9(harmonics, normals):
    """Return ShadeSH9 of UnityCG.cginc with the constants of SphericalHarmonicMath.PackCoefficients."""
    c = harmonics.transpose(2, 0, 1)
    sh_a = np.stack([c[3], c[1], c[2], c[0] - c[6]], axis=-1)
    sh_b = np.stack([c[4], c[5], 3 * c[6], c[7]], axis=-1)
    x, y, z = normals.T
    linear = sh_a @ np.stack([x, y, z, np.ones_like(x)])
    quadratic = sh_b @ np.stack([x * y, y * z, z * z, z * x])
    return (linear + quadratic + c[8][..., None] * (x * x - y * y)).transpose(0, 2, 1)


def test_shade_sh9_of_unity_gives_the_irradiance():
    light = coefficients(7)
    volume = unity_volume(light, (7, 1, 1), np.eye(4))
    found = shade_sh9(volume.harmonics[::-1], NORMALS @ UNITY.T)
    assert found == pytest.approx(irradiance(light, NORMALS), rel=1e-5)
    assert np.linalg.det(UNITY) == pytest.approx(-1)


def test_light_volumes_of_vrchat_give_band_0_and_1():
    """As Texture3DAtlasGenerator packs textures, and LightVolumeEvaluate shades them."""
    light = coefficients(11)
    harmonics = unity_volume(light, (1, 11, 1), np.eye(4)).harmonics
    first, second, third = (part.astype(np.float64) for part in light_volume_textures(harmonics))
    l0 = first[:, :3]
    l1 = np.stack([second[:, :3], third[:, :3], np.stack([first[:, 3], second[:, 3], third[:, 3]], 1)], 2)
    half = 0.5 * l1
    l1 = half * np.minimum(l0 / np.linalg.norm(half, axis=2), 1.13)[..., None]
    found = l0[:, None] + np.einsum("nca,ma->nmc", l1, NORMALS @ UNITY.T)
    light[:, 4:] = 0
    assert found == pytest.approx(irradiance(light, NORMALS)[::-1], rel=3e-3)


def test_l1_of_vrchat_is_never_longer_than_l0():
    """A single small light has an L1 that is too long; packing shortens it, so nothing is negative."""
    light = np.zeros((1, 9, 3), np.float32)
    light[:, 0], light[:, 3] = 0.282095, 0.488603
    first, second, _ = light_volume_textures(unity_volume(windowed(light), (1, 1, 1), np.eye(4)).harmonics)
    half = 0.5 * np.abs(second[:, :1].astype(np.float64))
    assert (half * np.minimum(first[:, :1] / half, 1.13) <= first[:, :1] * 1.001).all()


@pytest.mark.parametrize("resolution", [(4, 3, 5), (2, 1, 7), (1, 1, 1)])
def test_each_voxel_has_the_light_of_its_place(resolution):
    """Voxel i lies at (i + 1/2) / n - 1/2 of the box, as in LightVolume.RecalculateProbesPositions."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0] @ np.diag([2.0, 1.0, 0.5])
    matrix[:3, :3] *= np.sign(np.linalg.det(matrix[:3, :3]))
    matrix[:3, 3] = [5, -7, 3]
    slope = RANDOM.random(3)
    points = ProbeVolume("Volume", matrix, resolution).points()
    light = np.zeros((len(points), 9, 3), np.float32)
    light[:, 0] = (points @ slope)[:, None] / 0.282095
    volume = unity_volume(light, resolution, matrix)
    assert volume.resolution == (resolution[0], resolution[2], resolution[1]) and not volume.is_sheared
    k, j, i = np.meshgrid(*(np.arange(size) for size in volume.resolution[::-1]), indexing="ij")
    voxels = np.stack([i, j, k], axis=-1).reshape(-1, 3)
    local = (voxels + 0.5) / volume.resolution - 0.5
    places = local @ volume.matrix[:3, :3].T + volume.matrix[:3, 3]
    assert volume.harmonics[:, 1, 0] == pytest.approx(places @ UNITY @ slope, rel=1e-4)
    axes = volume.matrix[:3, :3] / np.linalg.norm(volume.matrix[:3, :3], axis=0)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_a_sheared_volume_is_named_so():
    matrix = np.eye(4)
    matrix[0, 1] = 0.2
    assert unity_volume(coefficients(1), (1, 1, 1), matrix).is_sheared
