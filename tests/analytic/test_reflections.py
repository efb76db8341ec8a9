"""Reflection cubes against closed forms: directions, energy, textures, the sky and its sun, and levels."""

import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest

from engine import Light, Scene, Session, Settings, finished
from engine.errors import SceneError
from engine.plan.stages import BakeStages, Extent
from engine.reflections import gather_reflections
from engine.reflections.cube_faces import cube_directions, mean_radiance, texel_solid_angles, texels_of
from engine.reflections.prefilter import prefiltered, roughness_of
from engine.scene.reflection_sphere import ReflectionSphere, ReflectionVolume
from engine.scene.texture import Texture
from engine.scene.transmission import Transmittance
from tests.analytic.scenes import furnace, material, quads, rectangle
from tests.transparency import uniform_transmission

SIZE = 64
SETTINGS = Settings(
    resolution=16, hemicube=8, samples=16, texel_samples=1, intermediates=False, reflection_cubes=True,
    reflection_size=SIZE,
)  # fmt: skip
X, Y, Z = np.eye(3)


@pytest.fixture(scope="module")
def session():
    made = Session()
    yield made
    made.close()


def sphere(position=(0.0, 0.0, 0.0), name="Sphere", size=1.0):
    matrix = np.diag([size, size, size, 1.0])
    matrix[:3, 3] = position
    volume = ReflectionVolume("box", matrix)
    return ReflectionSphere(name, np.asarray(position, float), volume, volume)


def square(way, half=0.3, distance=3.0, number=0, kind=None):
    """Return a square at a distance in a direction from the origin, which it faces.

    number:  selects one of nine charts, and the material unless `kind` does
    """
    way = np.asarray(way, float) / np.linalg.norm(way)
    u = np.cross(Z if abs(way[2]) < 0.9 else X, way)
    u /= np.linalg.norm(u)
    v = np.cross(-way, u)
    corners = rectangle(distance * way - half * (u + v), 2 * half * u, 2 * half * v)
    chart = 5 * (number % 3), 5 * (number // 3), 4, 4
    return quads(corners[None], [chart], [number if kind is None else kind], 16, f"Square {number}")


def bake(session, scene, **settings):
    """Return the result of a bake in the shared session."""
    return finished(session.bake(scene, dataclasses.replace(SETTINGS, **settings)))


def scene_of(*meshes, materials=None, **values):
    values.setdefault("reflection_spheres", (sphere(),))
    return Scene(tuple(meshes), tuple(materials or [material("Black", 0.0)]), **values)


FAR = square(-Z, 1e-3, 9.0, 8, 0)


def test_a_constant_sky_gives_constant_cubes_at_every_level(session):
    (cube,) = bake(session, scene_of(FAR, world=np.float32([1, 2, 3]))).reflections
    assert [level.shape for level in cube.levels] == [(6, size, size, 3) for size in (64, 32, 16, 8)]
    for level in cube.levels:
        assert level == pytest.approx(np.broadcast_to(np.float32([1, 2, 3]), level.shape), rel=1e-5)


@pytest.mark.parametrize("away", [np.zeros(3), np.array([1024.0, -2048.0, 512.0])])
def test_a_closed_furnace_is_constant(session, away):
    """All radiance is emission / (1 - reflectance), also a kilometre away from the origin."""
    room = furnace(0.5, 1.0)
    mesh = dataclasses.replace(room.meshes[0], positions=(room.meshes[0].positions + away).astype(np.float32))
    spheres = sphere(away + np.array([0.3, 0.6, 0.7])), sphere(away + 0.5, "Middle")
    scene = dataclasses.replace(room, meshes=(mesh,), reflection_spheres=spheres)
    result = bake(session, scene, resolution=32, samples=64, tolerance=1e-6)
    assert [cube.sphere for cube in result.reflections] == [0, 1]
    for level in (level for cube in result.reflections for level in cube.levels):
        assert level == pytest.approx(np.full_like(level, 2.0), rel=2e-3)
    assert not result.report.warnings


WAYS = [X, -X, Y, -Y, Z, -Z, (1, 2, -3), (-3, 1, 2)]


def test_bright_squares_are_in_their_directions(session):
    """Each shows its color in its direction, with its solid angle, and nothing is bright elsewhere."""
    colors = np.random.default_rng(5).uniform(1, 9, (len(WAYS), 3)).astype(np.float32)
    lit = [material(f"Lit {i}", 0.0, color) for i, color in enumerate(colors)]
    squares = [square(way, number=i) for i, way in enumerate(WAYS)]
    (cube,) = bake(session, scene_of(*squares, materials=lit)).reflections
    faces = cube.levels[0]
    directions = cube_directions(SIZE)
    for way, color in zip(WAYS, colors, strict=True):
        cosines = directions @ (np.asarray(way, float) / np.linalg.norm(way))
        assert faces[cosines > np.cos(0.09)] == pytest.approx(
            np.broadcast_to(color, (np.count_nonzero(cosines > np.cos(0.09)), 3)), rel=1e-5
        )
        near = cosines > np.cos(0.2)
        angles = np.broadcast_to(texel_solid_angles(SIZE), near.shape)[near]
        # Solid angle of a square of half width a at distance d: 4 asin(a^2 / (a^2 + d^2)).
        expected = 4 * np.arcsin(0.09 / (0.09 + 9)) * color
        assert (faces[near] * angles[:, None]).sum(axis=0) == pytest.approx(expected, rel=0.06)
        faces = np.where(near[..., None], 0, faces)
    assert not faces.any()


def test_faces_are_as_in_opengl():
    """World axes of the faces: +x, -x, up, down, forward (Blender's +y), back; columns and rows of each."""
    size = 4
    corner = cube_directions(size)[:, 0, 0] * np.sqrt(1 + 2 * 0.75**2)
    expected = [
        (1, 0.75, 0.75), (-1, -0.75, 0.75), (-0.75, -0.75, 1), (-0.75, 0.75, -1), (-0.75, 1, 0.75),
        (0.75, -1, 0.75),
    ]  # fmt: skip
    assert corner == pytest.approx(np.array(expected))
    numbers = np.arange(6 * size * size).reshape(6, size, size)
    assert (texels_of(cube_directions(size), size) == numbers).all()
    assert texel_solid_angles(size).sum() * 6 == pytest.approx(4 * np.pi)


def lobe(cosines, roughness):
    """Return the GGX lobe with n = v = r at cosines of directions to n: D(h) (n.l), not normalised."""
    alpha, squared = roughness**2, (1 + cosines) / 2
    return np.maximum(cosines, 0) / (squared * (alpha**2 - 1) + 1) ** 2


def test_levels_are_the_ggx_integral_and_keep_energy(session):
    """A light of four texels beside a corner, compared with the sum over all texels."""
    bake(session, scene_of(FAR))
    size = SIZE // 2
    faces = np.full((6, size, size, 3), 0.05, np.float32)
    faces[4, 2:4, 29:31] += (300, 200, 100)
    levels = finished(prefiltered(session._devices.compute, faces))
    assert (levels[0] == faces).all()
    source, angles = cube_directions(size).reshape(-1, 3), np.tile(texel_solid_angles(size).ravel(), 6)
    for number, level in enumerate(levels[1:], 1):
        assert mean_radiance(level) == pytest.approx(mean_radiance(faces), rel=1e-5)
        directions = cube_directions(level.shape[1]).reshape(-1, 3)
        weights = lobe(directions @ source.T, roughness_of(number, len(levels))) * angles
        exact = weights @ faces.reshape(-1, 3) / weights.sum(axis=1, keepdims=True)
        error = np.abs(level.reshape(-1, 3) - exact)
        assert (error.max(axis=0) < 0.08 * exact.max(axis=0)).all()
        assert (error.mean(axis=0) < 0.06 * exact.mean(axis=0)).all()


def test_textures_of_walls_are_sharper_than_the_lightmap(session):
    """A white sky lights a floor evenly; the cube shows the pixels of its texture, turned the right way."""
    pixels = np.random.default_rng(3).uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32)
    reflecting = dataclasses.replace(
        material("Floor", 1.0), reflectance_map=Texture("Image", pixels, "Map", smooth=False)
    )
    glowing = dataclasses.replace(
        material("Glow", 0.0, (2, 1, 3)), emission_map=Texture("Image", pixels, "Map", smooth=False)
    )
    uvs = {"Map": np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])}
    floor = quads(rectangle((-2, -2, -1), 4 * X, 4 * Y)[None], [(0, 0, 4, 4)], [0], 16, "Floor")
    ceiling = quads(rectangle((-2, -2, 1), 4 * Y, 4 * X)[None], [(5, 0, 4, 4)], [1], 16, "Ceiling")
    meshes = [dataclasses.replace(mesh, texture_uvs=uvs) for mesh in (floor, ceiling)]
    scene = scene_of(meshes[0], materials=[reflecting, glowing], world=np.ones(3, np.float32))
    (cube,) = bake(session, scene, samples=256, sample_emission=False).reflections
    down = cube.levels[0][3]
    # Face -y shows (s, -t) of the floor's plane z = -1, s to the right, t down: half of the texture.
    at = (np.arange(SIZE) + 0.5) / SIZE * 4 + 2
    index = at.astype(int)
    expected = pixels[index[::-1]][:, index]
    inner = np.abs(at - np.rint(at)) > 0.1
    assert down[inner][:, inner] == pytest.approx(expected[inner][:, inner], rel=5e-3)
    (cube,) = bake(session, scene_of(meshes[1], materials=[reflecting, glowing])).reflections
    up = cube.levels[0][2]
    # Face +y shows (s, t) of the plane z = 1; the ceiling's u runs along y, v along x.
    expected = pixels[index][:, index].swapaxes(0, 1) * np.float32([2, 1, 3])
    assert up[inner][:, inner] == pytest.approx(expected[inner][:, inner], rel=1e-4)


def test_a_sky_picture_and_its_sun(session):
    """An equirectangular sky is looked up in each direction; its sun adds E in one, unless it is blocked."""
    way = np.array([0.48, -0.64, 0.6])
    x = np.cross(way, Z) / np.linalg.norm(np.cross(way, Z))
    sun = Light(
        "Sun", "sun", np.zeros(3), np.stack([x, np.cross(way, x), way]), np.float32([3, 2, 1]),
        half_angle=0.0047, of_world=True,
    )  # fmt: skip
    height = 64
    v = ((np.arange(height) + 0.5) / height)[:, None, None]
    sky = np.broadcast_to(v * np.float32([1, 2, 3]), (height, 2 * height, 3)).astype(np.float32)
    (cube,) = bake(session, scene_of(FAR, world=sky)).reflections
    directions = cube_directions(SIZE)
    expected = (1 - np.arccos(directions[..., 2:]) / np.pi) * [1, 2, 3]
    assert cube.levels[0] == pytest.approx(expected, abs=0.03)
    (lit,) = bake(session, scene_of(FAR, world=sky, lights=(sun,))).reflections
    added = (lit.levels[0] - cube.levels[0]) * texel_solid_angles(SIZE)[..., None]
    assert added.sum(axis=(0, 1, 2)) == pytest.approx(np.array([3, 2, 1]), rel=1e-3)
    assert (directions[added[..., 0] > 1e-4] @ way > np.cos(0.05)).all()
    (dark,) = bake(session, scene_of(square(way), world=sky, lights=(sun,))).reflections
    assert dark.levels[0].max() < 4


@pytest.mark.parametrize(
    ("kind", "values", "radiance"),
    [
        ("point", {"radius": 0.4, "soft": False}, 5 / (np.pi * 0.16)),
        ("spot", {"radius": 0.4, "soft": True, "half_angle": 1.5}, 5 / (np.pi * 0.16)),
        ("area", {"size": np.array([0.8, 1.2])}, 5.0),
        ("area", {"size": np.array([1.0, 1.0]), "ellipse": True}, 5.0),
        ("sun", {"half_angle": 0.2}, 5 / (np.pi * np.sin(0.2) ** 2)),
    ],
)
def test_lamps_that_cameras_see_have_their_radiance(session, kind, values, radiance):
    """Each hangs in direction Z; without Camera visibility, or behind a square, it is invisible."""
    lamp = Light("Lamp", kind, 3 * Z, np.eye(3), np.full(3, 5, np.float32), **values)
    seen = dataclasses.replace(lamp, visible=True)
    (cube,) = bake(session, scene_of(FAR, lights=(seen,))).reflections
    middle = cube.levels[0][2, 30:34, 30:34]
    assert middle == pytest.approx(np.full_like(middle, radiance), rel=0.15)
    assert middle.mean() == pytest.approx(radiance, rel=0.04)
    assert not cube.levels[0][[0, 1, 3, 4, 5]].any()
    for scene in (scene_of(FAR, lights=(lamp,)), scene_of(square(Z, distance=1.0), lights=(seen,))):
        assert bake(session, scene).reflections[0].levels[0][2, 30:34, 30:34].max() < 1e-6


def test_panes_tint_and_backs_are_black(session):
    """Up a tinted pane colors the sky; down the back of a square hides it."""
    tint = np.float32([0.9, 0.5, 0.1])
    pane = dataclasses.replace(material("Pane", 0.0), transmission=uniform_transmission(Transmittance(tint)))
    above, below = square(Z, half=2.0, distance=1.0), square(-Z, half=2.0, distance=1.0, number=1)
    below = dataclasses.replace(
        below, positions=below.positions[:, ::-1], normals=-below.normals, uvs=below.uvs[:, ::-1]
    )
    scene = scene_of(above, below, materials=[pane, material("Black", 0.0)], world=np.ones(3, np.float32))
    faces = bake(session, scene).reflections[0].levels[0]
    assert faces[2].mean(axis=(0, 1)) == pytest.approx(tint, rel=0.01)
    assert not faces[3].any() and (faces[4][20:44] == 1).all()


def test_spheres_in_walls_and_too_many_of_them_get_a_warning(session, monkeypatch):
    box = furnace(0.5, 0.0)
    mesh = box.meshes[0]
    solid = dataclasses.replace(
        mesh, positions=mesh.positions[:, ::-1], normals=-mesh.normals, uvs=mesh.uvs[:, ::-1]
    )
    spheres = tuple(sphere((0.5, 0.5, 2.0), f"Sphere {i}") for i in range(3))
    scene = dataclasses.replace(
        box, meshes=(solid,), world=np.ones(3, np.float32),
        reflection_spheres=(sphere((0.5, 0.5, 0.5), "Buried"), *spheres),
    )  # fmt: skip
    monkeypatch.setattr(gather_reflections, "MAX_TEXELS", 3 * 6 * SIZE * SIZE)
    result = bake(session, scene, resolution=32)
    assert [cube.sphere for cube in result.reflections] == [0, 1, 2]
    buried, many = sorted(result.report.warnings)[:2]
    assert "Light Probe Sphere 'Buried': it is inside geometry" in buried
    assert "4 cubes of 64 x 64 exceed 3, so those after 'Sphere 1' have none" in many
    assert not result.reflections[0].levels[0].any() and result.reflections[1].levels[0].any()


@pytest.mark.parametrize(
    ("values", "problem"),
    [({"size": 0.0}, "its influence has no size"), ({"size": np.nan}, "its transform is not a number")],
)
def test_spheres_without_size_are_an_error(session, values, problem):
    with pytest.raises(SceneError, match=f"Light Probe Sphere 'Sphere': {problem}"):
        bake(session, scene_of(FAR, reflection_spheres=(sphere(**values),)))


def test_six_faces_of_256_texels_take_five_seconds_of_two_cores(session):
    """CPU time, since other programs may run; the first bake builds kernels."""
    scene = dataclasses.replace(furnace(0.5, 1.0), reflection_spheres=(sphere((0.4, 0.5, 0.6), size=0.5),))
    bake(session, scene)
    began = time.process_time()
    (cube,) = bake(session, scene, reflection_size=256).reflections
    assert time.process_time() - began < 2 * 5
    assert cube.levels[0].shape[:3] == (6, 256, 256)


def test_cubes_do_not_change_lightmaps(session):
    """A bake with cubes has the same bits as one without, and the switch leaves them out."""
    room = dataclasses.replace(furnace(0.5, 1.0), reflection_spheres=(sphere((0.5, 0.5, 0.5)),))
    off, on = (
        bake(session, room, resolution=32, visibility="rays", reflection_cubes=on) for on in (False, True)
    )
    assert (off.display == on.display).all() and not off.reflections and len(on.reflections) == 1


def test_progress_and_cancel(session):
    """Progress of the stage rises and is part of the estimate; a canceled bake leaves the session usable."""
    room = dataclasses.replace(
        furnace(0.5, 1.0), reflection_spheres=(sphere((0.5, 0.5, 0.5)), sphere((0.2, 0.5, 0.5), "Other"))
    )
    settings = dataclasses.replace(SETTINGS, resolution=32)
    work, fractions = session.bake(room, settings), []
    while len(fractions) < 4:
        progress = next(work)
        if progress.stage == "Reflection cubes":
            fractions.append(progress.fraction)
    work.close()
    assert fractions == sorted(fractions) and 0 < fractions[-1] < 1
    assert len(bake(session, room, resolution=32).reflections) == 2
    with_cubes, without = (
        BakeStages(Extent.of(room), dataclasses.replace(settings, reflection_cubes=on), {}).estimate_seconds(
            1000
        )
        for on in (True, False)
    )
    assert with_cubes > without


@pytest.mark.parametrize(
    ("compute", "has_indirect", "remedy"),
    [(None, True, "Install an OpenCL driver"), (1, False, "Switch Combined on"), (1, True, None)],
)
def test_bakes_that_lack_something_say_so(compute, has_indirect, remedy):
    job = SimpleNamespace(compute=compute, settings=SimpleNamespace(has_indirect=has_indirect))
    warnings = gather_reflections.reflection_warnings(SimpleNamespace(job=job))
    assert len(warnings) == (remedy is not None) and all(remedy in text for text in warnings)
