"""Samples of neighbouring texels complete each other, so that their noise is fine-grained."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Scene, Settings
from engine.device.buffers import download
from engine.patches.patch_scene import make_patch_scene
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.rays.receiver_records import RECEIVER
from tests.analytic.drive import drive
from tests.analytic.scenes import material, quads, rectangle
from tests.analytic.test_sky_and_cutouts import sky

X, Y, Z = np.eye(3)


def floor(resolution: int, size: int, world=(0.0, 0.0, 0.0)) -> Scene:
    """Return a square of so many texels whose corner is at texel 3, 2, under a sky."""
    corners = rectangle((0, 0, 0), X, Y)
    mesh = quads(corners[None], [(3, 2, size, size)], [0], resolution, "Floor")
    return Scene((mesh,), (material("Black", 0.0),), world=np.asarray(world, np.float32))


def ranks(compute, patch_scene) -> np.ndarray:
    """Return the rank of each patch: what is stored is twice that, and 1 more if a face crosses its texel."""
    numbers = RECEIVER.dtype.itemsize // 4
    records = download(compute, RayScene(compute, patch_scene).receivers, (len(patch_scene.patches), numbers))
    found: np.ndarray = records.view(RECEIVER.dtype)["rank"][:, 0]
    return found >> 1


@pytest.mark.parametrize("resolution", [32, 37, 61])
def test_ranks_follow_a_curve_from_texel_to_texel(graphics, compute, resolution):
    """Of the whole lightmap each texel has a rank of its own, and the next one is beside it."""
    patch_scene = make_patch_scene(
        graphics, compute, floor(resolution, resolution - 4), Settings(resolution=resolution)
    )
    found, texel = ranks(compute, patch_scene), patch_scene.patches.texel
    order = np.argsort(found)
    y, x = np.divmod(texel[order].astype(int), resolution)
    beside = np.diff(found[order]) == 1
    assert len(np.unique(found)) == len(texel) and beside.mean() > 0.8
    steps = np.abs(np.diff(x)) + np.abs(np.diff(y))
    assert (steps[beside] == 1).all()


def test_points_of_one_texel_follow_each_other(graphics, compute):
    """They go on where the last one ended, and no two texels share a rank."""
    patch_scene = make_patch_scene(graphics, compute, floor(16, 9), Settings(resolution=16))
    chosen = np.repeat(np.arange(len(patch_scene.patches)), 4)
    many = replace(
        patch_scene, patches=patch_scene.patches.subset(chosen), geometry=patch_scene.geometry.subset(chosen)
    )
    assert (
        ranks(compute, many).reshape(-1, 4) == 4 * ranks(compute, patch_scene)[:, None] + np.arange(4)
    ).all()


@pytest.mark.parametrize("samples", [8, 16, 61])
def test_noise_has_little_of_low_frequencies(samples, monkeypatch):
    """Means of 4 x 4 texels are nearer to each other than white noise is where rays alone tell the sky."""
    monkeypatch.setattr("engine.visibility.unoccluded_sky._has_use", lambda sky: False)
    world = sky(64, lambda direction: 1 + np.sin(5 * direction @ (X + 0.3 * Y)) + (direction @ Y > 0.2))
    settings = Settings(
        resolution=64, visibility="rays", samples=samples, sample_emission=False, hide_seams=False, seed=3
    )
    light = drive(floor(64, 56, world), settings).image[0, 4:56, 4:56, 0].astype(float)
    noise = light - light.mean()
    blocks = noise.reshape(13, 4, 13, 4).mean(axis=(1, 3))
    assert noise.std() > 0.01 * light.mean()
    assert blocks.std() < 0.65 * noise.std() / 4
