"""Light of patches from that of the groups around them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rooms import cornell_box
from engine import Settings
from engine.device.cl_device import ComputeDevice
from engine.outputs import OUTPUTS
from engine.patches.patch_scene import make_patch_scene
from engine.plan import memory
from engine.solve.interpolation import Interpolation
from engine.solve.patch_groups import PatchGroups, group_representatives, numbered
from engine.validity.invalid import patches_inside
from engine.visibility.rays.ray_scene import RayScene, openness
from tests.analytic.drive import drive
from tests.analytic.rooms import Atlas, block, scene_of
from tests.analytic.scenes import nine_quad_room
from tests.rows import long

WIDTH = 4


@pytest.fixture
def few_are_enough(monkeypatch):
    """Let light be interpolated in rooms of so few patches that each would gather for itself."""
    monkeypatch.setattr(memory, "_FEWEST", 4096)


@pytest.fixture(scope="module")
def room(graphics, compute):
    """The patches of a room of quads, groups of them, and what interpolates between these."""
    patch_scene = make_patch_scene(graphics, compute, nine_quad_room(), Settings(resolution=128))
    rays = RayScene(compute, patch_scene)
    dark = np.zeros(len(patch_scene.patches), np.float32)
    groups = PatchGroups(
        rays,
        patch_scene,
        patch_scene.geometry.area,
        group_representatives(rays, patch_scene, dark, patches_inside(rays, len(dark)), WIDTH),
        WIDTH,
    )
    opening = openness(rays, 2.0)
    return (
        patch_scene,
        groups,
        Interpolation(rays, patch_scene, groups.group, groups.representative, WIDTH, opening),
    )


def light_of(groups, values, front=1.0):
    """Return light of groups from that of patches, (n,), grey, as a layer."""
    layer = np.ones((len(groups.representative), 4), np.float32)
    layer[:, :3] = values[groups.representative, None]
    layer[:, 3] = np.broadcast_to(front, len(layer))
    return layer


def fit(room, layers, tolerance=0.02):
    """Return the light of patches, grey, of each layer, and which fit."""
    values, fits = room[2].fit(layers, np.zeros(len(room[0].patches), np.float32), tolerance)
    return [layer[:, 0] for layer in values], fits


def test_light_that_lies_in_a_plane_is_met(room):
    """Linear in the world is linear on each quad; where charts end it is left out."""
    center = room[0].geometry.center
    planes = [5 + center @ np.float32(slope) for slope in ((0.3, -0.2, 0.5), (-0.4, 0.1, 0.2))]
    values, fits = fit(room, [light_of(room[1], plane) for plane in planes])
    assert fits.mean() > 0.55
    for found, plane in zip(values, planes, strict=True):
        assert found[fits] == pytest.approx(plane[fits], rel=1e-4)


def test_what_planes_take_from_curved_light_is_put_back(room):
    """Planes lie below a dome of light: in coarse maps that was most of what *Adaptive* was too dark."""
    patch_scene, groups, interpolation = room
    off = patch_scene.geometry.center - patch_scene.geometry.center.mean(axis=0)
    dome = (5 - 0.1 * (off**2).sum(axis=1)).astype(np.float32)
    layers = [light_of(groups, dome)]
    values, fits = interpolation.fit(layers, np.zeros(len(dome), np.float32), 0.05)
    below = (values[0][fits, 0] - dome[fits]).mean()
    interpolation.put_back(layers, values, fits)
    left = (values[0][fits, 0] - dome[fits]).mean()
    assert fits.mean() > 0.5 and below < 0
    assert abs(left) < 0.35 * abs(below), (below, left)


def test_light_that_is_put_back_is_not_below_none(room):
    patch_scene, groups, interpolation = room
    dip = np.maximum(np.abs(patch_scene.geometry.center[:, 0] - 0.83) - 0.1, 0).astype(np.float32)
    layers, nothing = [light_of(groups, dip)], np.zeros(len(dip), np.float32)
    values, fits = interpolation.fit(layers, nothing, 1.0)
    signed = [values[0].copy()]
    interpolation.put_back(layers, values, fits)
    interpolation.put_back(layers, signed, fits, -np.inf)
    assert signed[0][fits, 0].min() < 0 <= values[0][fits, 0].min()


def test_noise_of_single_patches_is_taken_out_and_steps_stay(room, compute):
    """Planes through the light of nine patches have a third of its noise; what is a step keeps to itself."""
    patch_scene = room[0]
    rays, each = RayScene(compute, patch_scene), np.arange(len(patch_scene.patches))
    neighbours = Interpolation(rays, patch_scene, each, each, 1, openness(rays, 2.0))
    step = np.where(patch_scene.geometry.center[:, 0] > 0.83, 3, 1).astype(np.float32)
    exact = step + patch_scene.geometry.center @ np.float32([0.3, -0.2, 0.5])
    noise = 0.03 * np.random.default_rng(5).standard_normal(len(exact)).astype(np.float32)
    layer = np.ones((len(exact), 4), np.float32)
    layer[:, :3] = (exact + noise)[:, None]
    (values,), fits = neighbours.fit([layer], np.zeros(len(exact), np.float32), 0.075)
    assert 0.6 < fits.mean() < 0.95
    off = values[fits, 0] - exact[fits]
    assert np.sqrt((off**2).mean()) < 0.6 * 0.03
    assert np.abs(off).max() < 0.3


def test_values_of_both_signs_are_met_where_they_are_asked_for(room):
    patch_scene, groups, interpolation = room
    plane = patch_scene.geometry.center @ np.float32([0.3, -0.2, 0.5]) - 0.4
    assert (plane < -0.1).any() and (plane > 0.1).any()
    even, nothing = np.ones(len(plane), np.float32), np.zeros(len(plane), np.float32)
    layers = [light_of(groups, even), light_of(groups, plane)]
    (_, signed), fits = interpolation.fit(layers, nothing, 0.02, -np.inf)
    assert signed[fits, 0] == pytest.approx(plane[fits], abs=1e-4)
    (_, light), _ = interpolation.fit(layers, nothing, 0.02)
    assert light[fits, 0] == pytest.approx(np.maximum(plane, 0)[fits], abs=1e-4)


def test_patches_at_a_step_do_not_fit(room):
    patch_scene, groups, _ = room
    step = np.where(patch_scene.geometry.center[:, 0] > 0.83, 3.0, 1.0)
    (values,), fits = fit(room, [light_of(groups, step)])
    assert values[fits] == pytest.approx(step[fits], rel=1e-3)
    assert 0.3 < fits.mean() < 0.95


def test_charts_side_by_side_do_not_mix(room):
    """Each quad has a light of its own: what fits has that of its quad, though charts are 2 texels apart."""
    patch_scene, groups, _ = room
    own = 1 + (patch_scene.geometry.triangle // 2).astype(np.float32)
    (values,), fits = fit(room, [light_of(groups, own)])
    assert fits.mean() > 0.8
    assert values[fits] == pytest.approx(own[fits], rel=1e-4)


def test_groups_that_see_backs_do_not_count(room):
    patch_scene, groups, _ = room
    inside = patch_scene.geometry.center[:, 0] > 1.0
    front = np.where(inside[groups.representative], 0.5, 1.0)
    (values,), fits = fit(room, [light_of(groups, np.where(inside, 100.0, 1.0), front)])
    assert values[fits] == pytest.approx(1.0, rel=1e-3)
    far = patch_scene.geometry.center[:, 0] > 1.5
    assert far.any() and not fits[far].any()


def test_other_light_of_a_patch_hides_what_is_left_over(room):
    patch_scene, groups, interpolation = room
    noisy = 1 + 0.3 * np.random.default_rng(3).random(len(patch_scene.patches)).astype(np.float32)
    beside = np.where(patch_scene.geometry.center[:, 1] > 1.0, 50, 0).astype(np.float32)
    _, fits = interpolation.fit([light_of(groups, noisy)], beside, 0.02)
    assert fits[beside > 0].mean() > 0.75 and fits[beside == 0].mean() < 0.1


def test_patches_between_things_that_no_group_knows_do_not_fit(graphics, compute):
    """Two fins stand two texels apart between the leaders of groups, whose light is even."""
    atlas = Atlas(160)
    floor = block(atlas, (-1, -1, -0.4), (1, 1, 0), "Floor")
    fins = [block(atlas, (x, -0.9, -0.01), (x + 0.004, 0.9, 0.09), "Fin") for x in (-0.034, 0.046)]
    patch_scene = make_patch_scene(
        graphics, compute, scene_of([floor, *fins], world=np.ones(3, np.float32)), Settings(resolution=160)
    )
    rays = RayScene(compute, patch_scene)
    dark = np.zeros(len(patch_scene.patches), np.float32)
    group, representative = numbered(
        group_representatives(rays, patch_scene, dark, patches_inside(rays, len(dark)), WIDTH)
    )
    interpolation = Interpolation(rays, patch_scene, group, representative, WIDTH, openness(rays, 2.0))
    even = np.ones((len(representative), 4), np.float32)
    _, fits = interpolation.fit([even], np.zeros(len(dark), np.float32), 0.02)
    x, y, z = (patch_scene.geometry.center + patch_scene.triangles.origin).T
    floor = (np.abs(z) < 1e-4) & (patch_scene.geometry.geometric[:, 2] > 0.9) & (np.abs(y) < 0.8)
    between, away = floor & (np.abs(x - 0.008) < 0.035), floor & (np.abs(np.abs(x) - 0.5) < 0.2)
    assert between.sum() > 30 and away.sum() > 300
    assert not fits[between].any() and fits[away].all()


@pytest.mark.parametrize("outputs", [("combined", "direct", "indirect"), long(("combined",))])
def test_adaptive_bakes_show_the_same_light(outputs):
    """A ceiling behind a panel, which sees backs, is not taken for what is around it."""
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=152, samples=256, light_samples=64, visibility="rays", outputs=outputs, texel_samples=1,
        hide_seams=False, intermediates=False,
    )  # fmt: skip
    scene = cornell_box(152)
    truth, plain, adaptive = (
        drive(scene, replace(settings, **more))
        for more in ({"samples": 1024, "seed": 5}, {}, {"adaptive": True})
    )
    has_patch = truth.has_patch & truth.known
    mean = truth.image[has_patch].mean()
    errors = [
        np.sqrt((((lightmap.image - truth.image)[has_patch]) ** 2).mean()) / mean
        for lightmap in (plain, adaptive)
    ]
    assert "with more rays each" in adaptive.report.reasons[0]
    assert errors[1] < 1.1 * errors[0]
    for name in outputs:
        expected = truth.passes[name][has_patch].mean()
        assert adaptive.passes[name][has_patch].mean() == pytest.approx(expected, rel=0.01)


def test_adaptive_bakes_have_as_much_light():
    """Coarse ones were 0.4 % darker than those in which every patch gathers, and indirect light 0.8 %."""
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=160, samples=256, visibility="rays", hide_seams=False, intermediates=False
    )  # fmt: skip
    coarse, fine = (drive(cornell_box(160), replace(settings, adaptive=value)) for value in (True, False))
    assert "with more rays each" in coarse.report.reasons[0]
    shown = coarse.known & fine.known
    assert coarse.display[shown].mean() == pytest.approx(fine.display[shown].mean(), rel=2e-3)


def test_groups_of_bright_patches_are_as_even_as_others(graphics, compute):
    """Around a lamp below a ceiling light falls off within a square: its hidden part is not that in sight."""
    patch_scene = make_patch_scene(graphics, compute, nine_quad_room(), Settings(resolution=128))
    rays, center = RayScene(compute, patch_scene), patch_scene.geometry.center
    radiance = (0.05 / (0.005 + ((center - center[len(center) // 3]) ** 2).sum(axis=1))).astype(np.float32)
    representative = group_representatives(
        rays, patch_scene, radiance, patches_inside(rays, len(radiance)), WIDTH
    )
    apart = np.abs(radiance - radiance[representative])
    assert radiance.max() > 20 * radiance.mean()
    assert (apart <= 0.5 * radiance.mean() + 0.1 * radiance).all()
    assert len(np.unique(representative)) < len(representative) / 8


def test_patches_without_lightmap_stay_alone(room, compute):
    """Those before them are grouped as without the limit."""
    patch_scene, _, _ = room
    rays, dark = RayScene(compute, patch_scene), np.zeros(len(patch_scene.patches), np.float32)
    mapped = len(dark) // 3
    representative = group_representatives(
        rays, patch_scene, dark, patches_inside(rays, len(dark)), WIDTH, mapped
    )
    assert (representative[mapped:] == np.arange(mapped, len(dark))).all()
    assert len(np.unique(representative[:mapped])) < mapped / 2


def test_leaders_are_in_the_middle_of_their_groups(room):
    """On the mean of all they are off by nothing, though squares of four have no texel in the middle."""
    patch_scene, groups, _ = room
    resolution, texel = patch_scene.patches.resolution, patch_scene.patches.texel
    at = np.stack([texel % resolution, texel // resolution], axis=1).astype(float)
    members = np.bincount(groups.group)
    middle = np.stack([np.bincount(groups.group, weights=axis) / members for axis in at.T], axis=1)
    off = at[groups.representative] - middle
    assert np.abs(off).max() <= 1.0
    assert np.abs(np.average(off, axis=0, weights=members)).max() < 0.05


@pytest.mark.parametrize("output", ["directional", long("spherical_harmonics")])
def test_adaptive_bakes_tell_where_light_comes_from(few_are_enough, output):
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=80, samples=128, visibility="rays", outputs=("combined", output), texel_samples=1,
        hide_seams=False, intermediates=False,
    )  # fmt: skip
    scene = cornell_box(80)
    truth, plain, adaptive = (
        drive(scene, replace(settings, **more))
        for more in ({"samples": 1024, "seed": 5}, {}, {"adaptive": True})
    )
    assert "with more rays each" in adaptive.report.reasons[0]
    inside = truth.has_patch & truth.known
    for name in OUTPUTS[output].maps:
        exact = truth.passes[name][inside]
        off = [np.abs(bake.passes[name][inside] - exact) for bake in (plain, adaptive)]
        assert np.abs(exact).mean() > 4 * off[1].mean()
        for part in (0.5, 0.9, 0.99):
            assert np.quantile(off[1], part) < 1.1 * np.quantile(off[0], part) + 1e-6


@pytest.mark.parametrize("outputs", [("combined", "direct", "indirect"), long(("combined",))])
def test_noise_of_few_patches_is_taken_out(outputs):
    """All of them gather; then most have the light of planes through that of those around them."""
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=97, samples=64, visibility="rays", texel_samples=1, hide_seams=False, intermediates=False,
        outputs=outputs,
    )  # fmt: skip
    truth, plain, adaptive = (
        drive(cornell_box(97), replace(settings, **more))
        for more in ({"samples": 1024, "seed": 5}, {}, {"adaptive": True})
    )
    lit = truth.has_patch & truth.known
    assert any("lies in a plane" in reason for reason in adaptive.report.reasons)
    assert plain.report.patches == adaptive.report.patches < memory._FEWEST
    for name in outputs:
        exact = truth.passes[name][lit]
        noise, left = (
            np.sqrt(((bake.passes[name][lit] - exact) ** 2).mean()) / exact.mean()
            for bake in (plain, adaptive)
        )
        assert left < (0.65 if name != "direct" else 1.01) * noise
        assert adaptive.passes[name][lit].mean() == pytest.approx(exact.mean(), rel=0.01)
    if len(outputs) > 1:
        parts = adaptive.passes["direct"] + adaptive.passes["indirect"]
        assert parts[lit] == pytest.approx(adaptive.passes["combined"][lit], abs=1e-4)


def test_directions_of_few_patches_follow_their_light():
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=61, samples=64, visibility="rays", outputs=("combined", "directional"), texel_samples=1,
        hide_seams=False, intermediates=False,
    )  # fmt: skip
    truth, plain, adaptive = (
        drive(cornell_box(61), replace(settings, **more))
        for more in ({"samples": 1024, "seed": 5}, {}, {"adaptive": True})
    )
    lit = truth.has_patch & truth.known
    for name in OUTPUTS["directional"].maps:
        exact = truth.passes[name][lit]
        noise, left = (np.median(np.abs(bake.passes[name][lit] - exact)) for bake in (plain, adaptive))
        assert left < 0.85 * noise


@pytest.mark.parametrize("changes", [{"outputs": ("direct",)}, {"patch_groups": 1}, {"method": "stream"}])
def test_patches_keep_their_own_light_where_the_settings_say_so(changes):
    settings = Settings(
        resolution=37, samples=32, visibility="rays", texel_samples=1, intermediates=False, **changes
    )
    plain, adaptive = (drive(nine_quad_room(), replace(settings, adaptive=on)) for on in (False, True))
    assert np.array_equal(plain.image, adaptive.image)


def sunk_box():
    """Return a floor and a box whose lower fifth is beneath it, under an even sky."""
    atlas = Atlas(160)
    floor = block(atlas, (-1, -1, -0.4), (1, 1, 0), "Floor")
    box = block(atlas, (-0.33, -0.29, -0.11), (0.31, 0.37, 0.47), "Box")
    return scene_of([floor, box], reflectance=0.6, world=np.ones(3, np.float32))


def test_patches_inside_of_things_and_outside_are_not_one(graphics, compute):
    patch_scene = make_patch_scene(graphics, compute, sunk_box(), Settings(resolution=160))
    rays = RayScene(compute, patch_scene)
    dark = np.zeros(len(patch_scene.patches), np.float32)
    representative = group_representatives(rays, patch_scene, dark, patches_inside(rays, len(dark)), WIDTH)
    center, radius = patch_scene.geometry.center + patch_scene.triangles.origin, 0.2
    on_floor = np.abs(center[:, 2]) < 1e-4
    inside = on_floor & (np.abs(center[:, :2] - (-0.01, 0.04)).max(axis=1) < radius)
    outside = on_floor & (np.abs(center[:, :2]).max(axis=1) > 0.4)
    assert inside.sum() > 30 and outside.sum() > 300
    beneath = (center[:, 2] < -0.02) & (np.abs(center[:, :2]).max(axis=1) < 0.4)
    above = (center[:, 2] > 0.02) & (center[:, 2] < 0.4)
    for one, other in ((inside, outside), (beneath, above)):
        assert not np.intersect1d(representative[one], representative[other]).size


def test_light_at_the_foot_of_a_sunk_box_is_that_without_groups(few_are_enough):
    if not ComputeDevice().processor:
        pytest.skip("graphics cards gather for every patch")
    settings = Settings(
        resolution=160, samples=512, visibility="rays", texel_samples=1, hide_seams=False, intermediates=False
    )
    scene = sunk_box()
    plain, adaptive = (drive(scene, replace(settings, adaptive=on)) for on in (False, True))
    lit = plain.has_patch & plain.known
    assert "with more rays each" in adaptive.report.reasons[0]
    assert np.array_equal(lit, adaptive.has_patch & adaptive.known)
    off = np.abs(adaptive.image - plain.image)[lit] / plain.image[lit].mean()
    assert np.quantile(off, 0.999) < 0.1
