"""Dynamic objects: left out of bakes, and lit by light probes in the preview."""

import time

import numpy as np
import pytest

from tests.blender.test_light_probes import bake, probe_volume
from tests.blender.test_preview_render import render
from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    finished,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    read_scene,
    snapshot,
    square,
)


def grid(name, matrix, resolution, level=0.0, has_groups=False):
    """Return probes whose coefficients vary at random around a level of the mean; a quarter is of Lamps."""
    results = part("engine.bake_result")
    count = int(np.prod(resolution))
    light = np.random.default_rng(count).uniform(-0.2, 0.2, (count, 9, 3)).astype(np.float32)
    light[:, 0] += 3 + level
    valid, places = np.ones(count, np.float32), np.zeros((count, 3), np.float32)
    groups = {"Lamps": 0.25 * light, "Sky": 0.75 * light} if has_groups else {}
    return results.ProbeGrid(name, resolution, matrix, light, valid, places, groups)


def expected(probes, point, normal):
    """Return E/pi of probes at a point, interpolated between the nearest eight, (3,)."""
    harmonics = part("engine.probes.spherical_harmonics")
    unit = np.linalg.solve(probes.matrix, np.append(point, 1))[:3]
    size = np.array(probes.resolution)
    place = np.clip((unit + 1) / 2 * size - 0.5, 0, size - 1)
    low = np.minimum(place.astype(int), np.maximum(size - 2, 0))
    part_of = place - low
    light = np.zeros(3)
    for corner in np.ndindex(2, 2, 2):
        at = np.minimum(low + corner, size - 1)
        weight = np.prod(np.where(corner, part_of, 1 - part_of))
        number = (at[2] * size[1] + at[1]) * size[0] + at[0]
        light += weight * harmonics.irradiance(probes.coefficients[[number]], normal[None])[0, 0]
    return light


def place(obj, normal, centre):
    """Turn a unit square towards a normal around a centre, with a camera that sees all of it."""
    import bpy
    from mathutils import Matrix, Vector

    turn = Vector(normal).to_track_quat("Z", "Y").to_matrix().to_4x4()
    obj.matrix_world = Matrix.Translation(centre) @ turn @ Matrix.Translation((-0.5, -0.5, 0))
    camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.9
    camera.matrix_world = Matrix.Translation(Vector(centre) + Vector(normal)) @ turn
    bpy.context.scene.camera = camera
    bpy.context.view_layer.update()
    return np.array(turn)[:3, :3]


@pytest.mark.parametrize(
    ("normal", "has_groups"),
    [((0.0, 0.0, 1.0), False), ((0.6, -0.64, 0.48), False), ((0.6, -0.64, 0.48), True)],
)
def test_the_preview_interpolates_the_probes(tmp_path, normal, has_groups):
    """Of two nested volumes, one rotated, the fine one lights a square that leaves it at the right.

    The light mixer weights the parts of light groups.
    """
    import bpy

    scene = bpy.context.scene
    turned = np.eye(4)
    turned[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    coarse = grid("Coarse", turned @ np.diag([2.0, 2, 2, 1]), (2, 3, 1), 0.0, has_groups)
    inner = np.diag([0.6, 0.7, 0.5, 1.0])
    inner[:3, 3] = [-0.4, 0.1, 0.2]
    fine = grid("Fine", inner, (3, 2, 4), 2.0, has_groups)
    part("operators.result.probe_images").keep_probes(scene, [fine, coarse], np.zeros(3))
    if has_groups:
        entry = scene.hemibake.lightmaps.add()
        entry.name, entry.light_groups = "Lightmap", '["Lamps", "Sky"]'
    obj = square("Character", uvs=None, surface=material("Skin", (0.8, 0.5, 0.25)))
    obj.hemibake.role = "DYNAMIC"
    centre = np.array([0.1, 0.05, 0.1])
    axes = place(obj, normal, centre)
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    factor = 1.0
    if has_groups:
        mixer = part("operators.result.light_mixer")
        mixer.set_mixer_mix(scene.hemibake.light_mixer, {"Lamps": ((1, 1, 1), 2.0), "Sky": ((1, 1, 1), 0.5)})
        factor = 0.25 * 2.0 + 0.75 * 0.5
    found = render(scene, tmp_path, 64)
    count = len(found)
    steps = (np.arange(count) + 0.5) / count - 0.5
    for row, column in [(0, 0), (count - 1, 0), (0, count - 1), (2, 1)]:
        point = centre + 0.9 * axes @ [steps[column], steps[row], 0]
        unit = np.linalg.solve(fine.matrix, np.append(point, 1))[:3]
        probes = fine if np.abs(unit).max() < 1 else coarse
        light = expected(probes, point, np.array(normal)) * [0.8, 0.5, 0.25] * factor
        assert found[row, column] == pytest.approx(light, rel=0.03)


def test_volumes_of_equal_names_keep_images_of_their_own():
    """A local and a linked volume may have the same name: each bake and Live write two images."""
    import bpy

    scene, images = bpy.context.scene, part("operators.result.probe_images")

    def levels():
        """Return the image and the mean red of the first block, E/pi of the mean light, of each volume."""
        found = []
        for entry in scene.hemibake.probe_volumes:
            red = pixels(entry.image)[:, : entry.resolution[0], 0].mean()
            found.append((entry.image.name, red))
        return found

    def volumes(*means):
        return [grid("Volume", np.eye(4), (2, 3, 1), mean) for mean in means]

    images.keep_probes(scene, volumes(1, 9), np.zeros(3))
    first, count = levels(), len(bpy.data.images)
    assert first[0][0] != first[1][0] and first[1][1] > 2 * first[0][1]
    images.keep_probes(scene, volumes(1, 9), np.zeros(3))
    assert levels() == first and len(bpy.data.images) == count
    images.update_probes(scene, volumes(9, 1))
    assert [red for _, red in levels()] == [red for _, red in reversed(first)]

    # Files of older versions have one image for both.
    for entry in scene.hemibake.probe_volumes:
        entry.image = bpy.data.images[first[0][0]]
    images.keep_probes(scene, volumes(1, 9), np.zeros(3))
    assert [red for _, red in levels()] == [red for _, red in first]


def test_probes_are_shown_as_spheres_and_removed_again(tmp_path):
    """Spheres lie at the probes of a rotated and a far volume, face outwards, and show E/pi of the probes."""
    import bpy

    scene = bpy.context.scene
    turned = np.eye(4)
    turned[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    coarse = grid("Coarse", turned @ np.diag([2.0, 2, 2, 1]), (2, 3, 1))
    far = np.diag([0.6, 0.7, 0.5, 1.0])
    far[:3, 3] = [50, 0, 0]
    part("operators.result.probe_images").keep_probes(
        scene, [grid("Far", far, (3, 2, 4)), coarse], np.zeros(3)
    )
    before = snapshot()
    count = len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)
    assert bpy.ops.hemibake.show_light_probes() == {"FINISHED"}
    (obj,) = [obj for obj in scene.objects if obj.get("hemibake_probe_spheres")]
    assert obj.hide_render and obj.hide_select and obj.hemibake.role == "DYNAMIC"
    places = np.empty(3 * len(obj.data.vertices), np.float32)
    obj.data.vertices.foreach_get("co", places)
    spheres = places.reshape(30, 18, 3)
    centres = spheres.mean(axis=1)
    inner = [far[:3, 3] + far.diagonal()[:3] * unit for unit in ((-2 / 3, -0.5, -0.75), (2 / 3, 0.5, 0.75))]
    assert centres[[0, 23]] == pytest.approx(np.array(inner), abs=1e-4)
    for polygon in list(obj.data.polygons)[:32]:
        assert np.dot(np.array(polygon.center) - centres[0], polygon.normal) > 0
    groups = [
        node.node_tree.name for node in obj.material_slots[0].material.node_tree.nodes if node.type == "GROUP"
    ]
    assert groups == ["Light probes"]

    # After the volumes were deleted and a bake ran, spheres and their copies can still be removed.
    bpy_link(obj.copy())
    scene.hemibake.probe_volumes.clear()
    assert bpy.ops.hemibake.show_light_probes() == {"FINISHED"}
    assert not bpy.ops.hemibake.show_light_probes.poll()
    assert (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)) == count
    after = snapshot()
    assert after["selected"] == before["selected"] and after["active"] == before["active"]


def test_thousands_of_spheres_are_shown_without_a_stall():
    """CPU time, since other programs may run: ten times the 0.15 s of an idle core for 16^3 spheres."""
    import bpy

    volume = grid("Grid", np.diag([2.0, 2, 2, 1]), (16, 16, 16))
    part("operators.result.probe_images").keep_probes(bpy.context.scene, [volume], np.zeros(3))
    began = time.process_time()
    assert bpy.ops.hemibake.show_light_probes() == {"FINISHED"}
    assert time.process_time() - began < 1.5
    (obj,) = [obj for obj in bpy.context.scene.objects if obj.get("hemibake_probe_spheres")]
    assert len(obj.data.vertices) == 18 * 16**3


def test_dynamic_objects_are_left_out_of_bakes_and_lit_by_their_probes(tmp_path):
    """A black square inside a furnace would darken it; the preview lights it as the walls, 2 E/pi."""
    import bpy

    furnace()
    probe_volume(resolution=(2, 2, 2))
    obj = square("Character", uvs=None, surface=material("Skin", (0.5, 0.5, 0.5)))
    obj.location, obj.scale, obj.hemibake.role = (0.3, 0.3, 0.5), (0.4, 0.4, 1), "DYNAMIC"
    bpy.context.view_layer.update()
    before = snapshot()
    bake(tmp_path)
    assert part("operators.scene.bake_records").bake_record(obj, bpy.context.scene).image is None
    (entry,) = bpy.context.scene.hemibake.probe_volumes
    assert tuple(entry.resolution) == (2, 2, 2) and entry.image.packed_file
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    skin = obj.material_slots[0].material
    groups = [node.node_tree for node in skin.node_tree.nodes if node.type == "GROUP"]
    assert [group.name for group in groups] == ["Light probes"]
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    after = snapshot()
    assert after["slots"]["Character"] == before["slots"]["Character"]
    assert after["node groups"] == before["node groups"]


def test_an_object_on_a_floor_has_its_light_with_the_volume_of_the_button():
    """One wall of a closed room emits: light of the preview and of the floor differ by less than 5 %."""
    import bpy

    # Each face of the room has 30 x 30 texels.
    square = np.array([(1, 1), (31, 1), (31, 31), (1, 31)])
    uvs = np.concatenate([(square + np.array([32 * (face % 3), 32 * (face // 3)])) / 96 for face in range(6)])
    room = mesh_object("Room", CUBE, INWARD, uvs, material("Wall", (0.5, 0.5, 0.5)))
    room.data.materials.append(material("Glow", emission=1.0))
    room.data.polygons[5].material_index = 1
    room.scale = size = (3.0, 4.0, 2.5)
    bpy.context.view_layer.update()
    assert bpy.ops.hemibake.add_light_probes() == {"FINISHED"}
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.samples, settings.probe_samples = 96, 4096, 6000
    settings.sample_emission, settings.texel_samples, settings.visibility = False, "16", "rays"
    settings.hide_seams = False
    read = read_scene()
    result = finished(
        part("engine").bake(read.scene, part("operators.bake_settings").read_settings(settings))
    )
    (probes,) = result.probes
    assert probes.resolution == (11, 14, 9) and (probes.validity > 0.9).all()
    steps, up = (np.arange(30) + 0.5) / 30, np.array([0.0, 0.0, 1.0])
    light = [
        expected(probes, np.array([x * size[0], y * size[1], 0]) - read.scene.origin, up)
        for y in steps for x in steps
    ]  # fmt: skip
    assert np.array(light).reshape(30, 30, 3) == pytest.approx(result.display[0, 1:31, 1:31], rel=0.05)
