"""Direct light after a movement equals shadow rays from all patches, bit for bit."""

import dataclasses

import numpy as np
import pytest

from engine import Light, Scene, SceneChanges, Session, Settings, finished
from engine.direct.lighting import DirectLighting
from engine.patches.backs import with_places
from engine.visibility.rays.ray_scene import RayScene
from tests.gpu.test_live_moved import edit, open_room, see_through
from tests.rows import long

SETTINGS = Settings(
    resolution=41, hemicube=8, samples=16, visibility="rays", light_samples=13, texel_samples=1,
    hide_seams=False, warm_start=True, intermediates=True, adaptive=False, max_bounces=1,
)  # fmt: skip

#: Edits one after the other.
EDITS = 6

#: A lamp's axes: it shines down and aside.
TILTED = np.linalg.qr(np.array([[1.0, 0.2, 0.1], [0.1, 1.0, -0.3], [0.2, 0.3, 1.0]]))[0]


def lamp(kind: str, **values: object) -> Light:
    """Return a lamp below where the ceiling was."""
    strength = np.float32([3, 2, 5])
    return Light("Lamp", kind, np.array([0.9, 1.6, 2.2]), TILTED, strength, **values)


def lit(offset: float, *lamps: Light, world: np.ndarray | None = None, emits: int | None = None) -> Scene:
    """Return a room with lamps; emits: a mesh whose material shines."""
    room = open_room(offset)
    materials = [dataclasses.replace(paint, emission=np.zeros(3, np.float32)) for paint in room.materials]
    if emits is not None:
        number = int(room.meshes[emits].material[0])
        materials[number] = dataclasses.replace(materials[number], emission=np.float32([4, 5, 6]))
    lamps = tuple(dataclasses.replace(light, position=light.position + offset) for light in lamps)
    around = np.zeros(3, np.float32) if world is None else world
    return dataclasses.replace(room, materials=tuple(materials), lights=lamps, world=around)


SUN_IN_THE_SKY = np.full((8, 16, 3), 0.1, np.float32)
SUN_IN_THE_SKY[6, 3] = 400

SCENES = {
    "point": lit(0.0, lamp("point", radius=0.05), lamp("spot", half_angle=0.6, blend=0.3, soft=False)),
    "area": lit(0.0, lamp("area", size=np.array([0.6, 0.2]), ellipse=True, half_angle=1.1)),
    "sun": lit(0.0, lamp("sun", half_angle=0.02), lamp("point", casts_shadow=False)),
    "sky": lit(0.0, world=SUN_IN_THE_SKY),
    "panel": lit(0.0, lamp("point"), emits=2),
    "far": lit(2000.0, lamp("point", radius=0.3), lamp("sun", half_angle=0.3)),
    "see-through": see_through(lit(0.0, lamp("point", radius=0.02))),
}


@pytest.fixture
def session():
    """What lives."""
    followed = Session()
    yield followed
    followed.close()


def cast_anew(session: Session, scene: Scene, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Return the light of shadow rays from all patches that a session keeps, and its L1."""
    patch_scene = session._kept._patch_scene
    rays = RayScene(session._devices.compute, patch_scene)
    lighting = DirectLighting(with_places(scene, settings.resolution), patch_scene, rays, settings)
    return finished(lighting.gather()), lighting.l1


@pytest.mark.parametrize(
    ("case", "outputs"),
    [
        ("point", ("combined",)),
        long("sun", ("combined", "directional")),
        *(long(case, ("combined",)) for case in SCENES if case not in ("point", "sun")),
    ],
)
def test_light_is_that_of_all_shadow_rays(session, case, outputs):
    settings, random = dataclasses.replace(SETTINGS, outputs=outputs), np.random.default_rng(len(case))
    live, sampled = session.live(SCENES[case], settings), []
    finished(live.converge())
    for step in range(EDITS):
        live.update(edit(live.scene, random))
        if step % 3 == 2:
            next(live.converge())
            live.update(edit(live.scene, random))
        finished(live.converge())
        light, l1 = cast_anew(session, live.scene, settings)
        kept = session._kept.sampled
        assert light.any() and np.array_equal(kept.light, light) and np.array_equal(kept.l1, l1)
        sampled.append(kept.patch_scene is session._kept._patch_scene)
    assert all(sampled)


def test_few_patches_are_lit_anew_where_a_small_thing_moves(session, monkeypatch):
    """And none where only colours change, but all where a lamp does."""
    parts = []
    follow = DirectLighting.follow

    def told(self, last):
        follow(self, last)
        parts.append(self.part_to_sample)

    monkeypatch.setattr(DirectLighting, "follow", told)
    live = session.live(SCENES["point"], SETTINGS)
    finished(live.converge())
    away = np.eye(4)
    away[:3, 3] = 0.03, 0.02, 0.0
    paint = dataclasses.replace(live.scene.materials[0], reflectance=np.float32([0.1, 0.6, 0.3]))
    brighter = dataclasses.replace(live.scene.lights[0], strength=np.float32([4, 4, 4]))
    for changes in (
        SceneChanges(moves={3: away}),
        SceneChanges(materials={0: paint}),
        SceneChanges(lights=(brighter, live.scene.lights[1])),
    ):
        live.update(changes)
        finished(live.converge())
    assert parts[0] == 1 and 0 < parts[1] < 0.6 and parts[2:] == [0, 1]


def test_a_move_that_comes_before_the_light_of_the_last_one_is_not_lost(session):
    """Somebody drags a mesh: each state of it lasts for one image of few rays."""
    live, random = session.live(SCENES["point"], SETTINGS), np.random.default_rng(3)
    finished(live.converge())
    edits = 0
    live.update(edit(live.scene, random))
    for progress in live.converge():
        if progress.intermediate is not None and edits < 5:
            live.update(edit(live.scene, random))
            edits += 1
    light, _ = cast_anew(session, live.scene, SETTINGS)
    assert edits == 5 and np.array_equal(session._kept.sampled.light, light)


def test_work_of_one_name_goes_on_with_the_slices_of_before(compute):
    (kernel,) = compute.kernels("float4_rows.cl", "to_float4")
    first = compute.slice_size(kernel, 64, 7)
    assert compute.slice_size(kernel, 64, 7) is first
    assert compute.slice_size(kernel, 2048, 7) is not first
