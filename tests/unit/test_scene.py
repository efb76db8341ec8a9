from dataclasses import replace

import numpy as np
import pytest

from engine.errors import SceneError, SettingsError
from engine.scene import Light, Material, Mesh, Scene, check_scene
from engine.settings import Settings, check_settings


def triangle(**changes):
    positions = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    normals = np.broadcast_to(np.float32([0, 0, 1]), (1, 3, 3))
    index = np.zeros(1, np.int32)
    return replace(Mesh("Lamp", positions, normals, positions[..., :2], index, index, index), **changes)


def scene(*meshes):
    return Scene(meshes, (Material("grey", np.ones(3), np.zeros(3)),))


def test_a_sound_scene_passes():
    check_scene(scene(triangle()))


@pytest.mark.parametrize("name", ["positions", "uvs"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_not_finite(name, value):
    values = getattr(triangle(), name).copy()
    values[0, 1, 0] = value
    with pytest.raises(SceneError, match="Object 'Lamp' has NaN.*[.] [A-Z]"):
        check_scene(scene(triangle(**{name: values})))


def test_uvs_outside():
    with pytest.raises(SceneError, match="Object 'Lamp' has lightmap UVs outside 0-1"):
        check_scene(scene(triangle(uvs=triangle().uvs + 0.5)))


@pytest.mark.parametrize(
    ("reflectance", "emission"), [(np.nan, 0), (1.5, 0), (-0.1, 0), (0.5, np.inf), (0.5, -1), (0.5, 3e38)]
)
def test_materials_that_are_no_light(reflectance, emission):
    bad = Material("Neon", np.full(3, reflectance), np.full(3, emission))
    with pytest.raises(SceneError, match="Material 'Neon' has .*Mend its"):
        check_scene(replace(scene(triangle()), materials=(bad,)))


def lamp(kind, **values):
    return Light(
        "Lamp", **{"kind": kind, "position": np.zeros(3), "axes": np.eye(3), "strength": np.ones(3)} | values
    )


@pytest.mark.parametrize("kind", ["sun", "spot", "area"])
def test_lights_without_a_direction(kind):
    flat = lamp(kind, axes=np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(SceneError, match="Light 'Lamp' has axes"):
        check_scene(replace(scene(triangle()), lights=(flat,)))


def test_a_point_needs_no_direction_and_a_spot_is_not_flat():
    check_scene(replace(scene(triangle()), lights=(lamp("point", axes=np.zeros((3, 3))),)))
    with pytest.raises(SceneError, match="Light 'Lamp' has axes"):
        check_scene(replace(scene(triangle()), lights=(lamp("spot", stretch=np.array([1.0, 0.0, 1.0])),)))


def test_a_world_that_is_no_light():
    with pytest.raises(SceneError, match="world's radiance"):
        check_scene(replace(scene(triangle()), world=np.float32([1, np.nan, 1])))


@pytest.mark.parametrize(("face", "subface"), [((1, 0), (0, 0)), ((0, 0), (1, 0)), ((0, 0), (0, 0))])
def test_triangles_out_of_order(face, subface):
    one = triangle()
    two = {name: np.repeat(getattr(one, name), 2, axis=0) for name in ("positions", "normals", "uvs")}
    index = {"face": np.int32(face), "subface": np.int32(subface), "material": np.zeros(2, np.int32)}
    with pytest.raises(SceneError, match="of object 'Lamp' are not in the order"):
        check_scene(scene(triangle(**two, **index)))


def test_no_mesh():
    with pytest.raises(SceneError, match="no mesh with faces"):
        check_scene(scene())


@pytest.mark.parametrize(
    ("name", "value"),
    [("resolution", 0), ("resolution", 100000), ("hemicube", 48), ("iterations", 0), ("tolerance", -1),
     ("tolerance", float("nan")), ("method", "magic"), ("dilation", -1), ("seed", -1), ("batch_bytes", 0),
     ("outputs", ("direct", "direct")), ("outputs", ())],
)  # fmt: skip
def test_settings_out_of_range(name, value):
    with pytest.raises(SettingsError, match=name):
        check_settings(Settings(**{name: value}))
