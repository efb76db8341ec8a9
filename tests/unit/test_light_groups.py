"""Membership of lights in light groups, and maps of groups that sum to the map of all light."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Light, Scene
from engine.postprocess.output_names import light_group_maps
from engine.scene.light_groups import light_group_names, light_groups
from engine.texel_gather.finishing import scale_to_sum
from tests.analytic.scenes import furnace, material


def lamp(group: str, strength: float = 1.0) -> Light:
    """Return a lamp of a group."""
    return Light("Lamp", "point", np.zeros(3), np.eye(3), np.full(3, strength, np.float32), light_group=group)


def scene(*lamps: Light, mesh_group: str = "", glow: float = 0.0, world: float = 0.0, **more) -> Scene:
    """Return a room of a mesh that may glow, with lamps and groups A, B and A again."""
    room = furnace(0.5, glow)
    mesh = replace(room.meshes[0], light_group=mesh_group)
    sky = np.full(3, world, np.float32)
    return replace(room, meshes=(mesh,), lights=lamps, world=sky, **{"light_groups": ("A", "B", "A"), **more})


@pytest.mark.parametrize(
    ("room", "names"),
    [
        (scene(lamp("A")), ["A", "B"]),
        (scene(), ["A", "B"]),
        (scene(lamp("")), ["A", "B", "Ungrouped"]),
        (scene(lamp("C")), ["A", "B", "Ungrouped"]),
        (scene(lamp("C", 0.0)), ["A", "B"]),
        (scene(glow=1.0), ["A", "B", "Ungrouped"]),
        (scene(glow=1.0, mesh_group="B"), ["A", "B"]),
        (scene(world=0.1), ["A", "B", "Ungrouped"]),
        (scene(world=0.1, world_light_group="A"), ["A", "B"]),
        (scene(light_groups=()), ["Ungrouped"]),
        (scene(lamp(""), light_groups=("Ungrouped",)), ["Ungrouped"]),
    ],
)
def test_light_in_no_group_has_one_of_its_own_if_there_is_any(room, names):
    assert light_group_names(room) == names
    assert light_group_maps(room) == [f"light_group {name}" for name in names]


def test_lamps_that_shine_meshes_and_the_world_have_numbers():
    room = scene(lamp("B"), lamp("A", 0.0), lamp("elsewhere"), mesh_group="B", glow=1.0, world=1.0)
    groups = light_groups(room)
    assert groups.count == 3 and groups.world == 2
    assert groups.lamps.tolist() == [1, 2] and groups.meshes.tolist() == [1]


def test_a_mesh_without_light_asks_for_no_group():
    """Materials that its faces do not have do not count."""
    room = scene(lamp("A"))
    glowing = replace(room, materials=(*room.materials, material("Unused", 0.5, 3.0)))
    assert light_group_names(glowing) == ["A", "B"]


def test_maps_sum_up_in_their_proportions():
    random = np.random.default_rng(5)
    maps = {name: random.random((2, 7, 11, 3), np.float32) for name in "ABC"}
    maps["B"][..., 1] = 0
    maps["C"] *= np.float32(1e-9)
    combined = (1.1 * sum(maps.values())).astype(np.float32)
    divided = scale_to_sum(maps, combined)
    total = np.sum(list(divided.values()), axis=0, dtype=np.float64)
    np.testing.assert_allclose(total, combined, rtol=1e-6)
    np.testing.assert_allclose(divided["A"], 1.1 * maps["A"], rtol=1e-4)
    assert not divided["B"][..., 1].any()


def test_light_that_no_map_has_is_shared_as_the_whole_map_is():
    maps = {name: np.ones((1, 2, 2, 3), np.float32) * part for name, part in (("A", 3), ("B", 1), ("C", 0))}
    for images in maps.values():
        images[0, 0, 0] = 0
    maps["B"][0, 1, 1] = -5
    combined = np.full((1, 2, 2, 3), 4, np.float32)
    divided = scale_to_sum(maps, combined)
    np.testing.assert_allclose(divided["A"][0, 0, 0], 3, rtol=0.5)
    np.testing.assert_allclose(divided["A"][0, 1, 1], 4, rtol=1e-6)
    assert all(images.min() >= 0 for images in divided.values()) and not divided["C"].any()


def test_where_there_is_no_light_maps_are_black():
    divided = scale_to_sum({"A": np.zeros((1, 1, 1, 3), np.float32)}, np.zeros((1, 1, 1, 3), np.float32))
    assert not divided["A"].any()
