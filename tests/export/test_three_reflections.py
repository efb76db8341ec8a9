"""Mirrors in three.js, lit by reflection cubes of a room, against the room's walls themselves."""

import json

import numpy as np
import pytest

from tests.blender.things import part
from tools.engines.web import THREE_REFLECTIONS

SIZE, FORMATS = 64, ("ktx2", "exr", "hdr")

#: Blender's axes (x, y, z) in three.js: rows are x, z, -y.
Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])

#: Half widths of the room, its rotation about z, its middle, and the place of the cube.
HALF = np.array([2.0, 3.0, 1.5])
ANGLE = 0.4
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
MIDDLE, AT = np.array([5.0, -7.0, 2.0]), np.array([5.6, -6.2, 1.6])

#: Distance of a second room with white walls, by which surfaces' own reflectance is measured.
AWAY = np.array([100.0, 0, 0])


def walls(points):
    """Return the radiance of the walls at points, (..., 3)."""
    return 1 + 0.6 * np.sin(points @ np.array([[0.9, 0.3, -0.5], [-0.4, 0.8, 0.6], [0.7, -0.6, 1.1]]))


def meet_walls(points, directions):
    """Return where rays from points in the room meet its walls, (n, 3)."""
    p, d = (points - MIDDLE) @ TURN / HALF, directions @ TURN / HALF
    return points + ((np.sign(d) - p) / d).min(axis=-1, keepdims=True) * directions


def matrix(middle):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = TURN * HALF, middle
    return made


def write_cube(folder, name, at, middle, radiance):
    """Write the files of a cube whose radiance is a function of directions; return its entry and levels."""
    faces, filtered = part("engine.reflections.cube_faces"), []
    for size in (SIZE, SIZE // 2, SIZE // 4, SIZE // 8):
        fine = radiance(faces.cube_directions(size).reshape(-1, 3)).reshape(6, size, size, 3)
        filtered.append(fine.astype(np.float32))
    spheres = part("engine.scene.reflection_sphere")
    volume = spheres.ReflectionVolume("box", matrix(middle))
    sphere = spheres.ReflectionSphere(name, at, volume, volume)
    cube = part("engine.bake_result").ReflectionCube(0, tuple(filtered))
    files = part("operators.result.reflection_files")
    owner = part("operators.result.destination").Destination(folder, (), str(folder))
    entry = files._entry(name, cube, sphere, np.zeros(3), owner)
    for file in entry["files"]:
        files.ReflectionFile(file, cube, entry).write(folder / file)
    return entry


@pytest.fixture
def rooms(hemibake, engine, tmp_path):
    """Write cubes of the room and of a white one, whose levels all have the same, unfiltered light."""
    entries = [
        write_cube(tmp_path, "Room", AT, MIDDLE, lambda ways: walls(meet_walls(AT, ways))),
        write_cube(tmp_path, "White", AT + AWAY, MIDDLE + AWAY, np.ones_like),
    ]
    lost = {**entries[1], "name": "Lost", "files": [f"lost.{ending}" for ending in FORMATS]}
    manifest = {"version": 2, "lightmaps": {}, "objects": [], "reflections": [*entries, lost]}
    (tmp_path / "hemibake.json").write_text(json.dumps(manifest))
    return tmp_path


def test_mirrors_show_the_walls(rooms):
    """On the floor and in the air, smooth and rough: each within 2 % of the walls where its ray meets them.

    Box projection is exact in a box; the cube has 64 texels a face, so the rest is its resolution.
    """
    random = np.random.default_rng(7)
    inside = MIDDLE + (random.uniform(-0.9, 0.9, (24, 3)) * HALF) @ TURN.T
    inside[:12, 2] = MIDDLE[2] - 1.49
    normals = np.tile([0.0, 0.0, 1.0], (24, 1))
    normals[12:] = random.normal(size=(12, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ways = normals + random.uniform(-0.6, 0.6, (24, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    roughness = np.where(np.arange(24) % 3 == 2, 0.4, 0.0)
    mirrors = [
        {
            "position": (Y_UP @ (place + shift)).tolist(),
            "normal": (Y_UP @ normal).tolist(),
            "eye": (Y_UP @ (place + shift + 0.5 * way)).tolist(),
            "roughness": rough,
        }
        for shift in (0 * AWAY, AWAY)
        for place, normal, way, rough in zip(inside, normals, ways, roughness.tolist(), strict=True)
    ]
    problems, data = THREE_REFLECTIONS.answer(rooms, {"mirrors": mirrors, "formats": FORMATS})
    shown = np.frombuffer(data, np.float32).reshape(len(FORMATS), 2, 24, 4)[..., :3]
    reflected = 2 * np.einsum("nk,nk->n", ways, normals)[:, None] * normals - ways
    # three.js leans rough reflections towards the normal.
    lean = roughness[:, None] ** 4
    reflected = (1 - lean) * reflected + lean * normals
    expected = walls(meet_walls(inside, reflected))
    for of_format in shown:
        assert (of_format[1] > 0.7).all()
        assert of_format[0] / of_format[1] == pytest.approx(expected, rel=0.02)
    assert len(problems) == 3 and all("Reflection cube 'Lost': 'lost." in text for text in problems)
