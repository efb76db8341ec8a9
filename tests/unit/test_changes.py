import dataclasses

import numpy as np
import pytest

from engine import Light, SceneChanges, SceneError
from engine.scene.probe_volume import ProbeVolume
from engine.scene.scene_changes import changes_between, same_probe_volumes, transformed
from tests.analytic.scenes import material, nine_quad_room

ROOM = nine_quad_room()
TURN = np.array([[0, -2, 0, 1], [3, 0, 0, -2], [0, 0, 0.5, 7], [0, 0, 0, 1]], float)


def lamp(name):
    return Light(name, "point", np.array([1.0, 2, 3]), np.eye(3), np.ones(3, np.float32))


def test_what_is_not_named_stays():
    assert SceneChanges().of(ROOM) == ROOM and SceneChanges().empty


def test_each_kind_of_change_replaces_its_part():
    red, shape = material("Red", (0.9, 0, 0)), ROOM.meshes[0].subset(np.arange(len(ROOM.meshes[0].face)) > 3)
    changes = SceneChanges((lamp("A"), lamp("B")), np.float32([1, 2, 3]), {2: red}, {}, {0: shape})
    scene = changes.of(ROOM)
    assert [light.name for light in scene.lights] == ["A", "B"] and scene.materials[2] is red
    assert scene.world.tolist() == [1, 2, 3] and scene.meshes == (shape,)
    assert scene.materials[:2] == ROOM.materials[:2]


@pytest.mark.parametrize(
    "changes", [SceneChanges(materials={99: material("No", 0.5)}), SceneChanges(moves={-1: TURN})]
)
def test_numbers_that_nothing_has_are_refused(changes):
    with pytest.raises(SceneError, match="Changes refer to index"):
        changes.of(ROOM)


@pytest.mark.parametrize("mirror", [1, -1])
def test_moved_meshes_keep_their_fronts_and_right_angles(mirror):
    """An uneven scale bends normals otherwise than positions; a mirror turns corners around."""
    matrix = TURN @ np.diag([mirror, 1, 1, 1])
    mesh = transformed(ROOM.meshes[0], matrix)
    sides = np.cross(*(mesh.positions[:, i] - mesh.positions[:, 0] for i in (1, 2)))
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    assert np.einsum("tci,ti->tc", mesh.normals, sides) == pytest.approx(1, abs=1e-4)
    corners = ROOM.meshes[0].positions @ matrix[:3, :3].T + matrix[:3, 3]
    order = [0, 1, 2] if mirror > 0 else [0, 2, 1]
    assert mesh.positions == pytest.approx(corners[:, order], abs=1e-5)
    assert np.array_equal(mesh.uvs, ROOM.meshes[0].uvs[:, order])


def test_a_matrix_that_flattens_is_refused():
    with pytest.raises(SceneError, match="no inverse"):
        transformed(ROOM.meshes[0], np.diag([1, 1, 0, 1]))


def test_the_difference_of_two_scenes_makes_one_of_the_other():
    copies = [
        dataclasses.replace(surface, reflectance=surface.reflectance.copy()) for surface in ROOM.materials
    ]
    same = dataclasses.replace(ROOM, materials=tuple(copies), world=ROOM.world.copy())
    assert changes_between(ROOM, same).empty
    other = dataclasses.replace(
        same,
        lights=(lamp("A"),),
        materials=(*same.materials[:-1], material("Red", (1, 0, 0))),
        meshes=(transformed(ROOM.meshes[0], TURN),),
    )
    changes = changes_between(ROOM, other)
    assert not changes.empty and changes.world is None and set(changes.materials) == {len(ROOM.materials) - 1}
    assert changes.of(ROOM).meshes[0] is other.meshes[0] and changes.of(ROOM).lights == other.lights


def test_scenes_with_other_parts_have_no_difference():
    for name, value in {"atlases": ("Other",), "origin": np.ones(3), "light_groups": ("Key",)}.items():
        assert changes_between(ROOM, dataclasses.replace(ROOM, **{name: value})) is None
    assert changes_between(ROOM, dataclasses.replace(ROOM, meshes=ROOM.meshes * 2)) is None


def volumes_of(*volumes, origin=(0, 0, 0)):
    """Return the room with probe volumes: pairs of a location in world space, and fields of the volume."""
    made = []
    for location, changed in volumes:
        matrix = np.diag([0.3, 0.2, 0.1, 1.0])
        matrix[:3, 3] = np.subtract(location, origin)
        made.append(dataclasses.replace(ProbeVolume("Volume", matrix, (2, 3, 1)), **changed))
    return dataclasses.replace(ROOM, origin=np.float64(origin), probe_volumes=tuple(made))


def test_probe_volumes_are_the_same_relative_to_another_origin():
    places = (((1e6, -3, 0.7), {}), ((0, 0, 0.1), {"name": "Second"}))
    before, after = volumes_of(*places), volumes_of(*places, origin=(1e6 / 3, 77, -0.1))
    assert not np.array_equal(before.probe_volumes[0].matrix, after.probe_volumes[0].matrix)
    assert same_probe_volumes(before, after) and same_probe_volumes(ROOM, ROOM)


@pytest.mark.parametrize(
    "other",
    [
        [],
        [((1e4, 2, 3.001), {})],
        [((1e4, 2, 3), {"resolution": (2, 3, 2)})],
        [((1e4, 2, 3), {"name": "Other"})],
        [((1e4, 2, 3), {}), ((1e4, 2, 3), {})],
    ],
    ids=["none", "moved", "resolution", "name", "more"],
)
def test_other_probe_volumes_differ(other):
    assert not same_probe_volumes(volumes_of(((1e4, 2, 3), {})), volumes_of(*other, origin=(5e3, 1, -7)))
