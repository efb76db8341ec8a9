"""Many lights: the sum of their single contributions, at the cost of a few."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Material, Scene, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.gl_context import GraphicsContext
from engine.direct.lighting import DirectLighting
from engine.patches.patch_scene import PatchScene, make_patch_scene
from engine.visibility.rays.ray_scene import RayScene
from tests.analytic.scenes import quads, rectangle
from tests.reference.analytic import polygon

X, Y, Z = np.eye(3)
BLACK = Material("Black", np.zeros(3, np.float32), np.zeros(3, np.float32))
SETTINGS = Settings(resolution=32, light_samples=64)


class Bench:
    """Bakes nothing but sampled light."""

    def __init__(self) -> None:
        self.compute, self.graphics = ComputeDevice(), GraphicsContext()

    def make_patch_scene(self, scene: Scene) -> PatchScene:
        return make_patch_scene(self.graphics, self.compute, scene, SETTINGS)

    def light(self, scene: Scene, patch_scene: PatchScene, **settings: int) -> np.ndarray:
        """Return E/pi of the green channel at each patch."""
        chosen = dataclasses.replace(SETTINGS, **settings)
        rays = RayScene(self.compute, patch_scene)
        return finished(DirectLighting(scene, patch_scene, rays, chosen).gather())[:, 1]


@pytest.fixture(scope="module")
def bench():
    bench = Bench()
    yield bench
    bench.graphics.release()


def floor(size, resolution=32, chart=(1, 1, 8, 8)):
    return quads(
        rectangle((-size / 2, -size / 2, 0), size * X, size * Y)[None], [chart], [0], resolution, "Floor"
    )


def mixed_lamps(count):
    """Return lamps of all kinds but suns, most of them above the floor, in all directions."""
    rng = np.random.default_rng(5)
    kinds = (
        {"kind": "point"},
        {"kind": "point", "radius": 0.2},
        {"kind": "spot", "half_angle": 0.6, "blend": 0.3},
        {"kind": "spot", "half_angle": 0.5, "blend": 0.1, "radius": 0.1, "stretch": np.array([1, 2, 1.5])},
        {"kind": "area", "size": np.array([0.4, 0.3])},
        {"kind": "area", "size": np.array([0.3, 0.3]), "ellipse": True, "half_angle": 0.8},
    )
    lamps = []
    for index in range(count):
        axes = np.linalg.qr(rng.normal(size=(3, 3)) + 2 * np.eye(3) * (1, 1, 2))[0]
        axes *= np.sign(np.diag(axes))[:, None]
        where = rng.uniform((-3, -3, -0.2), (3, 3, 3))
        strength = np.full(3, rng.uniform(0.5, 5), np.float32)
        lamps.append(Light(f"Lamp {index}", position=where, axes=axes, strength=strength, **kinds[index % 6]))
    return tuple(lamps)


def test_many_lamps_bring_what_they_bring_alone(bench):
    """The mean over seeds with few samples is the sum of bakes with one lamp each, shadows and all."""
    roof = quads(rectangle((-0.7, -0.5, 0.8), 1.2 * Y, 1.5 * X)[None], [(12, 12, 4, 4)], [0], 32, "Roof")
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.full(3, 0.3, np.float32), half_angle=0.1)
    lamps = (*mixed_lamps(40), sun)
    scene = Scene((floor(2.0), roof), (BLACK,), lights=lamps)
    patch_scene = bench.make_patch_scene(scene)
    alone = sum(
        bench.light(dataclasses.replace(scene, lights=(lamp,)), patch_scene, light_samples=1024)
        for lamp in lamps
    )
    seeds = [bench.light(scene, patch_scene, light_samples=4, seed=seed) for seed in range(40)]
    mean, noise = np.mean(seeds, axis=0), np.std(seeds, axis=0) / np.sqrt(len(seeds))
    assert (np.abs(mean - alone) < 5 * noise + 5e-3 * alone.max()).all()
    assert mean.sum() == pytest.approx(alone.sum(), abs=4 * np.sqrt((noise**2).sum()), rel=1e-3)


def test_a_ceiling_of_small_lamps(bench):
    """1,024 square lamps: E/pi is radiance times the sum of their form factors."""
    side, pitch = 32, 0.25
    centres = (np.stack(np.meshgrid(*[np.arange(side)] * 2), axis=2).reshape(-1, 2) + 0.5 - side / 2) * pitch
    size = np.array([0.1, 0.1])
    lamps = tuple(
        Light(f"{x} {y}", "area", np.array([x, y, 2.0]), np.eye(3), np.full(3, 5, np.float32), size=size)
        for x, y in centres
    )
    scene = Scene((floor(0.002),), (BLACK,), lights=lamps)
    image = bench.light(scene, bench.make_patch_scene(scene))
    corners = [rectangle((x - 0.05, y - 0.05, 2), 0.1 * Y, 0.1 * X) for x, y in centres]
    factors = [float(np.abs(polygon(np.zeros((1, 3)), Z[None], lamp)).max()) for lamp in corners]
    assert image.mean() == pytest.approx(5 * sum(factors), rel=2e-3)
    assert image == pytest.approx(5 * sum(factors), rel=1e-2)


def test_the_same_lamps_give_the_same_bits(bench):
    scene = Scene((floor(2.0),), (BLACK,), lights=mixed_lamps(100))
    patch_scene = bench.make_patch_scene(scene)
    assert (bench.light(scene, patch_scene) == bench.light(scene, patch_scene)).all()


def test_suns_only(bench):
    suns = tuple(
        Light(f"Sun {i}", "sun", np.zeros(3), np.eye(3), np.full(3, 0.1, np.float32)) for i in range(40)
    )
    scene = Scene((floor(2.0),), (BLACK,), lights=suns)
    assert bench.light(scene, bench.make_patch_scene(scene)) == pytest.approx(4 / np.pi, rel=1e-4)
