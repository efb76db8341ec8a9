"""Live converges to the light of a separate bake, without unnecessary work."""

import dataclasses
from itertools import pairwise

import numpy as np
import pyopencl as cl
import pytest

from engine import BakeResult, Light, Scene, SceneChanges, SceneError, Session, Settings, finished
from engine.device import device_array
from engine.gather.cached_gather import CachedGather
from engine.plan import stages
from engine.scene.model import NO_LIGHTMAP
from engine.visibility.rays.ray_sampler import RaySampler
from engine.visibility.rays.visible_backs import VisibleBacks
from tests.analytic.scenes import material, nine_quad_room, quads, rectangle
from tests.gpu.slice_sizes import fix_slice_size

SETTINGS = Settings(
    resolution=41, hemicube=8, samples=64, visibility="rays", light_samples=5, texel_samples=1,
)  # fmt: skip
BLACK = np.zeros(3, np.float32)


def open_room() -> Scene:
    """Return a room without a ceiling, below a bright sky, of three meshes; one is an occluder."""
    room = nine_quad_room()
    mesh = room.meshes[0]
    pillar, panel = mesh.face == 7, mesh.face == 6
    stays = (mesh.face != 1) & ~pillar & ~panel
    meshes = (
        dataclasses.replace(mesh.subset(stays), name="Room"),
        dataclasses.replace(mesh.subset(pillar), name="Pillar", atlas=NO_LIGHTMAP),
        dataclasses.replace(mesh.subset(panel), name="Panel"),
    )
    world = np.random.default_rng(11).random((5, 9, 3), np.float32)
    return dataclasses.replace(room, meshes=meshes, world=world)


ROOM = open_room()


def lamp(random: np.random.Generator) -> Light:
    """Return a lamp somewhere, perhaps inside or below something, strong or as good as off."""
    place = random.uniform(-0.3, 1.3, 3) * [4, 3, 2.5]
    strength = (random.random(3) * 10.0 ** random.integers(-3, 3)).astype(np.float32)
    kind = random.choice(["point", "sun", "spot", "area"])
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    size = random.random(2) + 0.01
    return Light("Lamp", str(kind), place, axes, strength, radius=0.1, half_angle=0.5, size=size)


def change_lights(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Add, delete, or replace a lamp."""
    lights = list(scene.lights)
    if lights and random.random() < 0.6:
        lights.pop(int(random.integers(len(lights))))
    if random.random() < 0.7:
        lights.append(lamp(random))
    return SceneChanges(lights=tuple(lights))


def change_world(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Take other surroundings, or none."""
    worlds = [BLACK, random.random(3, np.float32), random.random((3, 4, 3), np.float32)]
    return SceneChanges(world=worlds[random.integers(3)])


def change_colour(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Paint something, perhaps white as chalk or black."""
    number = int(random.integers(len(scene.materials)))
    colour = np.clip(random.uniform(-0.2, 1.1, 3), 0, 0.95).astype(np.float32)
    return SceneChanges(materials={number: dataclasses.replace(scene.materials[number], reflectance=colour)})


def change_emission(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Let something shine, or nothing more of it."""
    number = int(random.integers(len(scene.materials)))
    light = (random.random(3) * (random.random() < 0.6)).astype(np.float32)
    return SceneChanges(materials={number: dataclasses.replace(scene.materials[number], emission=light)})


def move_something(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Move the pillar or the panel by a little, perhaps into the floor."""
    matrix = np.eye(4)
    matrix[:3, 3] = random.uniform(-0.2, 0.2, 3)
    return SceneChanges(moves={int(random.integers(1, 3)): matrix})


def bend_something(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Deform the pillar or the panel: some of its corners go elsewhere."""
    number = int(random.integers(1, 3))
    mesh = scene.meshes[number]
    high = mesh.positions[..., 2:] > np.median(mesh.positions[..., 2])
    bent = mesh.positions + high * random.uniform(-0.15, 0.15, 3)
    return SceneChanges(meshes={number: dataclasses.replace(mesh, positions=bent.astype(np.float32))})


EDITS = [
    change_lights, change_lights, change_world, change_colour, change_emission,
    move_something, bend_something,
]  # fmt: skip


@pytest.fixture
def session():
    """What lives."""
    followed = Session()
    yield followed
    followed.close()


@pytest.fixture(scope="module")
def other():
    """What makes fresh bakes."""
    unaware = Session()
    yield unaware
    unaware.close()


def fresh(session: Session, scene: Scene, **changes: object) -> BakeResult:
    """Return a bake that knows nothing of others."""
    session.forget()
    return finished(session.bake(scene, dataclasses.replace(SETTINGS, **changes)))


def differences(image: np.ndarray, truth: np.ndarray, has_patch: np.ndarray) -> np.ndarray:
    """Return the difference of an image at each patch, relative to its light."""
    image, light = image[has_patch].sum(axis=1), truth[has_patch].sum(axis=1)
    least = max(1e-4 * float(light.mean()), 1e-12)
    relative: np.ndarray = (image - light) / np.maximum(light, least)
    return relative


def error(image: np.ndarray, truth: np.ndarray, has_patch: np.ndarray) -> float:
    """Return how much an image is off, mean over the patches, relative to each one's light."""
    return float(np.abs(differences(image, truth, has_patch)).mean())


def error_of_channels(image: np.ndarray, truth: np.ndarray, has_patch: np.ndarray) -> float:
    """Return how much the channels are off together, mean over the patches, relative to each one's light."""
    off = np.abs(image[has_patch] - truth[has_patch]).sum(axis=1)
    return float((off / np.maximum(truth[has_patch].sum(axis=1), 1e-12)).mean())


@pytest.mark.parametrize(("seed", "points"), [(0, 1), (1, 1), (2, 4)])
def test_twenty_edits_end_with_the_light_of_a_fresh_bake(session, other, seed, points):
    random = np.random.default_rng(seed)

    # A texel near the threshold of edges may have points in one of both bakes only. All later points then
    # have other random numbers, so images have another noise.
    of_display = 2 * SETTINGS.tolerance if points == 1 else 6 * SETTINGS.tolerance
    live = session.live(ROOM, dataclasses.replace(SETTINGS, texel_samples=points))
    finished(live.converge())
    for step in range(20):
        live.update(random.choice(EDITS)(live.scene, random))
        if random.random() < 0.3:
            next(live.converge())
            live.update(random.choice(EDITS)(live.scene, random))
        lightmap = finished(live.converge())
        if step % 5 == 4:
            expected = fresh(other, live.scene, texel_samples=points)
            assert error(lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance
            assert np.array_equal(lightmap.has_patch, expected.has_patch)
            off = differences(lightmap.display, expected.display, expected.known)
            assert np.abs(off).mean() < of_display and abs(off.mean()) < SETTINGS.tolerance


PAINTED = {0: dataclasses.replace(ROOM.materials[0], reflectance=np.float32([0.9, 0.5, 0.1]))}
SHINING = {0: dataclasses.replace(ROOM.materials[0], emission=np.float32([0.9, 0.6, 0.2]))}
MOVED = np.array([[1, 0, 0, 0.3], [0, 1, 0, -0.2], [0, 0, 1, 0], [0, 0, 0, 1]])
LIT = (Light("Lamp", "point", np.array([1.0, 2, 1.5]), np.eye(3), np.float32([5, 4, 3])),)


@pytest.mark.parametrize("accelerate", [True, False], ids=["accelerated", "plain"])
@pytest.mark.parametrize(
    ("edit", "least"),
    [
        (SceneChanges(lights=LIT, materials=PAINTED), 5),
        (SceneChanges(world=3 * ROOM.world[::-1].copy()), 4),
        (SceneChanges(materials=PAINTED), 3),
        (SceneChanges(materials=SHINING), 3),
        (SceneChanges(moves={1: MOVED}), 3),
    ],
    ids=["lamp and paint", "world", "paint", "emission", "move"],
)
def test_each_image_is_nearer_to_the_light_than_the_one_before(
    session, other, accelerate, edit, least, monkeypatch
):
    """A lamp comes on, or a wall is painted: the last light is right neither in sum nor in colour."""
    monkeypatch.setattr(stages, "_BETWEEN_IMAGES", 0.0)
    live = session.live(ROOM, dataclasses.replace(SETTINGS, accelerate=accelerate))
    last = finished(live.converge()).display
    live.update(edit)
    images = [step.intermediate for step in live.converge() if step.intermediate is not None]
    truth = fresh(other, live.scene, tolerance=0, max_bounces=30, hide_seams=False)
    if edit.materials is SHINING:
        # A wall's light is gathered: both images of direct light are those of before, but for their noise.
        images = images[2:]
    errors = [error(image, truth.display, truth.known) for image in images]
    assert len(errors) >= least and errors[-1] < SETTINGS.tolerance

    # Paint makes red light brighter and blue light darker, which cancels in the sum of the last light.
    before, first = (error_of_channels(image, truth.display, truth.known) for image in (last, images[0]))
    assert first < 0.9 * before
    assert all(later <= earlier + 1e-4 for earlier, later in pairwise(errors)), errors


def sweeps(session, changes, monkeypatch, **settings):
    """Return the sweeps of an edit before its first image, and all; its lightmap."""
    live, count, shown = session.live(ROOM, dataclasses.replace(SETTINGS, **settings)), [], []
    finished(live.converge())
    gather = CachedGather.gather
    monkeypatch.setattr(CachedGather, "gather", lambda *light: count.append(1) or gather(*light))
    live.update(changes)
    shown = [len(count) for step in live.converge() if step.intermediate is not None]
    monkeypatch.undo()
    return shown[0], len(count), live.lightmap


def test_light_that_was_not_reflected_is_swept_for_only_where_it_has_changed(session, other, monkeypatch):
    parts = {"outputs": ("combined", "direct", "indirect")}
    first, all_sweeps, world = sweeps(session, SceneChanges(world=2 * ROOM.world), monkeypatch, **parts)
    assert first == 1 and all_sweeps == world.report.iterations + 1
    first, all_sweeps, painted = sweeps(session, SceneChanges(materials=PAINTED), monkeypatch, **parts)
    assert first == 1 and all_sweeps == painted.report.iterations
    expected = fresh(
        other, dataclasses.replace(ROOM, materials=(*PAINTED.values(), *ROOM.materials[1:])), **parts
    )
    np.testing.assert_allclose(painted.passes["direct"], expected.passes["direct"], rtol=1e-5, atol=1e-6)
    for name in ("combined", "indirect"):
        assert error(painted.passes[name], expected.passes[name], expected.known) < 4 * SETTINGS.tolerance


def test_direct_light_of_samples_that_are_gone_is_found_again(session, other, monkeypatch):
    """What patches see is dropped between two edits, since it takes too much memory."""
    live = session.live(ROOM, dataclasses.replace(SETTINGS, cache_budget=1))
    finished(live.converge())
    live.update(SceneChanges(materials=PAINTED))
    lightmap, expected = finished(live.converge()), fresh(other, live.scene)
    assert error(lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance


def test_sweeps_that_are_faster_than_anybody_sees_have_one_image(session, other, monkeypatch):
    """Few rays, all rays, and light that has settled; what comes meanwhile goes on from the last image."""
    live = session.live(ROOM, SETTINGS)
    finished(live.converge())
    monkeypatch.setattr(stages, "_BETWEEN_IMAGES", 1e9)
    random = np.random.default_rng(8)
    for _ in range(3):
        live.update(SceneChanges(lights=(lamp(random),), world=ROOM.world * np.float32(random.random())))
        shown = [step.iteration for step in live.converge() if step.intermediate is not None]
        assert shown == [0, 0, live.lightmap.report.iterations] and shown[-1] > 1
        live.update(SceneChanges(lights=(lamp(random),)))
        for step in live.converge():
            if step.iteration == 2:
                break
    lightmap, expected = finished(live.converge()), fresh(other, live.scene)
    assert error(lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance


@pytest.mark.parametrize("edit", [{"world": 2 * ROOM.world}, {"materials": PAINTED}], ids=["world", "paint"])
def test_light_stays_on_the_device_until_the_first_image(session, other, edit, monkeypatch):
    """Nothing but the image comes from there, and what stands in for hidden patches."""
    live, came = session.live(ROOM, SETTINGS), []
    finished(live.converge())
    live.update(SceneChanges(**edit))
    fetch = device_array.download
    monkeypatch.setattr(device_array, "download", lambda *where: came.append(where[2]) or fetch(*where))
    work = live.converge()
    image = next(step.intermediate for step in work if step.intermediate is not None)
    assert all(shape[1] == 3 for shape in came) and image.any()
    lightmap, expected = finished(work), fresh(other, live.scene)
    assert error(lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance


def test_light_that_has_settled_takes_few_sweeps_to_settle_again(session):
    live = session.live(ROOM, SETTINGS)
    cold = finished(live.converge()).report.iterations
    live.update(SceneChanges(world=ROOM.world * np.float32(1.01)))
    assert finished(live.converge()).report.iterations < cold


def test_visibility_that_edits_interrupt_is_found_only_once(session, other, monkeypatch):
    """Somebody drags a lamp from the start: each patch looks once all the same."""
    random, found = np.random.default_rng(5), []
    find = RaySampler.find

    def counted(self, first, last, seen):
        work, before = find(self, first, last, seen), 0
        for done in work:
            found.append(round(done * (last - first)) - before)
            before = round(done * (last - first))
            yield done

    monkeypatch.setattr(RaySampler, "find", counted)
    fix_slice_size(monkeypatch, 256)
    live, edits = session.live(ROOM, SETTINGS), 0
    for progress in live.converge():
        if progress.stage.startswith("Visibility") and progress.fraction > 0 and edits < 4:
            live.update(SceneChanges(lights=(lamp(random),)))
            edits += 1
    assert edits and live.lightmap is not None
    count = live.lightmap.report.patches
    assert count <= sum(found) <= count + edits
    monkeypatch.undo()
    expected = fresh(other, live.scene)
    assert error(live.lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance


def test_changes_that_come_faster_than_images_do_not_keep_them_away(session):
    random, live = np.random.default_rng(6), session.live(ROOM, SETTINGS)
    finished(live.converge())
    shown = 0
    live.update(SceneChanges(lights=(lamp(random),)))
    for step, progress in enumerate(live.converge()):
        shown += progress.intermediate is not None
        if step < 40:
            live.update(SceneChanges(lights=(lamp(random),)))
    assert shown > 5


def test_what_cannot_be_baked_is_refused_and_leaves_all_as_it_was(session):
    live = session.live(ROOM, SETTINGS)
    lightmap = finished(live.converge())
    broken = dataclasses.replace(ROOM.materials[0], reflectance=np.float32([np.nan, 0, 0]))
    for changes in (SceneChanges(materials={0: broken}), SceneChanges(materials={99: broken})):
        with pytest.raises(SceneError):
            live.update(changes)
    assert live.lightmap is lightmap and live.scene is ROOM


def test_backs_that_do_not_fit_beside_what_is_kept_are_chosen_by_a_new_bake(session, other, monkeypatch):
    live = session.live(ROOM, SETTINGS)
    finished(live.converge())
    fail_once, refresh = iter([True]), VisibleBacks.refresh

    def full(self, make_tracer):
        if next(fail_once, False):
            raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")
        return refresh(self, make_tracer)

    monkeypatch.setattr(VisibleBacks, "refresh", full)
    lowered = np.eye(4)
    lowered[2, 3] = -7
    live.update(SceneChanges(moves={2: lowered}))
    lightmap = finished(live.converge())
    assert next(fail_once, None) is None
    expected = fresh(other, live.scene)
    assert lightmap.report.patches == expected.report.patches
    assert error(lightmap.image, expected.image, expected.has_patch) < 2 * SETTINGS.tolerance


def test_a_light_goes_out_and_comes_back(session):
    live = session.live(ROOM, SETTINGS)
    first = finished(live.converge())
    dark = {number: dataclasses.replace(paint, emission=BLACK) for number, paint in enumerate(ROOM.materials)}
    live.update(SceneChanges(lights=(), world=BLACK, materials=dark))
    assert not finished(live.converge()).display.any()
    live.update(ROOM)
    again = finished(live.converge())
    assert error(again.image, first.image, first.has_patch) < 2 * SETTINGS.tolerance


def test_floor_is_lit_where_a_box_stood(session, other):
    """The box touches it: what a face hides is dark, until that face is gone."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    charts = [(14 * (index % 2), 13 * (index // 2), 11, 11) for index in range(6)]
    box = quads(corners[np.array(sides)], charts, [0] * 6, 41, "Box")
    floor = quads(rectangle((-1, -1, 0), (4, 0, 0), (0, 4, 0))[None], [(2, 3, 36, 35)], [0], 41, "Floor")
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.ones(3, np.float32))
    meshes = floor, dataclasses.replace(box, atlas=1)
    scene = Scene(meshes, (material("Grey", 0.5),), ("Floor", "Box"), lights=(sun,))
    live = session.live(scene, SETTINGS)
    before = finished(live.converge())
    away = np.eye(4)
    away[:3, 3] = (1.7, 1.6, 0.4)
    live.update(SceneChanges(moves={1: away}))
    after, expected = finished(live.converge()), fresh(other, live.scene)
    assert ((before.image[0] == 0) & (expected.image[0] > 0.1)).any(axis=-1).sum() > 50
    assert np.array_equal(after.image == 0, expected.image == 0)
    np.testing.assert_allclose(after.display, expected.display, atol=0.01)


@pytest.mark.parametrize(
    "changes",
    [
        {"patch_groups": 2},
        {"method": "stream"},
        {"outputs": ("combined", "direct", "indirect", "directional")},
        {"method": "paper", "visibility": "raster", "accelerate": False},
    ],
    ids=["groups", "stream", "outputs", "paper"],
)
def test_every_way_to_bake_can_be_followed(session, other, changes):
    settings = dataclasses.replace(SETTINGS, **changes)
    live = session.live(ROOM, settings)
    finished(live.converge())
    paint = dataclasses.replace(ROOM.materials[0], reflectance=np.float32([0.9, 0.5, 0.1]))
    live.update(SceneChanges(materials={0: paint}, world=ROOM.world[::-1].copy()))
    lightmap = finished(live.converge())
    expected = fresh(other, live.scene, **changes)
    assert lightmap.passes.keys() == expected.passes.keys()
    for name in set(lightmap.passes) & {"combined", "direct", "indirect"}:
        close = error(lightmap.passes[name], expected.passes[name], expected.known)
        assert close < (8 if name == "indirect" else 3) * settings.tolerance, name


def test_live_starts_no_workers():
    """Each edit would wait for a scheduler, which keeps nothing of the one before."""
    live = Session().live(ROOM, dataclasses.replace(SETTINGS, scheduler="all"))
    lightmap = finished(live.converge())
    assert not any("Dask" in reason for reason in lightmap.report.reasons)


def test_light_groups_follow_edits(session, other):
    """A lamp of one group changes, a wall is painted, the world of another group is gone."""
    lamp = dataclasses.replace(LIT[0], light_group="Lamps")
    scene = dataclasses.replace(
        ROOM, lights=(lamp,), light_groups=("Lamps", "Outside"), world_light_group="Outside"
    )
    settings = dataclasses.replace(SETTINGS, outputs=("combined", "light_groups"), texel_samples=4)
    live = session.live(scene, settings)
    finished(live.converge())
    dim = dataclasses.replace(lamp, strength=0.3 * lamp.strength)
    for changes in (SceneChanges(lights=(dim,)), SceneChanges(materials=PAINTED), SceneChanges(world=BLACK)):
        live.update(changes)
        lightmap = finished(live.converge())
    other.forget()
    expected = finished(other.bake(live.scene, settings))
    assert set(lightmap.passes) == set(expected.passes) and len(lightmap.passes) >= 3
    for name, image in expected.passes.items():
        if image[expected.known].any():
            assert error(lightmap.passes[name], image, expected.known) < 4 * SETTINGS.tolerance, name
    assert not lightmap.passes["light_group Outside"].any()
