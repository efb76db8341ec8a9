"""A bake of changed objects bakes those whose light can have changed by more than the tolerance."""

import numpy as np
import pytest

from tests.blender.things import CUBE, INWARD, bpy_link, material, mesh_object, part, pixels, report

pytestmark = pytest.mark.one_version


@pytest.fixture(autouse=True)
def settings():
    import bpy

    settings = bpy.context.scene.hemibake
    settings.resolution, settings.margin, settings.samples = 47, 2, 132
    return settings


def room(name, x, atlas):
    """Return floor and shell of a closed room at x, a cube of 1 m, and the lamp in it."""
    import bpy

    corners = [(x + 1.1 * a, b, c) for a, b, c in CUBE]
    parts = []
    for part_name, faces in (("Floor", INWARD[:1]), ("Shell", INWARD[1:])):
        obj = mesh_object(f"{part_name} {name}", corners, faces, surface=material(f"{part_name} {name}"))
        obj.hemibake.atlas = atlas
        parts.append(obj)
    lamp = bpy_link(bpy.data.objects.new(f"Lamp {name}", bpy.data.lights.new(f"Lamp {name}", "POINT")))
    lamp.data.energy, lamp.data.shadow_soft_size = 10, 0.03
    lamp.location = (x + 0.4, 0.5, 0.7)
    return *parts, lamp


@pytest.fixture(params=["own lightmaps", "one lightmap"])
def rooms(request):
    """Two rooms without a window, baked."""
    one = room("A", 0, "Lightmap A" if request.param == "own lightmaps" else "Lightmap")
    other = room("B", 3.7, "Lightmap B" if request.param == "own lightmaps" else "Lightmap")
    bake("ALL")
    return one, other


def bake(target):
    import bpy

    bpy.context.scene.hemibake.target = target
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def names(sentence):
    """Return the objects that a warning of the last bake is about."""
    facts = report()
    for note, objects in zip(facts["warnings"], facts["objects_of_warnings"], strict=True):
        if sentence in note:
            return sorted(objects)
    return []


def baked():
    return names("baked, because their light may have changed by more than 0.2 %")


def left():
    return names("not baked, because their light has changed by at most 0.2 %")


def nothing_has_changed():
    import bpy

    bpy.context.scene.hemibake.target = "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()


def texels(obj):
    """Return the bits of an object's texels inside its charts."""
    cover = part("operators.scene.uvs.uv_faults").covered_texels
    image = pixels(obj.hemibake.image)
    uvs = part("operators.scene.uvs.lightmap_layer").layer_triangles(obj.data, "Lightmap")
    uvs = uvs * obj.hemibake.uv_scale + np.array(obj.hemibake.uv_offset)
    row, column = np.divmod(cover(uvs, len(image))[0], len(image) + 1)
    return image[row, column].tobytes()


def test_a_lamp_that_moves_has_only_its_room_baked(rooms):
    (_, _, lamp), (floor, shell, _) = rooms
    before = texels(floor), texels(shell)
    lamp.location.x += 0.05
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"] and left() == ["Floor B", "Shell B"]
    assert report()["objects"] == 2 and (texels(floor), texels(shell)) == before
    nothing_has_changed()


def test_a_lamp_that_changes_colour_alone_has_its_room_baked(rooms):
    (_, _, lamp), _ = rooms
    lamp.data.color = (1, 0.25, 0.5)
    bake("CHANGED")
    lamp.data.color = (0.25, 1, 0.5)
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"] and left() == ["Floor B", "Shell B"]


@pytest.mark.parametrize(
    "outputs",
    [{"combined", "directional", "light_groups"}, {"ambient_occlusion", "combined", "spherical_harmonics"}],
)
def test_every_output_is_compared(rooms, settings, outputs):
    import bpy

    for name in ("Day", "Night"):
        bpy.context.view_layer.lightgroups.add(name=name)
    (_, _, lamp), (_, _, other) = rooms
    lamp.lightgroup = other.lightgroup = "Day"
    settings.outputs = outputs
    bake("ALL")
    nothing_has_changed()
    lamp.data.energy *= 1.5
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"] and left() == ["Floor B", "Shell B"]

    # All light stays, but not that of each group.
    other.lightgroup = "Night"
    if "light_groups" in outputs:
        bake("CHANGED")
        assert baked() == ["Floor B", "Shell B"] and left() == ["Floor A", "Shell A"]
    else:
        nothing_has_changed()


@pytest.mark.parametrize(("factor", "changes"), [(1.0015, False), (1.0025, True), (0.9975, True)])
def test_light_is_baked_once_it_differs_by_more_than_the_tolerance(rooms, factor, changes):
    (_, _, lamp), _ = rooms
    lamp.data.energy *= factor
    if changes:
        bake("CHANGED")
        assert baked() == ["Floor A", "Shell A"]
    else:
        nothing_has_changed()


def test_small_changes_add_up(rooms):
    (floor, shell, lamp), (other, _, _) = rooms
    floor.hemibake.light_change = shell.hemibake.light_change = 0.0015
    lamp.data.energy *= 1.0015
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"]
    assert floor.hemibake.light_change == 0 and other.hemibake.light_change < 1e-4


def test_an_occluder_that_moves_has_those_baked_that_it_shades(rooms):
    corners = [(0.3, 0.3, 0.2), (0.5, 0.3, 0.2), (0.5, 0.5, 0.2), (0.3, 0.5, 0.2)]
    panel = mesh_object("Panel", corners, [(0, 1, 2, 3)], surface=material("Panel"))
    panel.hemibake.role = "NO_LIGHTMAP"
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"]
    panel.location.z = 0.1
    bake("CHANGED")
    assert baked() == ["Floor A", "Shell A"]
    nothing_has_changed()


def test_quick_bakes_leave_the_patch_list_to_the_bake_itself(rooms, settings, tmp_path):
    _, (_, _, lamp) = rooms
    settings.patch_file = str(tmp_path / "patches")
    lamp.data.energy *= 2
    bake("CHANGED")
    assert baked() == ["Floor B", "Shell B"]


def test_what_was_baked_alone_since_is_baked_again(rooms):
    import bpy

    (floor, _, lamp), _ = rooms
    lamp.data.energy *= 2
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == floor)
    bake("SELECTED")
    lamp.data.energy /= 2
    bake("CHANGED")
    assert baked() == ["Floor A"]


def test_without_the_scene_of_the_last_bake_all_that_a_lamp_may_light_is_baked(rooms):
    (floor, _, lamp), _ = rooms
    part("operators.changed_objects").baked_scenes.clear()
    lamp.location.x += 0.05
    bake("CHANGED")
    assert report()["objects"] == 4 and not baked()
    floor.location.z -= 0.01
    bake("CHANGED")
    assert report()["objects"] == 1 and names("Only changed objects were baked") == []
    assert any(note.startswith("Only changed objects were baked") for note in report()["warnings"])
