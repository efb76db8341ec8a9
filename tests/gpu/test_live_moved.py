"""Visibility after a movement equals a new computation, bit for bit."""

import dataclasses

import numpy as np
import pyopencl as cl
import pytest

from engine import Scene, SceneChanges, Session, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.gather.visibility_cache import VisibilityCache
from engine.patches import device_charts
from engine.patches.patch_scene import make_patch_scene
from engine.resume.checkpoint import Checkpoint, Checkpoints
from engine.scene.digests import same_values
from engine.scene.model import NO_LIGHTMAP
from engine.scene.transmission import Transmittance
from engine.visibility.rays.ray_sampler import RaySampler
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.sampler import upload_background
from tests.analytic.scenes import nine_quad_room
from tests.gpu.graphics_card import GraphicsCard
from tests.gpu.slice_sizes import fix_slice_size
from tests.rows import long
from tests.transparency import CLEAR_BACK, uniform_transmission

SETTINGS = Settings(
    resolution=37, hemicube=8, samples=68, visibility="rays", light_samples=3, texel_samples=1,
    hide_seams=False, warm_start=True, intermediates=True, adaptive=False, max_bounces=2,
)  # fmt: skip


#: Edits one after the other.
EDITS = 7


def open_room(offset: float = 0.0) -> Scene:
    """Return a room without a ceiling, of four meshes, one of them an occluder; offset: m, along all axes."""
    room = nine_quad_room()
    mesh = dataclasses.replace(room.meshes[0], positions=room.meshes[0].positions + np.float32(offset))
    faces = {"Room": (0, 2, 3, 4, 5), "Pillar": (7,), "Panel": (6,), "Board": (8,)}
    meshes = [
        dataclasses.replace(mesh.subset(np.isin(mesh.face, some)), name=name) for name, some in faces.items()
    ]
    meshes[1] = dataclasses.replace(meshes[1], atlas=NO_LIGHTMAP)
    world = np.random.default_rng(11).random((5, 9, 3), np.float32)
    return dataclasses.replace(room, meshes=tuple(meshes), world=world)


TINTED = uniform_transmission(Transmittance(np.float32([0.7, 0.5, 0.2])))


def see_through(scene: Scene) -> Scene:
    """Return a scene whose board tints light, and whose panel is clear from behind."""
    materials = list(scene.materials)
    for mesh, changes in ((3, {"transmission": TINTED}), (2, {"transmission": CLEAR_BACK})):
        number = int(scene.meshes[mesh].material[0])
        materials[number] = dataclasses.replace(materials[number], **changes)
    return dataclasses.replace(scene, materials=tuple(materials))


def edit(scene: Scene, random: np.random.Generator) -> SceneChanges:
    """Move, turn, mirror or deform one or two of the small meshes, by little or by much."""
    numbers = random.choice([1, 2, 3], size=random.integers(1, 3), replace=False)
    if random.random() < 0.3:
        meshes = {}
        for number in map(int, numbers):
            mesh = scene.meshes[number]
            bent = mesh.positions + random.normal(0, 0.1, 3).astype(np.float32) * (
                mesh.positions[..., 2:] > 1
            )
            meshes[number] = dataclasses.replace(mesh, positions=bent.astype(np.float32))
        return SceneChanges(meshes=meshes)
    moves = {}
    for number in map(int, numbers):
        middle = scene.meshes[number].positions.reshape(-1, 3).astype(np.float64).mean(axis=0)
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0] if random.random() < 0.3 else np.eye(3)
        matrix = np.eye(4)
        matrix[:3, :3] = turn
        matrix[:3, 3] = middle - turn @ middle + random.normal(0, 10.0 ** random.integers(-3, 0), 3)
        moves[number] = matrix
    return SceneChanges(moves=moves)


def stored(compute, samples: VisibilityCache) -> dict[str, np.ndarray]:
    """Return all that is kept of what patches see."""
    backs = samples.backs
    buffers = {f"rows {i}": rows.cache for i, rows in enumerate(samples.pieces)}
    buffers |= {"light": backs.light, "patches": backs.patches_seen}
    if backs.l1 is not None:
        buffers["l1"] = backs.l1
    values = {name: np.empty(buffer.size, np.uint8) for name, buffer in buffers.items()}
    for name, buffer in buffers.items():
        cl.enqueue_copy(compute.queue, values[name], buffer)
    return values


def found_anew(session: Session, settings: Settings) -> VisibilityCache:
    """Return what the patches that a session keeps see, found by first looks."""
    compute, patch_scene = session._devices.compute, session._kept._patch_scene
    rays, emission = RayScene(compute, patch_scene), session._kept.samples._emission
    around = upload_background(compute, emission, np.zeros((1, 1, 3), np.float32))
    identity = RaySampler(compute, rays, patch_scene, around, settings)
    samples = VisibilityCache(
        compute, session._kept.samples.sampling, patch_scene, rays, emission, settings.directional
    )
    finished(samples.find(identity, Checkpoint(Checkpoints(), lambda: "")))
    return samples


def assert_as_found_anew(session: Session, settings: Settings) -> None:
    """All that is kept is what a first look at the same patches finds."""
    compute = session._devices.compute
    expected = stored(compute, found_anew(session, settings))
    for name, values in stored(compute, session._kept.samples).items():
        assert np.array_equal(values, expected[name]), name


@pytest.fixture
def lively():
    """What makes sessions on an OpenCL device: it as it is, or taken for a graphics card."""
    sessions = []

    def make(device: type[ComputeDevice]) -> Session:
        session = Session()
        session._devices = Devices(SETTINGS.cache_dir, SETTINGS.opencl_device)
        session._devices.compute = device()
        sessions.append(session)
        return session

    yield make
    for session in sessions:
        session.close()


CASES = {
    "room": (open_room(), {}),
    "far": (open_room(3000.0), {}),
    "see-through": (see_through(open_room()), {}),
    "directional": (open_room(), {"outputs": ("combined", "directional")}),
    "hemicubes": (open_room(), {"directions": "hemicube", "samples": 0}),
}


@pytest.mark.parametrize(
    ("device", "case"),
    [
        (ComputeDevice, "see-through"),
        *(long(ComputeDevice, case) for case in CASES if case != "see-through"),
        *(long(GraphicsCard, case) for case in CASES),
    ],
)
def test_rows_are_those_of_a_first_look(lively, device, case):
    scene, changes = CASES[case]
    settings, session = dataclasses.replace(SETTINGS, **changes), lively(device)
    random, again = np.random.default_rng(len(case)), 0
    live = session.live(scene, settings)
    finished(live.converge())
    for _ in range(EDITS):
        live.update(edit(live.scene, random))
        report = finished(live.converge()).report
        again += any("recomputed where objects moved" in reason for reason in report.reasons)
        assert_as_found_anew(session, settings)
    # Where moves bring other back faces into view, all samples are found again.
    assert again >= EDITS - 5


@pytest.mark.parametrize("device", [ComputeDevice, long(GraphicsCard)])
def test_edits_that_interrupt_the_search_leave_nothing_behind(lively, device, monkeypatch):
    """Somebody goes on dragging, from the first search on, while samples are found again.

    A fast card has found all after a few interruptions.
    """
    fix_slice_size(monkeypatch, 64)
    random, session, interrupted = np.random.default_rng(7), lively(device), 0
    live = session.live(open_room(), SETTINGS)
    for step, progress in enumerate(live.converge()):
        if interrupted < 8 and progress.stage.startswith("Visibility") and step % 3 == 0:
            live.update(edit(live.scene, random))
            interrupted += 1
    assert interrupted >= 2
    assert_as_found_anew(session, SETTINGS)


def test_a_bake_of_its_own_after_live_has_its_own_bits(lively):
    """Live keeps the origin of its first bake; other bakes do not."""
    session, scene = lively(ComputeDevice), open_room(200.0)
    live = session.live(scene, SETTINGS)
    finished(live.converge())
    matrix = np.eye(4)
    matrix[:3, 3] = 0.4
    live.update(SceneChanges(moves={1: matrix, 2: matrix, 3: matrix}))
    finished(live.converge())
    settings = dataclasses.replace(SETTINGS, warm_start=False)
    image = finished(session.bake(live.scene, settings)).display
    session.forget()
    assert np.array_equal(image, finished(session.bake(live.scene, settings)).display)


def test_charts_that_stay_are_not_drawn_again(lively, monkeypatch):
    """Patches, the index map and what they are made of are those of a scene of its own all the same."""
    session, random, drawn = lively(ComputeDevice), np.random.default_rng(3), []
    live = session.live(open_room(), SETTINGS)
    finished(live.converge())
    draw = device_charts.render_charts
    monkeypatch.setattr(device_charts, "render_charts", lambda *drawing: drawn.append(1) or draw(*drawing))
    for _ in range(6):
        charts = session._kept._patch_scene.triangles.uvs
        live.update(edit(live.scene, random))
        drawn.clear()
        next(live.converge())
        finished(live.converge())
        patch_scene = session._kept._patch_scene
        assert bool(drawn) == (not np.array_equal(charts, patch_scene.triangles.uvs))
        devices = session._devices.graphics, session._devices.compute
        scene = finished(session._kept.with_places(*devices, live.scene, SETTINGS))
        unknown = dataclasses.replace(patch_scene, charts=None), None
        expected = make_patch_scene(*devices, scene, SETTINGS, unknown)
        for found, wanted in (
            (patch_scene.patches, expected.patches),
            (patch_scene.texel_to_patch, expected.texel_to_patch),
            (np.asarray(patch_scene.surfaces.reflectance), np.asarray(expected.surfaces.reflectance)),
            (patch_scene.surfaces.emission, expected.surfaces.emission),
            (patch_scene.geometry.center, expected.geometry.center),
            (patch_scene.warnings, expected.warnings),
        ):
            assert same_values(found, wanted)
