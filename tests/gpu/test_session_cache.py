"""A bake with the geometry of the last one gives the light of a new bake without new visibility."""

import dataclasses
from collections import Counter

import numpy as np
import pyopencl as cl
import pytest

from engine import BakeResult, DeviceError, Light, Scene, Settings, bake, finished, progress
from engine.direct import emitter_cache
from engine.direct.lighting import DirectLighting
from engine.gather import background_light, visibility_cache
from engine.plan import choose_solver, solve_job
from engine.postprocess import texel_cache
from engine.scene.model import NO_LIGHTMAP
from engine.session import Session
from engine.setting_types import VISIBILITY
from engine.settings import descriptions
from engine.visibility.rays.ray_sampler import RaySampler
from engine.worker.worker import Worker
from tests.analytic.scenes import nine_quad_room
from tests.gpu.slice_sizes import fix_slice_size
from tests.transparency import CLEAR_BACK, transparent

SETTINGS = Settings(
    resolution=67, hemicube=8, samples=132, max_bounces=5, tolerance=0, visibility="rays", light_samples=5,
    texel_samples=1, intermediates=False,
)  # fmt: skip


def lamp(*position: float) -> Light:
    """Return a lamp in a room."""
    return Light("Lamp", "point", np.array(position), np.eye(3), np.float32([5, 4, 3]))


def open_room() -> Scene:
    """Return a room without a ceiling, below a bright sky; one panel shows its back, one is an occluder."""
    room = nine_quad_room()
    mesh = room.meshes[0]
    stays, pillar = mesh.face != 1, mesh.face == 7
    shown = dataclasses.replace(mesh.subset(stays & ~pillar), name="Room")
    seen = dataclasses.replace(mesh.subset(pillar), name="Pillar", atlas=NO_LIGHTMAP)
    world = np.random.default_rng(11).random((5, 9, 3), np.float32)
    return dataclasses.replace(room, meshes=(shown, seen), world=world, lights=(lamp(1, 2, 1.5),))


def coloured(scene: Scene, index: int, **changes: object) -> Scene:
    """Return a scene with another material."""
    materials = list(scene.materials)
    materials[index] = dataclasses.replace(materials[index], **changes)
    return dataclasses.replace(scene, materials=tuple(materials))


ROOM = open_room()
RED, WARM = np.float32([0.9, 0.1, 0.2]), np.float32([0.3, 0.2, 0.1])
WORLD = np.random.default_rng(12).random((3, 4, 3), np.float32)

#: Edits after which what patches see is kept: scenes and settings.
RELIT = {
    "nothing": (ROOM, {}),
    "lamp": (dataclasses.replace(ROOM, lights=(lamp(3, 1, 2), lamp(2, 2, 2))), {}),
    "no lamp": (dataclasses.replace(ROOM, lights=()), {}),
    "world": (dataclasses.replace(ROOM, world=WORLD), {}),
    "black world": (dataclasses.replace(ROOM, world=np.zeros(3, np.float32)), {}),
    "reflectance": (coloured(ROOM, 0, reflectance=RED), {}),
    "emission of fronts": (coloured(ROOM, 1, emission=WARM), {}),
    "emission of backs": (coloured(ROOM, 3, emission=WARM), {}),
    "light whose back is seen": (ROOM, {"sample_emission": False}),
    "max_bounces": (ROOM, {"max_bounces": 3, "accelerate": False}),
    "outputs": (ROOM, {"outputs": ("combined", "direct", "indirect")}),
    "samples of direct light": (ROOM, {"light_samples": 11}),
    "display": (ROOM, {"hide_seams": False, "margin": 0, "texel_samples": 4}),
}


def moved(scene: Scene, name: str, by: float) -> Scene:
    """Return a scene whose first mesh has other positions or UVs."""
    first, *rest = scene.meshes
    changed = dataclasses.replace(first, **{name: getattr(first, name) * np.float32(by)})
    return dataclasses.replace(scene, meshes=(changed, *rest))


#: Edits after which it is found anew.
CHANGED = {
    "transform": (moved(ROOM, "positions", 1.01), {}),
    "UVs": (moved(ROOM, "uvs", 0.99), {}),
    "transparency": (coloured(ROOM, 3, transmission=transparent(0.4)), {}),
    "clear back": (coloured(ROOM, 3, transmission=CLEAR_BACK), {}),
    "resolution": (ROOM, {"resolution": 53}),
    "rays": (ROOM, {"samples": 256}),
    "seed": (ROOM, {"seed": 7}),
    "groups": (ROOM, {"patch_groups": 2}),
    "directional maps": (ROOM, {"outputs": ("combined", "directional")}),
    "drawing": (ROOM, {"visibility": "raster"}),
    "no bounces": (ROOM, {"outputs": ("direct",)}),
}


@pytest.fixture(scope="module")
def session():
    kept_session = Session()
    yield kept_session
    kept_session.close()


def was_kept(lightmap: BakeResult) -> bool:
    """Return whether the report tells that visibility was kept."""
    return any("Visibility was kept from the last bake" in reason for reason in lightmap.report.reasons)


def assert_same(relit: BakeResult, fresh: BakeResult) -> None:
    """Two bakes give the same bits."""
    assert relit.passes.keys() == fresh.passes.keys()
    for name, image in fresh.passes.items():
        assert np.array_equal(relit.passes[name].view(np.uint32), image.view(np.uint32)), name
    assert np.array_equal(relit.image.view(np.uint32), fresh.image.view(np.uint32))
    assert relit.report.added_flux == fresh.report.added_flux
    assert relit.report.warnings == fresh.report.warnings


@pytest.mark.parametrize("edit", RELIT)
def test_other_light_is_baked_from_what_was_kept(session, edit):
    scene, changes = RELIT[edit]
    settings = dataclasses.replace(SETTINGS, **changes)
    finished(session.bake(ROOM, SETTINGS))
    relit = finished(session.bake(scene, settings))
    assert was_kept(relit) and relit.report.method == "cached"
    assert_same(relit, finished(bake(scene, settings)))


@pytest.mark.parametrize("edit", CHANGED)
def test_what_changes_visibility_is_found_anew(session, edit):
    scene, changes = CHANGED[edit]
    settings = dataclasses.replace(SETTINGS, **changes)
    finished(session.bake(ROOM, SETTINGS))
    again = finished(session.bake(scene, settings))
    assert not was_kept(again)
    assert_same(again, finished(bake(scene, settings)))


def test_what_follows_from_geometry_alone_is_made_once(session, monkeypatch):
    """Faces near patches are looked for again where others shine, and another sky is summed up again."""
    made = Counter()

    def counted(module, name):
        real = getattr(module, name)

        def call(*arguments):
            made[name] += 1
            return real(*arguments)

        return call

    for module, name in (
        (texel_cache, "surface_areas"), (texel_cache, "TexelClipper"), (solve_job, "open_sky"),
        (emitter_cache, "split_sky"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, counted(module, name))
    near_faces = DirectLighting.contacts

    def near(lighting):
        made[lighting._ray_scene.count] += 1
        return near_faces(lighting)

    monkeypatch.setattr(DirectLighting, "contacts", near)
    settings = dataclasses.replace(SETTINGS, texel_samples=16)
    session.forget()
    painted = [coloured(ROOM, 0, **{name: RED}) for name in ("reflectance", "emission")]
    scenes = (ROOM, RELIT["lamp"][0], *painted, RELIT["world"][0])
    relit = [finished(session.bake(scene, settings)) for scene in scenes]
    assert made["surface_areas"] == made["TexelClipper"] == 1
    assert made["open_sky"] == made["split_sky"] == 2
    assert made[relit[0].report.patches] == 3
    for scene, lightmap in zip(scenes, relit, strict=True):
        assert_same(lightmap, finished(bake(scene, settings)))


@pytest.mark.parametrize(
    "changes",
    [
        {"visibility": "raster"},
        {"directions": "hemicube"},
        {"patch_groups": 2},
        {"outputs": ("combined", "directional", "dominant_direction")},
        {"method": "stream"},
        {"method": "paper", "visibility": "raster", "accelerate": False},
    ],
    ids=["drawn", "hemicubes", "groups", "directional", "stream", "paper"],
)
def test_every_way_to_bake_can_follow_itself(session, changes):
    """Methods that keep no visibility keep patches; light decides which groups there are."""
    settings = dataclasses.replace(SETTINGS, **changes)
    finished(session.bake(ROOM, settings))
    scene = dataclasses.replace(coloured(ROOM, 0, reflectance=RED), world=WORLD)
    relit = finished(session.bake(scene, settings))
    assert settings.patch_groups or was_kept(relit) == (settings.method == "auto")
    assert_same(relit, finished(bake(scene, settings)))


def test_groups_that_light_leaves_as_they_are_are_kept(session):
    settings = dataclasses.replace(SETTINGS, patch_groups=2)
    finished(session.bake(ROOM, settings))
    scene = dataclasses.replace(ROOM, world=ROOM.world * np.float32(0.9))
    relit = finished(session.bake(scene, settings))
    assert was_kept(relit)
    assert_same(relit, finished(bake(scene, settings)))


def test_emission_of_backs_that_stays_is_kept(session):
    """Only a change of what is seen from behind needs new rays."""
    shining = coloured(ROOM, 3, emission=WARM)
    finished(session.bake(shining, SETTINGS))
    relit = finished(session.bake(dataclasses.replace(shining, world=WORLD), SETTINGS))
    assert was_kept(relit)
    assert_same(relit, finished(bake(dataclasses.replace(shining, world=WORLD), SETTINGS)))


def test_light_that_was_off_finds_what_patches_see_later(session):
    """A black scene looks for nothing, and keeps what the bake before it found."""
    dark = dataclasses.replace(ROOM, world=np.zeros(3, np.float32), lights=())
    dark = coloured(dark, 5, emission=np.zeros(3, np.float32))
    finished(session.bake(ROOM, SETTINGS))
    assert finished(session.bake(dark, SETTINGS)).report.method == "none"
    assert was_kept(finished(session.bake(ROOM, SETTINGS)))


def test_what_takes_more_than_its_budget_is_not_kept(session):
    small = dataclasses.replace(SETTINGS, cache_budget=1 << 16)
    finished(session.bake(ROOM, small))
    assert not was_kept(finished(session.bake(ROOM, small)))
    session.forget()
    finished(session.bake(ROOM, SETTINGS))
    session.forget()
    assert not was_kept(finished(session.bake(ROOM, SETTINGS)))


@pytest.mark.parametrize("piece", [1 << 30, 311 * 264], ids=["one piece", "several pieces"])
@pytest.mark.parametrize("part", [0.3, 0.9])
def test_a_part_that_fits_its_budget_is_reused(session, monkeypatch, piece, part):
    """Relighting gives the bits of a new bake and traces visibility for the other patches only."""
    monkeypatch.setattr(visibility_cache, "_PIECE", piece)
    session.forget()
    first = finished(session.bake(ROOM, SETTINGS))
    patches = first.report.patches
    backs = 20 * patches + -(-(patches + 1) // 4) * 4
    budget = backs + int(264 * patches * part) + 7
    small = dataclasses.replace(SETTINGS, cache_budget=budget)
    traced = []
    find = RaySampler.find

    def noted(sampler, first, last, seen):
        traced.append((first, last))
        return find(sampler, first, last, seen)

    finished(session.bake(ROOM, small))
    monkeypatch.setattr(RaySampler, "find", noted)
    for edit in ("world", "lamp"):
        traced.clear()
        scene, changes = RELIT[edit]
        relit = finished(session.bake(scene, dataclasses.replace(small, **changes)))
        assert sum(last - first for first, last in traced) == patches - int(patches * part)
        kept = f"{int(patches * part) / patches:.0%} of the texels"
        assert any(kept in why for why in relit.report.reasons)
        assert_same(relit, finished(bake(scene, dataclasses.replace(SETTINGS, **changes))))


def test_a_part_that_cannot_be_copied_is_dropped(session, monkeypatch):
    """The copy needs memory beside the rows; the light of the bake is finished by then."""

    def full(cache, last):
        raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")

    session.forget()
    patches = finished(session.bake(ROOM, SETTINGS)).report.patches
    small = dataclasses.replace(SETTINGS, cache_budget=16 * patches + 200 * patches)
    with monkeypatch.context() as patch:
        patch.setattr(visibility_cache.VisibilityCache, "_cut_last_piece", full)
        finished(session.bake(ROOM, small))
    again = finished(session.bake(ROOM, small))
    assert not any("kept" in why for why in again.report.reasons)


def test_another_sky_is_summed_up_in_slices(session, monkeypatch):
    """What takes seconds in a large scene tells how far it is; the same sky is not summed up again."""
    finished(session.bake(ROOM, SETTINGS))
    fix_slice_size(monkeypatch, 256)
    monkeypatch.setattr(progress, "_STEP", 0)
    scene, _ = RELIT["world"]
    for steps in (4, 0):
        told = [step.fraction for step in session.bake(scene, SETTINGS) if step.stage == "Bounce 1"]
        between = [fraction for fraction in told if 0 < fraction < 1]
        assert told == sorted(told) and (len(between) > steps if steps else not between)


def test_a_full_device_drops_what_is_kept_first(session, monkeypatch):
    finished(session.bake(ROOM, SETTINGS))
    scene, _ = RELIT["world"]
    fail_once = iter([True])
    sum_up = background_light.BackgroundLight.sum_up

    def full(self, *arguments):
        if next(fail_once, False):
            raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")
        return sum_up(self, *arguments)

    monkeypatch.setattr(background_light.BackgroundLight, "sum_up", full)
    again = finished(session.bake(scene, SETTINGS))
    assert not was_kept(again)
    assert_same(again, finished(bake(scene, SETTINGS)))


def test_a_device_that_is_too_small_is_tried_no_more_than_twice(session, monkeypatch):
    def full(*arguments):
        raise cl.MemoryError("MEM_OBJECT_ALLOCATION_FAILURE")

    finished(session.bake(ROOM, SETTINGS))
    monkeypatch.setattr(choose_solver, "DeviceRadiosity", full)
    with pytest.raises(DeviceError, match="not enough"):
        finished(session.bake(ROOM, SETTINGS))


def test_settings_invalidate_nothing_but_cached_data():
    """A setting that declares nothing invalidates visibility."""
    declared = {name: entry.invalidates for name, entry in descriptions().items()}
    assert {data for every in declared.values() for data in every} == {VISIBILITY}
    assert declared["margin"] == declared["tolerance"] == () and declared["samples"] == (VISIBILITY,)


def test_the_worker_keeps_it_too():
    worker = Worker()
    scene, _ = RELIT["lamp"]
    try:
        finished(worker.bake(ROOM, SETTINGS))
        relit = finished(worker.bake(scene, SETTINGS))
    finally:
        worker.stop()
    assert was_kept(relit)
    assert_same(relit, finished(bake(scene, SETTINGS)))
