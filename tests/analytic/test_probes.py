"""Radiance at probes against closed forms, as spherical harmonics."""

import dataclasses

import numpy as np
import pytest

import engine
from engine import Light, Scene, Session, Settings, finished
from engine.device import devices
from engine.probes import gather_probes
from engine.probes.gather_probes import ProbeGather
from engine.probes.probe_lights import ProbeLights
from engine.probes.sent_light import SentRadiance
from engine.probes.sphere_directions import sphere_directions
from engine.probes.spherical_harmonics import basis, irradiance
from engine.resume import checkpoint
from engine.scene.probe_volume import ProbeVolume
from engine.scene.texture import Texture
from engine.scene.transmission import Transmission, Transmittance
from tests.analytic.scenes import furnace, material, quads, rectangle, room_walls
from tests.no_compute import NoCompute

SETTINGS = Settings(
    resolution=16, hemicube=8, samples=16, texel_samples=1, light_probes=True, intermediates=False
)
X, Y, Z = np.eye(3)


@pytest.fixture(scope="module")
def session():
    made = Session()
    yield made
    made.close()


def volume(centre=(0, 0, 0), half=1.0, resolution=(2, 3, 1), name="Volume"):
    """Return a volume whose box has half widths `half`, a number or three."""
    matrix = np.eye(4)
    matrix[:3, :3] *= half
    matrix[:3, 3] = centre
    return ProbeVolume(name, matrix, resolution)


def square(centre, half=0.1, up=1.0):
    """Return a small black square; a scene needs a mesh."""
    corner = np.asarray(centre) - half * X - half * up * Y
    return quads(rectangle(corner, 2 * half * X, 2 * half * up * Y)[None], [(1, 1, 6, 6)], [0], 16, "Square")


def bake(session, scene, **settings):
    """Return the probes of a bake in the shared session."""
    return finished(session.bake(scene, dataclasses.replace(SETTINGS, **settings))).probes


def scene_of(*meshes, black=0.0, **values):
    return Scene(tuple(meshes), (material("Black", black),), **values)


def constant(radiance):
    """Return the coefficients of constant radiance, (9,)."""
    return radiance * np.sqrt(4 * np.pi) * (np.arange(9) == 0)


def test_a_constant_sky_has_only_its_mean(session):
    scene = scene_of(square((0, 0, -9), 1e-3), world=np.float32([1, 2, 3]), probe_volumes=(volume(),))
    (grid,) = bake(session, scene)
    assert grid.coefficients.shape == (6, 9, 3) and (grid.validity == 1).all()
    expected = constant(1.0)[None, :, None] * [1, 2, 3]
    assert grid.coefficients == pytest.approx(np.broadcast_to(expected, (6, 9, 3)), abs=3e-5)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        ("point", {}),
        ("point", {"radius": 0.3, "soft": False}),
        ("sun", {"half_angle": 0.0}),
        ("area", {"size": np.array([0.1, 0.05])}),
    ],
)
def test_one_light_has_the_closed_form_of_its_direction(session, kind, values):
    """Its radiance is a peak: the coefficients are E times the basis in its direction."""
    place = np.array([0.5, -0.3, 4.0])
    lamp = Light("Lamp", kind, place, np.eye(3), np.float32([5, 7, 2]), **values)
    grids = bake(session, scene_of(square((0, 0, -9)), lights=(lamp,), probe_volumes=(volume(),)))
    way = place - volume().points()
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    way, power = (way / distance, 1 / distance**2) if kind != "sun" else (np.tile(Z, (6, 1)), np.ones((6, 1)))
    if kind == "area":
        power = power * 0.005 * way[:, 2:]
    expected = (power * basis(way))[..., None] * np.array([5, 7, 2])
    assert grids[0].coefficients == pytest.approx(expected, abs=5e-3 * expected.max())


@pytest.mark.parametrize("blocked", [False, True])
@pytest.mark.parametrize("kind", ["area", "disk", "ball"])
def test_lights_with_a_size_have_the_integral_over_their_solid_angle(session, kind, blocked):
    """From one width away to a speck; a face far below, or one that hides half of the light's directions."""
    radius = 0.3
    u, v = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(256) + 0.5) / 256)
    across, around = np.sqrt(u.ravel()), 2 * np.pi * v.ravel()
    disk = radius * across[:, None] * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    probes = volume((0.1, -0.2, -2.5), (0.9, 0.4, 2.0), (3, 1, 4))
    far = volume((0, 0, -40), 1.0, (1, 1, 1), "Far")
    faces = np.stack(
        [rectangle((0, 0, -90), 0.2 * X, 0.2 * Y), rectangle((0.0, -9.0, -0.4), X, 18 * Y)][: 1 + blocked]
    )
    charts = [(1, 1, 6, 6), (8, 8, 6, 6)][: 1 + blocked]
    mesh = quads(faces, charts, [0] * len(faces), 16, "Faces")
    if kind == "area":
        values = {"size": np.array([0.6, 0.4])}
        square_points = np.stack([u.ravel() - 0.5, v.ravel() - 0.5, 0 * u.ravel()], axis=1)
        points = square_points * [0.6, 0.4, 0]
    else:
        values = {"radius": radius, "soft": kind == "disk"}
    light = Light("Lamp", kind if kind == "area" else "point", np.zeros(3), np.eye(3), np.ones(3), **values)
    scene = scene_of(mesh, lights=(light,), probe_volumes=(probes, far))
    grids = bake(session, scene, light_samples=1024 if blocked else 64, probe_samples=60)
    for grid, place in zip(grids, (probes, far), strict=True):
        for found, at in zip(grid.coefficients[..., 0], place.points(), strict=True):
            if kind == "area":
                below = -at[2]
                distance = np.linalg.norm(points - at, axis=1)
                angle = 0.24 / len(points) * below / distance**3
            else:
                axis = -at / np.linalg.norm(at)
                first = np.cross(axis, [0, 1, 0]) / np.linalg.norm(np.cross(axis, [0, 1, 0]))
                d = np.linalg.norm(at)
                wide = 1.0 if kind == "disk" else 1 / np.sqrt(1 - (radius / d) ** 2)
                points = wide * (disk[:, :1] * first + disk[:, 1:2] * np.cross(axis, first))
                distance = np.linalg.norm(points - at, axis=1)
                angle = (wide / distance) ** 2 / len(points) * d / distance
            ways = (points - at) / distance[:, None]
            if blocked:
                crossing = at[0] + ways[:, 0] * (-0.4 - at[2]) / ways[:, 2]
                angle = np.where(crossing > 0, 0, angle)
            expected = angle @ basis(ways)
            unblocked = 0.282095 * (0.24 if kind == "area" else 1) / np.dot(at, at)
            assert found == pytest.approx(expected, abs=(0.02 if blocked else 1e-3) * unblocked), at


@pytest.mark.parametrize("soft", [False, True])
def test_clear_surfaces_elsewhere_leave_the_light_of_balls_and_disks_exact(session, soft):
    light = Light("Lamp", "point", np.zeros(3), np.eye(3), np.ones(3), radius=0.3, soft=soft)
    probes = volume((0.1, -0.2, -2.5), (0.9, 0.4, 2.0), (3, 1, 4))
    half = np.full(3, 0.5, np.float32)
    found = []
    for transmission in (Transmission(), Transmission(*4 * [Transmittance(half)])):
        glass = dataclasses.replace(material("Glass", 0.0), transmission=transmission)
        scene = Scene((square((0, 0, -90)),), (glass,), lights=(light,), probe_volumes=(probes,))
        (grid,) = bake(session, scene, light_samples=16)
        found.append(grid.coefficients)
    assert found[1] == pytest.approx(found[0], rel=1e-5, abs=1e-5 * found[0].max())


def test_distant_screens_are_sampled_as_finely_as_near_ones(session):
    """Small bright spots of an image, which the first few samples miss or hit twice."""
    pixels = np.where(np.random.default_rng(1).random((16, 16, 1)) < 0.25, 1, 0.02) * np.ones(3)
    image = Texture("Image", pixels.astype(np.float32), "Map", smooth=False)
    materials = material("Black", 0.0), dataclasses.replace(material("Screen", 0.0, 1.0), emission_map=image)
    uvs = np.float32([(0, 0), (1, 0), (1, 1), (0, 1)])[np.array([[0, 1, 2], [0, 2, 3]])]
    screen = quads(rectangle((-0.5, 0.5, 0), X, -Y)[None], [(8, 8, 50, 50)], [1], 64, "Screen")
    floor = quads(rectangle((-40, -40, -60), 80 * X, 80 * Y)[None], [(1, 1, 6, 6)], [0], 64, "Floor")
    meshes = dataclasses.replace(screen, texture_uvs={"Map": uvs}), floor
    probes = volume((0, 0, -16), (0.3, 0.3, 0.2), (7, 7, 2))
    scene = Scene(meshes, materials, probe_volumes=(probes,))
    (grid,) = bake(session, scene, resolution=64, light_samples=128, probe_samples=60)
    points = probes.points()
    radiance = grid.coefficients[:, 0, 0] * np.linalg.norm(points, axis=1) ** 3 / -points[:, 2] / 0.282095
    assert radiance.mean() == pytest.approx(pixels.mean(), rel=0.05)
    assert radiance.std() < 0.16 * pixels.mean()


def test_indirect_only_leaves_lamps_out(session):
    lamp = Light("Lamp", "point", 4 * Z, np.eye(3), np.float32([5, 7, 2]))
    scene = scene_of(square((0, 0, -9)), lights=(lamp,), probe_volumes=(volume(),))
    (grid,) = bake(session, scene, probes_indirect_only=True)
    assert np.abs(grid.coefficients).max() < 1e-5


def test_all_probes_of_a_furnace_are_equal(session):
    """In a closed room all radiance is emission / (1 - reflectance)."""
    scene = dataclasses.replace(furnace(0.5, 1.0), probe_volumes=(volume((0.5, 0.5, 0.5), 0.45, (3, 2, 5)),))
    (grid,) = bake(session, scene, resolution=32, samples=64, tolerance=1e-6)
    assert (grid.validity == 1).all()
    assert grid.coefficients == pytest.approx(np.broadcast_to(constant(2.0)[:, None], (30, 9, 3)), abs=2e-4)


@pytest.mark.parametrize("indirect_only", [False, True])
def test_light_groups_are_parts_of_all_light(session, indirect_only):
    """The walls of a furnace alone give 2; the rest of the light is a lamp's, also for probes in walls."""
    room = furnace(0.5, 1.0)
    lamp = Light("Lamp", "point", np.array([0.4, 0.5, 0.6]), np.eye(3), np.float32([5, 2, 1]))
    scene = dataclasses.replace(
        room,
        meshes=(dataclasses.replace(room.meshes[0], light_group="Walls"),),
        lights=(dataclasses.replace(lamp, light_group="Lamps"),),
        light_groups=("Lamps", "Walls"),
        probe_volumes=(volume((0.75, 0.5, 0.5), (0.5, 0.1, 0.1), (7, 1, 1)),),
    )
    (grid,) = bake(
        session, scene, resolution=32, samples=64, tolerance=1e-6, outputs=("combined", "light_groups"),
        probes_indirect_only=indirect_only, sample_emission=False,
    )  # fmt: skip
    assert list(grid.groups) == ["Lamps", "Walls"] and (grid.validity == 0).any()
    walls = np.broadcast_to(constant(2.0)[:, None], (7, 9, 3))
    assert grid.groups["Walls"] == pytest.approx(walls, abs=2e-3)
    lamps = grid.groups["Lamps"]
    assert lamps + grid.groups["Walls"] == pytest.approx(grid.coefficients, rel=5e-3, abs=5e-3)
    assert (lamps[:, 0] > 0.01).all()


def lookup(grid, points):
    """Return E/pi upwards in the lowest layer of a square grid, (n, n, 3): rows along y."""
    width = grid.resolution[0]
    lowest = irradiance(grid.coefficients[: width**2], Z[None])[:, 0].reshape(width, width, 3)
    first, second = grid.positions[:2, 0]
    place = np.clip((points - first) / (second - first), 0, width - 1)
    low = np.minimum(place.astype(int), width - 2)
    part = (place - low)[:, None, None]
    rows = (lowest[low] * (1 - part) + lowest[low + 1] * part).transpose(1, 0, 2)
    return (rows[low] * (1 - part) + rows[low + 1] * part).transpose(1, 0, 2)


def test_an_object_on_a_floor_has_the_light_of_its_lightmap(session):
    """One wall of a room emits: probes interpolated at the floor differ from its lightmap by less than 5 %.

    With cells of 1/16 of the room, of 1/8 if the outermost probes lie close to the walls, and of 1/8 farther
    than one and a half from walls.
    """
    charts = [(17 * (number % 3), 17 * (number // 3), 16, 16) for number in range(6)]
    mesh = quads(room_walls(1, 1, 1), charts, range(6), 64, "Room")
    names = ("Floor", "Ceiling", "Left", "Right", "Front", "Back")
    colours = (0.5, 0.7, (0.7, 0.1, 0.1), 0.5, 0.5, 0.6)
    surfaces = [
        material(name, colour, float(name == "Front")) for name, colour in zip(names, colours, strict=True)
    ]
    # Probes across the room, and distance of the outermost from the walls in cells.
    placed = (16, 0.5), (9, 0.05), (8, 0.5)
    cells = [1 / (count - 1 + 2 * inset) for count, inset in placed]
    volumes = [
        volume(
            (0.5, 0.5, inset * cell), np.array([count, count, 1]) * cell / 2, (count, count, 1), f"{count}"
        )
        for (count, inset), cell in zip(placed, cells, strict=True)
    ]
    scene = Scene((mesh,), tuple(surfaces), probe_volumes=tuple(volumes))
    settings = dataclasses.replace(
        SETTINGS, resolution=64, samples=4096, probe_samples=6000, texel_samples=16, visibility="rays",
        sample_emission=False, hide_seams=False,
    )  # fmt: skip
    result = finished(session.bake(scene, settings))
    floor, points = result.display[0, :16, :16], (np.arange(16) + 0.5) / 16
    fine, close, coarse = (lookup(grid, points) for grid in result.probes)
    inner = slice(3, 13)
    assert fine == pytest.approx(floor, rel=0.05)
    assert close == pytest.approx(floor, rel=0.05)
    assert coarse[inner, inner] == pytest.approx(floor[inner, inner], rel=0.05)


def test_half_of_the_sphere(session):
    """Below a probe near a large emissive floor all is 1, above it black: c = 2 pi mean of the basis."""
    floor = quads(rectangle((-500, -500, 0), 1000 * X, 1000 * Y)[None], [(0, 0, 16, 16)], [0], 16, "Floor")
    scene = Scene((floor,), (material("Lit", 0.0, 1.0),), probe_volumes=(volume((0, 0, 0.02), 0.01),))
    (grid,) = bake(session, scene, probe_samples=6000, sample_emission=False)
    expected = np.zeros(9)
    expected[0] = 2 * np.pi * 0.28209479
    expected[2] = -np.pi * 0.48860251
    assert (grid.validity == 1).all()
    assert grid.coefficients[..., 1] == pytest.approx(np.broadcast_to(expected, (6, 9)), abs=2e-2)


def test_an_empty_scene_is_black(session):
    (grid,) = bake(session, scene_of(square((0, 0, -9)), probe_volumes=(volume(),)))
    assert not grid.coefficients.any() and (grid.validity == 1).all()


def test_far_from_the_origin(session):
    """A kilometre away the furnace is the same; positions stay relative to the scene's origin."""
    room, away = furnace(0.5, 1.0), np.array([1024.0, -2048.0, 512.0])
    mesh = dataclasses.replace(room.meshes[0], positions=(room.meshes[0].positions + away).astype(np.float32))
    probes = volume(away + 0.5, 0.45, (3, 1, 1))
    (grid,) = bake(
        session, dataclasses.replace(room, meshes=(mesh,), probe_volumes=(probes,)),
        resolution=32, samples=64, tolerance=1e-6,
    )  # fmt: skip
    assert grid.coefficients == pytest.approx(np.broadcast_to(constant(2.0)[:, None], (3, 9, 3)), abs=1e-3)
    assert grid.positions == pytest.approx(probes.points(), abs=1e-3)


def test_probes_in_a_wall_move_out_or_take_light_from_neighbours(session):
    """A row of cells crosses the wall of a furnace: one probe lies in its plane, others behind it."""
    scene = dataclasses.replace(
        furnace(0.5, 1.0), probe_volumes=(volume((31 / 32, 0.5, 0.5), (0.25, 0.1, 0.1), (8, 1, 1)),)
    )
    (grid,) = bake(session, scene, resolution=32, samples=64, tolerance=1e-6)
    x = scene.probe_volumes[0].points()[:, 0]
    assert 1.0 in x
    assert (grid.validity[x < 0.99] == 1).all() and (grid.validity[x == 1.0] == 0.5).all()
    assert (grid.validity[x > 1.01] == 0).all()
    assert (grid.positions[x == 1.0, 0] < 1.0).all()
    assert grid.coefficients == pytest.approx(np.broadcast_to(constant(2.0)[:, None], (8, 9, 3)), abs=1e-3)


def test_lit_backs_within_three_texels_count_as_dark(session):
    """Texels inside a thin body may reach to its lit outside, which must not make a probe there valid."""
    sheets = rectangle((-0.5, -0.5, 0), X, Y), rectangle((-0.5, -0.5, -1), X, Y)
    mesh = quads(np.stack(sheets), [(0, 0, 16, 16), (0, 16, 16, 16)], [0, 0], 32, "Roof")
    probes = volume((0, 0, -0.5), 0.49, (1, 1, 7))
    scene = scene_of(mesh, black=0.5, world=np.float32([1, 1, 1]), probe_volumes=(probes,))
    (grid,) = bake(session, scene, resolution=32)
    below = -probes.points()[:, 2]
    assert grid.validity.tolist() == [float(depth > 3 / 16) for depth in below]


@pytest.fixture
def traced(monkeypatch):
    """Return a list to which each part of the direct light that is traced adds its rays per probe."""
    rays, project = [], ProbeLights._projected

    def counted(lights, probes, emitters, budget):
        rays.append(budget)
        return project(lights, probes, emitters, budget)

    monkeypatch.setattr(ProbeLights, "_projected", counted)
    return rays


def test_rays_to_lamps_are_traced_again_only_if_emitters_change(session, traced):
    """Other walls and colors leave the rays to a lamp, also at a probe that moved out of a wall."""
    lamp = Light("Lamp", "point", np.array([0.5, 0.5, 0.7]), np.eye(3), np.float32([1, 1, 1]), radius=0.1)
    probes = volume((31 / 32, 0.5, 0.5), (0.25, 0.1, 0.1), (8, 1, 1))
    room = dataclasses.replace(furnace(0.3, 0.1), lights=(lamp,), probe_volumes=(probes,))
    bright = dataclasses.replace(furnace(0.3, 0.8), lights=(lamp,), probe_volumes=(probes,))
    settings = {"resolution": 32, "visibility": "rays", "sample_emission": False, "light_samples": 7}
    bake(session, room, **settings)
    found = bake(session, bright, **settings)
    blue = dataclasses.replace(lamp, strength=np.float32([0, 0, 3]))
    bake(session, dataclasses.replace(bright, lights=(blue,)), **settings)
    assert traced == [7]
    fresh = bake(session, bright, seed=3, **settings), bake(session, bright, **settings)
    assert (fresh[1][0].coefficients == found[0].coefficients).all()


@pytest.mark.parametrize("count", [3, 11])
def test_only_rays_to_changed_lamps_are_traced_again(session, traced, count):
    """A moved lamp leaves the others, up to eight; the light is that of a new bake, and has all lamps."""
    random = np.random.default_rng(5)
    lamps = [
        Light(f"Lamp {number}", "point", place, np.eye(3), np.float32(strength), radius=0.05 * (number % 2))
        for number, (place, strength) in enumerate(
            zip(
                random.uniform((0.2, 0.2, 0.8), 0.9, (count, 3)),
                random.uniform(1, 3, (count, 3)),
                strict=True,
            )
        )
    ]
    probes = (volume((0.5, 0.5, 0.2), (0.45, 0.45, 0.1), (3, 2, 1)),)
    room = dataclasses.replace(furnace(0.3, 0.1), lights=tuple(lamps), probe_volumes=probes)
    settings = {"resolution": 32, "visibility": "rays", "sample_emission": False, "light_samples": 64}
    bake(session, room, **settings)
    assert traced == ([1, 64, 1] if count == 3 else [8 * 64])
    traced.clear()
    moved = dataclasses.replace(lamps[0], position=np.array([0.3, 0.6, 0.8]), strength=np.float32([2, 0, 1]))
    scene = dataclasses.replace(room, lights=(moved, *lamps[1:]))
    (found,) = bake(session, scene, **settings)
    assert traced == ([1] if count == 3 else [8 * 64])
    with_session = Session()
    (fresh,) = bake(with_session, scene, **settings)
    with_session.close()
    assert found.coefficients == pytest.approx(fresh.coefficients, abs=1e-4)
    direct = sum(
        (basis(way / np.linalg.norm(way, axis=1)[:, None]) / np.square(way).sum(axis=1)[:, None])[..., None]
        * lamp.strength
        for lamp in scene.lights
        for way in (lamp.position - probes[0].points(),)
    )
    indirect = bake(session, scene, probes_indirect_only=True, **settings)[0].coefficients
    assert found.coefficients - indirect == pytest.approx(direct, abs=0.02 * direct.max())


def test_a_second_bake_reuses_the_rays_and_gives_the_same_bits(session):
    lamp = Light("Lamp", "point", np.array([0.5, 0.5, 0.7]), np.eye(3), np.float32([1, 1, 1]))
    probes = (volume((0.5, 0.5, 0.5), 0.4, (3, 3, 3)), volume((0.4, 0.5, 0.3), 0.2, (1, 2, 1), "Other"))
    dim = dataclasses.replace(furnace(0.3, 0.1), lights=(lamp,), probe_volumes=probes)
    bright = dataclasses.replace(furnace(0.3, 0.8), lights=(lamp,), probe_volumes=probes)
    first = bake(session, bright, resolution=32, visibility="rays")
    bake(session, dim, resolution=32, visibility="rays")
    again = bake(session, bright, resolution=32, visibility="rays")
    assert [grid.name for grid in again] == ["Volume", "Other"]
    for grid, other in zip(first, again, strict=True):
        assert (grid.coefficients == other.coefficients).all()
    kept = session._kept.probes
    assert len(kept) == 2
    bake(session, dataclasses.replace(dim, probe_volumes=probes[1:]), resolution=32, visibility="rays")
    assert len(kept) == 1


def test_light_that_is_sent_to_workers_has_the_same_bits(session, monkeypatch):
    """Sky, lit patches and dark backs; workers keep no samples."""
    below = square((0, 0, -0.7), 0.9)
    panorama = np.random.default_rng(8).random((3, 7, 3), np.float32)
    scene = scene_of(below, black=0.5, world=panorama, probe_volumes=(volume(resolution=(2, 3, 5)),))
    (expected,) = bake(session, scene)
    make = ProbeGather.__init__

    def make_from_sent(gather, what, lights, groups):
        compute = what.job.opencl
        opened = [SentRadiance.of(compute, light).opened(compute) for light in lights]
        make(gather, what, opened, groups, keeps_rows=False)

    monkeypatch.setattr(ProbeGather, "__init__", make_from_sent)
    session.forget()
    (sent,) = bake(session, scene)
    assert (sent.coefficients == expected.coefficients).all() and (sent.validity == expected.validity).all()
    assert not session._kept.probes


@pytest.mark.parametrize("groups", [False, True])
def test_an_interrupted_bake_gathers_finished_probes_once(tmp_path, monkeypatch, groups):
    """It resumes after the last finished batch, and gives the bits of a bake that was not interrupted."""
    batches, batch, last = [], ProbeGather._batch, [0]

    def counted(gather, volume, points, first):
        batches.append(first)
        if len(batches) == last[0]:
            raise InterruptedError
        return batch(gather, volume, points, first)

    monkeypatch.setattr(ProbeGather, "_batch", counted)
    monkeypatch.setattr(gather_probes, "_BATCH", 5)
    monkeypatch.setattr(checkpoint, "_PART", 1000)
    lamp = Light("Lamp", "point", np.array([0.5, 0.5, 0.7]), np.eye(3), np.float32([1, 1, 1]), radius=0.1)
    probes = (
        volume((31 / 32, 0.5, 0.5), (0.25, 0.1, 0.1), (8, 1, 2)),
        volume((0.4, 0.5, 0.3), 0.2, (1, 2, 1)),
    )
    scene = dataclasses.replace(furnace(0.3, 0.1), lights=(lamp,), probe_volumes=probes)
    outputs = ("combined", "light_groups") if groups else ("combined",)
    if groups:
        lamp = dataclasses.replace(lamp, light_group="Lamps")
        scene = dataclasses.replace(scene, lights=(lamp,), light_groups=("Lamps",))
    settings = dataclasses.replace(
        SETTINGS, resolution=32, outputs=outputs, cache_dir=str(tmp_path), checkpoint_interval=0,
        probe_distances=True,
    )  # fmt: skip
    whole = finished(engine.bake(scene, dataclasses.replace(settings, cache_dir=None))).probes
    assert batches == [0, 5, 10, 15, 0]
    for last[0] in (7, 9):
        with pytest.raises(InterruptedError):
            finished(engine.bake(scene, settings))
    result = finished(engine.bake(scene, settings))
    assert batches[5:] == [0, 5, 5, 10, 10, 15, 0]
    assert "10 light probes were restored from an interrupted bake." in result.report.resumed
    for grid, expected in zip(result.probes, whole, strict=True):
        assert (
            grid.coefficients == expected.coefficients
        ).all() and grid.groups.keys() == expected.groups.keys()
        assert all((light == expected.groups[name]).all() for name, light in grid.groups.items())
        assert (grid.positions == expected.positions).all() and (grid.distances == expected.distances).all()
    assert not [path for path in (tmp_path / "resume").rglob("*") if path.is_file()]


def octahedral(width=8):
    """Return the unit directions of texels of an octahedral map, (width, width, 3), z up."""
    place = (2 * np.arange(width) + 1) / width - 1
    u, v = np.meshgrid(place, place)
    z = 1 - np.abs(u) - np.abs(v)
    x, y = (
        np.where(z < 0, np.copysign(1 - np.abs(v), u), u),
        np.where(z < 0, np.copysign(1 - np.abs(u), v), v),
    )
    directions = np.stack([x, y, z], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def box_distances(points, directions):
    """Return the distances from points, (n, 3), inside the unit cube to its walls, (n, m)."""
    with np.errstate(divide="ignore"):
        to_walls = np.where(directions > 0, 1 - points[:, None], -points[:, None]) / directions
    return to_walls.min(axis=2)


def test_distances_in_a_box_have_their_closed_form(session):
    """Each texel is the mean over rays with the weight cos^50, here by quadrature of the closed form."""
    volumes = volume((0.5, 0.5, 0.5), (0.45, 0.3, 0.2), (2, 3, 1)), volume((0.3, 0.6, 0.5), 0.05, (1, 1, 1))
    scene = dataclasses.replace(furnace(0.5, 1.0), probe_volumes=volumes)
    grids = bake(session, scene, probe_samples=6000, probe_distances=True)
    directions = sphere_directions(60000)
    weights = np.maximum(octahedral().reshape(64, 3) @ directions.T, 0) ** 50
    weights /= weights.sum(axis=1, keepdims=True)
    for grid, place in zip(grids, volumes, strict=True):
        distances = np.minimum(box_distances(place.points(), directions), place.reach)
        expected = np.stack([distances @ weights.T, distances**2 @ weights.T], axis=-1).reshape(-1, 8, 8, 2)
        assert grid.distances == pytest.approx(expected, rel=0.03, abs=0.003)
        assert np.abs(grid.distances - expected).mean() < 4e-3 * expected.mean()
    assert grids[1].distances[..., 0] == pytest.approx(np.full((1, 8, 8), volumes[1].reach), rel=1e-4)


def test_distances_leave_the_light_as_it_is(session):
    probes = volume((31 / 32, 0.5, 0.5), (0.25, 0.1, 0.1), (8, 1, 1))
    scene = dataclasses.replace(furnace(0.5, 1.0), probe_volumes=(probes,))
    (plain,), (grid,) = (bake(session, scene, visibility="rays", probe_distances=on) for on in (False, True))
    assert (plain.coefficients == grid.coefficients).all() and not len(plain.distances)
    (again,) = bake(session, scene, visibility="rays", probe_distances=True)
    assert (again.distances == grid.distances).all()


def test_distances_of_moved_probes_are_from_their_new_place(session):
    """The probe in the plane of a wall moves inwards, to 5 % of a cell before it; those behind it stay."""
    probes = volume((31 / 32, 0.5, 0.5), (0.25, 0.1, 0.1), (8, 1, 1))
    scene = dataclasses.replace(furnace(0.5, 1.0), probe_volumes=(probes,))
    (grid,) = bake(session, scene, probe_distances=True, probe_samples=1200)
    (moved,) = np.flatnonzero(grid.validity == 0.5)
    inward, outward = octahedral()[..., 0] < -0.7, octahedral()[..., 0] > 0.7
    assert (grid.distances[moved, ..., 0][outward] < 0.01).all()
    assert (grid.distances[moved, ..., 0][inward] > 0.1).all()
    behind = grid.distances[grid.validity == 0][-1, ..., 0]
    assert behind[inward].max() < behind[outward].min()


def test_without_surfaces_distances_are_the_largest(session):
    (grid,) = bake(session, scene_of(square((0, 0, -9)), probe_volumes=(volume(),)), probe_distances=True)
    reach = 1.5 * np.sqrt(1**2 + (2 / 3) ** 2 + 2**2)
    assert grid.distances == pytest.approx(np.broadcast_to([reach, reach**2], (6, 8, 8, 2)), rel=1e-5)


def test_too_many_probes_for_distances_are_a_warning(session):
    grids = volume(resolution=(3, 1, 1), name="Few"), volume(resolution=(4, 1, 1), name="Many")
    scene = scene_of(square((0, 0, -9)), probe_volumes=grids)
    settings = dataclasses.replace(SETTINGS, probe_distances=True, probe_samples=60)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("engine.probes.gather_probes.MAX_DISTANCE_PROBES", 3)
        result = finished(session.bake(scene, settings))
    assert [len(grid.distances) for grid in result.probes] == [3, 0]
    (warning,) = [text for text in result.report.warnings if "Probe Distances" in text]
    assert (
        warning.startswith("Light Probe Volume 'Many': 4 probes exceed") and "Lower its resolution" in warning
    )


def test_without_opencl_the_lightmaps_are_baked_and_a_warning_names_the_remedy(monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    scene = dataclasses.replace(furnace(0.5, 1.0), probe_volumes=(volume((0.5, 0.5, 0.5), 0.4),))
    made = Session()
    result = finished(made.bake(scene, dataclasses.replace(SETTINGS, tolerance=1e-4, samples=64)))
    made.close()
    assert result.probes == () and result.display[result.has_patch] == pytest.approx(2, rel=0.05)
    (warning,) = [text for text in result.report.warnings if text.startswith("Light Probe Volumes")]
    assert "Install an OpenCL driver" in warning and "lightmaps are baked" in warning
