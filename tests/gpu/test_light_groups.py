"""Maps of light groups: each is a bake of its light alone, and together they are the map of all light."""

import dataclasses

import numpy as np
import pytest

from engine import BakeResult, Light, Scene, Settings, SettingsError, bake, finished
from engine.device.cl_device import ComputeDevice
from engine.plan import choose_gather, memory
from engine.scene.model import NO_LIGHTMAP
from tests.analytic.drive import drive
from tests.analytic.scenes import nine_quad_room
from tests.gpu.test_hide_seams import tiles
from tests.rows import long
from tests.tools.real_denoiser import LIBRARY, needs_library

#: Sweeps without acceleration do the same to all light and to each group's.
SETTINGS = Settings(
    resolution=37, hemicube=8, samples=32, max_bounces=4, tolerance=0, visibility="rays", light_samples=8,
    texel_samples=1, hide_seams=False, margin=3, accelerate=False, intermediates=False,
    outputs=("combined", "light_groups"),
)  # fmt: skip

MAPS = ["light_group Lamps", "light_group Panel", "light_group Nobody", "light_group Ungrouped"]


def lamp(x: float, y: float, z: float, colour: tuple[float, float, float], group: str) -> Light:
    """Return a lamp without a size: one ray tells its shadow."""
    strength = np.float32(colour)
    return Light("Lamp", "point", np.array([x, y, z]), np.eye(3), strength, light_group=group)


def room() -> Scene:
    """Return a room without a ceiling below a sky of no group, with lamps and a panel of groups.

    One panel on the floor is an occluder; a lamp names a group that is not there.
    """
    base = nine_quad_room()
    mesh = base.meshes[0]
    faces = {"Room": [0, 2, 3, 4, 5, 6], "Pillar": [7], "Light": [8]}
    shown, pillar, light = (
        dataclasses.replace(mesh.subset(np.isin(mesh.face, chosen)), name=name)
        for name, chosen in faces.items()
    )
    lights = (
        lamp(1, 2, 1.5, (5, 4, 3), "Lamps"),
        lamp(3, 1, 2, (0, 7, 0), "Lamps"),
        lamp(2.2, 3, 0.7, (1, 0, 2), "No such group"),
    )
    return dataclasses.replace(
        base,
        meshes=(
            shown,
            dataclasses.replace(pillar, atlas=NO_LIGHTMAP),
            dataclasses.replace(light, light_group="Panel"),
        ),
        world=np.random.default_rng(11).random((5, 9, 3), np.float32),
        lights=lights,
        light_groups=("Lamps", "Panel", "Nobody"),
    )


def alone(scene: Scene, group: str) -> Scene:
    """Return a scene with the light of one group."""
    known = scene.light_groups

    def is_in(name: str) -> bool:
        return (name if name in known else "Ungrouped") == group

    dark = [dataclasses.replace(material, emission=np.zeros(3, np.float32)) for material in scene.materials]
    shift, meshes = len(dark), []
    for mesh in scene.meshes:
        material = mesh.material if is_in(mesh.light_group) else mesh.material + shift
        meshes.append(dataclasses.replace(mesh, material=material))
    return dataclasses.replace(
        scene,
        meshes=tuple(meshes),
        materials=(*scene.materials, *dark),
        lights=tuple(light for light in scene.lights if is_in(light.light_group)),
        world=scene.world if is_in(scene.world_light_group) else np.zeros(3, np.float32),
    )


def assert_sums(lightmap: BakeResult) -> None:
    """The groups' maps are all light together, texel by texel; none is negative, one is black."""
    combined, groups = lightmap.passes["combined"], [lightmap.passes[name] for name in MAPS]
    total = np.sum(groups, axis=0, dtype=np.float64)
    assert (np.abs(total - combined) <= 1e-5 * np.maximum(combined, combined.mean())).all()
    assert all(images.min() >= 0 for images in groups)
    assert all(images.max() > 0 for images in (groups[0], groups[1], groups[3]))
    assert not groups[2].any()


def off(first: np.ndarray, second: np.ndarray, of: np.ndarray) -> float:
    """Return the RMS of what two maps differ by, as a fraction of the mean of a third."""
    return float(np.sqrt(np.mean((first - second) ** 2)) / of.mean())


@pytest.mark.parametrize(
    "changes",
    [
        {},
        long({"method": "stream"}),
        long({"visibility": "raster"}),
        {"patch_groups": 2},
        {"sample_emission": False},
        long({"texel_samples": 4}),
        {"texel_samples": 4, "patch_groups": 2, "hide_seams": True},
    ],
    ids=["cached", "stream", "raster", "patch groups", "backs", "texels", "fitted"],
)
def test_light_is_the_sum_of_groups_before_anything_makes_it_so(changes, monkeypatch):
    """Their sum differs by noise alone, since each group has shadow rays of its own.

    All light is that of a bake without groups, bit for bit.
    """
    monkeypatch.setattr("engine.texel_gather.finishing.scale_to_sum", lambda maps, combined: maps)
    settings = dataclasses.replace(SETTINGS, **changes)
    several = drive(room(), settings)
    assert list(several.passes) == ["combined", *MAPS]
    combined = several.passes["combined"]
    total = np.sum([several.passes[name] for name in MAPS], axis=0, dtype=np.float64)
    assert off(total, combined, combined) < 0.12
    assert total.mean(axis=(0, 1, 2)) == pytest.approx(combined.mean(axis=(0, 1, 2)), rel=0.02)
    plain = drive(room(), dataclasses.replace(settings, outputs=("combined",)))
    assert np.array_equal(plain.passes["combined"], combined)


def test_a_group_is_a_bake_of_its_light_alone():
    """But for the noise of its shadow rays: alone, a light gets all of them."""
    scene = room()
    settings = dataclasses.replace(
        SETTINGS,
        resolution=53,
        samples=64,
        light_samples=512,
        accelerate=True,
        max_bounces=50,
        tolerance=1e-3,
    )
    several = drive(scene, settings)
    plain = dataclasses.replace(settings, outputs=("combined",))
    for name in ("Lamps", "Panel", "Ungrouped"):
        single = drive(alone(scene, name), plain).passes["combined"]
        assert off(several.passes[f"light_group {name}"], single, single) < 0.02, name


@pytest.mark.parametrize(
    "changes",
    [
        long({"accelerate": True, "max_bounces": 50, "tolerance": 0.002}),
        {"accelerate": True, "max_bounces": 50, "tolerance": 0.002, "texel_samples": 4, "hide_seams": True},
        long({"method": "paper", "accelerate": False}),
        {"adaptive": True, "resolution": 113, "accelerate": True, "texel_samples": 4},
        long({"resolution": 31, "samples": 16, "patch_groups": 4}),
        {"outputs": ("combined", "direct", "directional", "light_groups"), "texel_samples": 4},
    ],
    ids=["accelerated", "fitted", "paper", "adaptive", "coarse", "beside other maps"],
)
def test_maps_of_groups_sum_up_to_all_light(monkeypatch, changes):
    monkeypatch.setattr(memory, "_FEWEST", 4096)
    lightmap = drive(room(), dataclasses.replace(SETTINGS, **changes))
    assert_sums(lightmap)
    interpolated = changes.get("adaptive", False) and ComputeDevice().processor
    assert any("with more rays each" in reason for reason in lightmap.report.reasons) == interpolated


@needs_library
def test_groups_sum_up_after_denoising():
    changes = {"denoise": True, "denoise_library": str(LIBRARY), "texel_samples": 4, "hide_seams": True}
    assert_sums(drive(room(), dataclasses.replace(SETTINGS, **changes)))


def test_accelerated_groups_settle_each_on_its_own():
    """Two lamps in opposite corners, of very different strength: neither's bounces stop with all light's."""
    scene = dataclasses.replace(
        room(),
        lights=(lamp(0.9, 0.9, 1, (9, 9, 9), "Lamps"), lamp(3.2, 3.2, 1, (0.01, 0, 0.01), "Panel")),
        world=np.zeros(3, np.float32),
        materials=tuple(
            dataclasses.replace(material, emission=np.zeros(3, np.float32)) for material in room().materials
        ),
    )
    exact = drive(scene, dataclasses.replace(SETTINGS, max_bounces=50)).passes
    settings = dataclasses.replace(SETTINGS, accelerate=True, max_bounces=50, tolerance=1e-3)
    several = drive(scene, settings).passes
    for name in MAPS[:2]:
        assert off(several[name], exact[name], exact[name]) < 2e-3, name
    assert not several[MAPS[1]][..., 1].any()


def test_what_patches_see_is_found_once(monkeypatch):
    """As long as no back that is seen shines."""
    found = []
    choose_identity = choose_gather.choose_sampler
    monkeypatch.setattr(
        choose_gather, "choose_sampler", lambda job: found.append(job) or choose_identity(job)
    )
    drive(room(), SETTINGS)
    assert len(found) == 1


def test_a_scene_without_groups_has_all_light_in_one():
    lightmap = drive(tiles(), dataclasses.replace(SETTINGS, resolution=53))
    assert list(lightmap.passes) == ["combined", "light_group Ungrouped"]
    np.testing.assert_allclose(
        lightmap.passes["light_group Ungrouped"], lightmap.passes["combined"], rtol=1e-6, atol=1e-12
    )


def test_dark_groups_are_black():
    """Also where no light reaches anything, so that nothing is looked for."""
    scene = dataclasses.replace(alone(room(), "Nobody"))
    lightmap = drive(scene, SETTINGS)
    assert lightmap.report.method == "none" and not any(image.any() for image in lightmap.passes.values())
    assert list(lightmap.passes) == ["combined", *MAPS[:3]]


def test_groups_go_with_the_map_of_all_light():
    with pytest.raises(SettingsError, match="Add combined"):
        finished(bake(room(), dataclasses.replace(SETTINGS, outputs=("light_groups",))))


def test_a_dim_light_has_as_little_noise_as_if_it_were_alone():
    """Twelve bright lamps take nearly all shadow rays of a bake of all light."""
    room_ = room()
    dark = [dataclasses.replace(material, emission=np.zeros(3, np.float32)) for material in room_.materials]
    bright = [
        dataclasses.replace(lamp(0.4 + 0.27 * i, 3.1, 1.9, (60, 50, 40), "Lamps"), radius=0.1)
        for i in range(12)
    ]
    dim = dataclasses.replace(lamp(2, 1.1, 1.7, (0.2, 0.3, 0.1), "Panel"), radius=0.4)
    scene = dataclasses.replace(
        room_, lights=(*bright, dim), materials=tuple(dark), world=np.zeros(3, np.float32)
    )
    settings = dataclasses.replace(SETTINGS, max_bounces=1, light_samples=16)
    several = drive(scene, settings).passes["light_group Panel"]
    single = dataclasses.replace(scene, lights=(dim,))
    plain = dataclasses.replace(settings, outputs=("combined",))
    exact = drive(single, dataclasses.replace(plain, light_samples=1024)).passes["combined"]
    noise = off(drive(single, plain).passes["combined"], exact, exact)
    assert off(several, exact, exact) < 1.3 * noise + 0.01
