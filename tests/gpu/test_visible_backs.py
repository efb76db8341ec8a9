"""Back faces that something sees get patches; others, as the outer sides of a room, do not."""

import gc
import weakref
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from engine import Scene, Settings, bake, finished
from engine.device.cl_device import ComputeDevice
from engine.patches.backs import with_places
from engine.patches.unmapped_meshes import texel_size
from engine.progress import map_progress
from engine.scene.cutouts import read_cutouts
from engine.scene.model import NO_LIGHTMAP
from engine.scene.triangles import join_meshes
from engine.visibility.rays import visible_backs
from engine.visibility.rays.back_rays import BackRays
from engine.visibility.rays.ray_scene import make_tracer
from engine.visibility.rays.visible_backs import VisibleBacks
from tests.analytic.rooms import Atlas, block, room
from tests.analytic.scenes import material, quads, rectangle
from tests.gpu.graphics_card import GraphicsCard

RESOLUTION = 131
X, Y, Z = np.eye(3)
TEXEL = 0.03
DEVICES = {"processor": ComputeDevice, "card": GraphicsCard, "shaders": lambda: None}


def card(corner, across, along, name="Card"):
    """Return a rectangle of 11 x 9 texels."""
    return quads(rectangle(corner, across, along)[None], [(110, 110, 11, 9)], [0], RESOLUTION, name)


def open_room(origin=(0, 0, 0)):
    """Return a room without its ceiling, seen from inside."""
    made = room(Atlas(RESOLUTION), np.add(origin, (0, 0, 0)), np.add(origin, (1.1, 0.9, 0.7)), "Room")
    return made.subset(made.face != 1)


@pytest.fixture(scope="module", params=DEVICES)
def tracer(request, graphics):
    """Make ray tracers on an OpenCL device, or by compute shaders."""
    return partial(make_tracer, graphics, DEVICES[request.param]())


def with_visible(tracer, meshes, materials=()):
    """Return by mesh name how many of its triangles have back faces."""
    scene = Scene(tuple(meshes), (material("Grey", 0.5), *materials))
    found = with_places(
        scene, RESOLUTION, find_visible=partial(VisibleBacks().of, tracer, resolution=RESOLUTION)
    )
    backs = [mesh for mesh in found.meshes if mesh.front is not None]
    return {
        mesh.name: sum(len(back.positions) for back in backs if back.name == mesh.name) for mesh in meshes
    }


@pytest.mark.parametrize("origin", [(0, 0, 0), (700, -400, 30)])
def test_outer_sides_of_a_room_have_no_patches_and_a_card_in_it_has(tracer, origin):
    inside = card(np.add(origin, (0.3, 0.2, 0.25)), 0.4 * X, 0.3 * Y)
    assert with_visible(tracer, [open_room(origin), inside]) == {"Room": 0, "Card": 2}


def test_an_occluder_sees_the_outer_side_of_a_wall(tracer):
    occluder = card((1.5, 0.1, 0.1), 0.5 * Z, 0.5 * Y, "Occluder")
    occluder = replace(occluder, atlas=NO_LIGHTMAP)
    assert with_visible(tracer, [open_room(), occluder]) == {"Room": 2, "Occluder": 0}


def test_a_large_occluder_leaves_the_texel_of_rays_as_it_is():
    """Its own chart has coarse texels, which count neither for the height of rays nor for their number."""
    occluder = replace(card((-40, -40, 5), 80 * X, 80 * Y, "Occluder"), atlas=NO_LIGHTMAP)
    scene, texels = Scene((open_room(), occluder), (material("Grey", 0.5),)), []

    def find_visible(placed, is_chosen, texel):
        texels.append(texel)
        assert texel_size(placed, RESOLUTION) > 2 * texel
        return is_chosen

    with_places(scene, RESOLUTION, find_visible=find_visible)
    assert texels == [texel_size(replace(scene, meshes=(open_room(),)), RESOLUTION)]


@pytest.mark.parametrize(("height", "count"), [(0.0, 0), (0.2, 10)])
def test_a_box_without_a_bottom_shows_its_inside_only_above_the_floor(tracer, height, count):
    floor = card((-1, -1, 0), 3 * X, 3 * Y, "Floor")
    box = block(Atlas(RESOLUTION), (0.2, 0.2, height), (0.7, 0.6, height + 0.5), "Box")
    assert with_visible(tracer, [floor, box.subset(box.face != 0)]) == {"Floor": 0, "Box": count}


def test_a_ray_through_an_edge_shows_nothing_of_the_inside_of_a_box(tracer):
    """Rays exactly through an edge may miss both triangles; seed 26 has one in 65,000 rays of the floor."""
    floor = quads(rectangle((-1, -1, 0), 2 * X, 2 * Y)[None], [(0, 0, 127, 127)], [0], RESOLUTION, "Floor")
    generator = np.random.default_rng(26)
    turn, height = generator.uniform(0, 3), generator.uniform(0.2, 1)
    across = 0.71 * (np.cos(turn) * X + np.sin(turn) * Y)
    along = 0.71 * (np.cos(turn) * Y - np.sin(turn) * X)
    low, high = np.array((*generator.uniform(-0.3, 0.3, 2), 0)), height * Z
    box = quads(
        np.stack([
            rectangle(low + high, across, along), rectangle(low, across, high),
            rectangle(low + along, high, across), rectangle(low, high, along),
            rectangle(low + across, along, high),
        ]),
        [(0, 0, 1, 1)] * 5, [0] * 5, RESOLUTION, "Box",
    )  # fmt: skip
    assert with_visible(tracer, [floor, replace(box, atlas=NO_LIGHTMAP)]) == {"Floor": 0, "Box": 0}


def test_all_of_the_inside_of_a_tube_is_visible(tracer):
    """Fronts see what is near its end; backs that are visible see the rest."""
    wide, high = np.array([(0, 0, 0), (0.4, 0, 0), (0.4, 0.4, 0), (0, 0.4, 0)]), 0.2 * Z
    sides = [
        rectangle(wide[side] + step * high, wide[(side + 1) % 4] - wide[side], high)
        for step in range(12)
        for side in range(4)
    ]
    charts = [(3 * (k % 24), 3 * (k // 24), 2, 1) for k in range(len(sides))]
    tube = quads(np.stack(sides), charts, [0] * len(sides), RESOLUTION, "Tube")
    assert with_visible(tracer, [tube, card((-0.3, -0.3, 2.6), Y, X)])["Tube"] == 96


def test_all_of_the_underside_of_a_low_roof_is_visible(tracer):
    """Probes from the middle of the floor meet back faces only, but these are visible from its edges."""
    floor = card((0, 0, 0), 24 * X, 24 * Y, "Floor")
    tiles = [rectangle((2 * i, 2 * j, 1), 2 * X, 2 * Y) for i in range(12) for j in range(12)]
    charts = [(3 * (k % 24), 3 * (k // 24), 2, 2) for k in range(len(tiles))]
    roof = quads(np.stack(tiles), charts, [0] * len(tiles), RESOLUTION, "Roof")
    visible = with_visible(tracer, [floor, roof])
    assert visible["Floor"] == 0 and 280 <= visible["Roof"] <= 288


@pytest.mark.parametrize("on_cpu", [False, True])
def test_rays_follow_the_number_of_texels_up_to_the_limit_of_the_device(tracer, on_cpu, monkeypatch):
    """Several lightmaps of 4096 texels once shared 4 million rays, so small backs among them were missed."""
    wall = quads(rectangle((0, 0, 0), X, Y)[None], [(0, 0, 131, 131)], [0], RESOLUTION, "Wall")
    scene = Scene((wall, card((0, 0, 0.5), 0.3 * X, 0.3 * Y)), (material("Grey", 0.5),))
    candidates = np.ones(4, bool)

    def visible(resolution):
        return VisibleBacks().of(tracer, scene, candidates, TEXEL, resolution)

    assert visible(RESOLUTION).tolist() == [False, False, True, True]
    counts = []

    class Rays:
        def __init__(self, rays):
            counts.append(rays.count)

        def hit_backs(self, known):
            yield
            return np.zeros_like(known)

    monkeypatch.setattr(visible_backs, "_caster", lambda *_: Rays)
    monkeypatch.setattr(visible_backs, "draws_on_cpu", lambda name: on_cpu)
    monkeypatch.setattr(ComputeDevice, "processor", on_cpu)
    monkeypatch.setattr(GraphicsCard, "processor", on_cpu)
    visible(4096)
    if on_cpu:
        assert counts[0] == 1 << 22
    else:
        assert 64e6 < counts[0] < 69e6


def test_a_choice_yields_between_launches_whose_size_changes_nothing(tracer, monkeypatch):
    """The bake can be cancelled there."""
    for name in ("_LAUNCH_CPU", "_LAUNCH_GPU"):
        monkeypatch.setattr(visible_backs, name, 9973)
    wall = quads(rectangle((0, 0, 0), X, Y)[None], [(0, 0, 131, 131)], [0], RESOLUTION, "Wall")
    scene = Scene((wall, card((0, 0, 0.5), 0.3 * X, 0.3 * Y)), (material("Grey", 0.5),))
    work = VisibleBacks().find(tracer, scene, np.ones(4, bool), TEXEL, RESOLUTION)
    slices = []
    assert finished(map_progress(work, slices.append)).tolist() == [False, False, True, True]
    assert len(slices) > 4


def test_backs_without_emission_and_with_it_are_the_same(tracer):
    """Light that changes leaves patches as they are: a session keeps what they see."""
    meshes = [open_room(), card((0.3, 0.2, 0.25), 0.4 * X, 0.3 * Y)]
    visible = VisibleBacks()
    of = partial(visible.of, tracer, texel=TEXEL, resolution=RESOLUTION, candidates=np.ones(12, bool))
    dark, bright = (Scene(tuple(meshes), (material("Grey", 0.5, emission),)) for emission in (0, 3))
    first = of(dark)
    assert of(bright) is first and first.any() and not first.all()
    moved = replace(meshes[1], positions=meshes[1].positions - np.float32((0, 0, 7)))
    assert not np.array_equal(of(replace(dark, meshes=(meshes[0], moved))), first)


def test_a_scene_in_which_no_back_is_visible_stays_as_it_is(tracer):
    scene = Scene((open_room(),), (material("Grey", 0.5),))
    visible, triangles = VisibleBacks(), join_meshes(scene)
    found = with_places(scene, RESOLUTION, find_visible=partial(visible.of, tracer, resolution=RESOLUTION))
    assert found is scene and triangles.backs is None
    bvh = tracer(triangles, read_cutouts(scene)).bvh
    bvh_of = partial(visible.bvh_of, scene, triangles.origin)
    assert bvh_of(type(bvh)) is not None and bvh_of(int) is None
    assert not visible.of(tracer, scene, np.zeros(10, bool), TEXEL, RESOLUTION).any()
    assert bvh_of(type(bvh)) is None


def test_a_choice_keeps_no_joined_triangles_and_gives_its_hierarchy_to_one_bake(tracer):
    scene, visible, positions = Scene((open_room(),), (material("Grey", 0.5),)), VisibleBacks(), []

    def watched(triangles, cutouts):
        positions.append(weakref.ref(triangles.positions))
        return tracer(triangles, cutouts)

    visible.of(watched, scene, np.ones(10, bool), TEXEL, RESOLUTION)
    gc.collect()
    assert positions[0]() is None
    origin = join_meshes(scene).origin
    assert visible.bvh_of(scene, origin + 1, object) is None
    copied = replace(scene, meshes=(replace(scene.meshes[0], positions=scene.meshes[0].positions.copy()),))
    assert visible.bvh_of(copied, origin, object) is None
    assert visible.bvh_of(scene, origin, object) is not None
    assert visible.bvh_of(scene, origin, object) is None


def test_moving_meshes_keep_the_choice_until_it_is_refreshed(tracer):
    """A card leaves a room: it sees the outer side of the room, and its own back sees nothing."""
    meshes = [open_room(), card((0.3, 0.2, 0.25), 0.4 * X, 0.3 * Y)]
    scene = Scene(tuple(meshes), (material("Grey", 0.5),))
    visible, every = VisibleBacks(), np.ones(12, bool)
    of = partial(visible.of, tracer, texel=TEXEL, resolution=RESOLUTION, is_moving=True)
    first = of(scene=scene, candidates=every)
    moved = replace(
        scene, meshes=(meshes[0], replace(meshes[1], positions=meshes[1].positions - np.float32((0, 0, 7))))
    )
    kept = of(scene=moved, candidates=every)
    assert np.array_equal(kept, first) and visible.bvh_of(moved, join_meshes(moved).origin, object) is None
    assert visible.refresh(tracer) and not visible.refresh(tracer)
    fresh = VisibleBacks().of(tracer, moved, every, TEXEL, RESOLUTION)
    assert np.array_equal(of(scene=moved, candidates=every), fresh) and not np.array_equal(fresh, first)
    assert visible.bvh_of(moved, join_meshes(moved).origin, object) is not None


def test_a_patch_file_stays_valid_when_other_backs_become_visible(tmp_path):
    """The card leaves the room and meets its outer side; the file depends on UVs only."""
    settings = Settings(resolution=RESOLUTION, patch_file=str(tmp_path / "patches"), max_bounces=1, samples=4)
    inside, below = card((0.3, 0.2, 0.25), 0.4 * X, 0.3 * Y), card((0.3, 0.2, -7), 0.4 * X, 0.3 * Y)
    inside, below = (replace(each, atlas=1) for each in (inside, below))
    grey, world = (material("Grey", 0.5),), np.ones(3, np.float32)
    patches = [
        finished(bake(Scene((open_room(), each), grey, world=world, atlases=("Room", "Card")), settings))
        for each in (inside, below)
    ]
    assert patches[0].report.patches == patches[1].report.patches


def test_later_rounds_need_only_rays_that_start_inside_something(tracer, monkeypatch):
    floor = card((0, 0, 0), 24 * X, 24 * Y, "Floor")
    tiles = [rectangle((2 * i, 2 * j, 1), 2 * X, 2 * Y) for i in range(12) for j in range(12)]
    charts = [(3 * (k % 24), 3 * (k // 24), 2, 2) for k in range(len(tiles))]
    roof = quads(np.stack(tiles), charts, [0] * len(tiles), RESOLUTION, "Roof")
    scene = Scene((floor, roof), (material("Grey", 0.5),))

    def visible():
        return VisibleBacks().of(tracer, scene, np.ones(290, bool), TEXEL, RESOLUTION)

    found, rounds = visible(), []
    make = visible_backs._caster

    class AllRays:
        """Rays that are all cast in each round."""

        def __init__(self, cast, rays):
            self.made = partial(cast, rays)

        def hit_backs(self, known):
            rounds.append(known.sum())
            return self.made().hit_backs(known)

    monkeypatch.setattr(visible_backs, "_caster", lambda *arguments: partial(AllRays, make(*arguments)))
    assert np.array_equal(visible(), found) and 0 == rounds[0] < rounds[1] < found.sum()


def test_triangles_without_weight_cast_no_rays():
    weight = np.zeros(1009, np.float32)
    weight[[3, 4, 997]] = 1, 2, 5
    rays = np.diff(BackRays.of(weight, 80, 1.0, 0.0).ends.astype(np.int64), prepend=0)
    assert rays[[3, 4, 997]].tolist() == [10, 20, 50] and rays.sum() == 80


def test_many_rays_are_shared_evenly():
    """Also by weights in float32, which cannot hold the sums."""
    count, triangles = 1 << 30, 1009
    ends = BackRays.of(np.ones(triangles, np.float32), count, 1.0, 0.0).ends.astype(np.int64)
    assert ends[-1] == count
    assert np.abs(np.diff(ends, prepend=0) - count / triangles).max() <= 1
