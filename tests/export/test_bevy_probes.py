"""Light of probe volumes in Bevy, on a ball, against the formula of ambient cubes."""

import json
import math

import numpy as np
import pytest

from tests.blender.things import part
from tools.engines import bevy

_WIDTH = 120

#: Probes of the volume along its axes, half sizes in m, and its turn about z in radians.
_RESOLUTION, _HALF, _TURN = (3, 2, 4), np.array([1.2, 1.0, 1.6]), 0.4

_ALBEDO, _DISTANCE, _FOV = 0.5, 3.0, math.radians(45)


@pytest.fixture
def volume(hemibake, tmp_path):
    """Write a volume around the ball and a lost one; return the ambient cubes, (z, y, x, 6, 3)."""
    if missing := bevy.missing():
        pytest.skip(f"{missing}: exports are not shown with Bevy")
    bevy.install()
    random, harmonics = np.random.default_rng(11), part("engine.probes.spherical_harmonics")
    n = math.prod(_RESOLUTION)
    coefficients = random.uniform(-0.1, 0.1, (n, 9, 3)).astype(np.float32)
    coefficients[:, 0] += random.uniform(1, 3, (n, 3))
    entry = {
        "name": "Volume", "file": "box_Probes.exr", "resolution": _RESOLUTION, "matrix": _matrix().tolist(),
        "coefficients": "radiance SH L2", "layout": "", "ktx2": "box_Probes.ktx2",
    }  # fmt: skip
    voxels = part("engine.probes.bevy_volume").bevy_voxels(coefficients, _RESOLUTION)
    (tmp_path / "box_Probes.ktx2").write_bytes(part("engine.encoding.ktx2").ktx2_volume(voxels))
    lost = {**entry, "name": "Lost", "ktx2": "lost.ktx2"}
    manifest = {"version": 2, "lightmaps": {}, "objects": [], "probes": [entry, lost]}
    (tmp_path / "probes.json").write_text(json.dumps(manifest))
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    return harmonics.irradiance(coefficients, axes).reshape(*_RESOLUTION[::-1], 6, 3)


def _matrix() -> np.ndarray:
    made = np.eye(4)
    cos, sin = math.cos(_TURN), math.sin(_TURN)
    made[:3, :3] = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) * _HALF
    made[:3, 3] = (0.1, -0.2, 0.3)
    return made


def _export_ball(path):
    """Write a ball of radius 1 m at the origin without a lightmap, and a camera that looks along y."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=64)
    ball = bpy.context.object
    ball.data.shade_smooth()
    material = bpy.data.materials.new("Grey")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (_ALBEDO, _ALBEDO, _ALBEDO, 1)
    inputs["Specular IOR Level"].default_value, inputs["Roughness"].default_value = 0, 1
    ball.data.materials.append(material)
    camera = bpy.data.cameras.new("Camera")
    camera.angle = _FOV
    obj = bpy.data.objects.new("Camera", camera)
    obj.location, obj.rotation_euler = (0, -_DISTANCE, 0), (math.pi / 2, 0, 0)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = _WIDTH
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", export_cameras=True)


def _points() -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels that show the ball away from its border, (h, w) bool, and points there, (n, 3)."""
    edge = math.tan(_FOV / 2) * (2 * (np.arange(_WIDTH) + 0.5) / _WIDTH - 1)
    x, z = np.meshgrid(edge, edge)
    ways = np.stack([x, np.ones_like(x), z], axis=-1)
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    along = _DISTANCE * ways[..., 1]
    inside = 1 - _DISTANCE**2 + along**2
    shown = inside > 0.1
    points = (along - np.sqrt(np.maximum(inside, 0)))[..., None] * ways - (0, _DISTANCE, 0)
    return shown, points[shown]


def _interpolated(cubes: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the ambient cubes between the eight probes around points, (n, 6, 3); clamped at the border."""
    inverse = np.linalg.inv(_matrix())
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    size = np.array(_RESOLUTION)
    cell = np.clip((local + 1) / 2 * size - 0.5, 0, size - 1)
    low = np.minimum(cell.astype(int), size - 2)
    offset = cell - low
    total = np.zeros((len(points), 6, 3))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, offset, 1 - offset), axis=1)
        i, j, k = (low + corner).T
        total += weight[:, None, None] * cubes[k, j, i]
    return total


def test_bevy_shows_a_turned_volume(volume, tmp_path):
    """Sides of the world axes, weighted by the squares of the normal. A lost file is named."""
    _export_ball(tmp_path / "ball.glb")
    shown = bevy.show(tmp_path / "ball.glb", _WIDTH, _WIDTH, probes="probes.json")
    assert len(shown.problems) == 1
    assert shown.problems[0].startswith("Probe volume 'Lost': 'lost.ktx2' is not readable")
    where, points = _points()
    sides = np.where(points < 0, 3, 0) + np.arange(3)
    cubes = _interpolated(volume, points)
    light = sum(points[:, [axis]] ** 2 * cubes[np.arange(len(points)), sides[:, axis]] for axis in range(3))
    assert np.count_nonzero(where) > 2000 and np.ptp(light, axis=0).min() > 0.2
    assert np.percentile(np.abs(shown.pixels[where] / (_ALBEDO * light) - 1), 99) < 0.02
