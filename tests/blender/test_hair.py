"""Hair: particles drawn as paths and Curves objects, which throw shadows and get no lightmap."""

import numpy as np
import pytest

from tests.blender.things import bpy_link, material, part, read_scene, snapshot, square


def hairy(count=37, name="Lawn", surface=None, **changes):
    """Return a square with hair of a length of 0.5 that tapers from 0.02 to 0.01 in diameter."""
    obj = square(name, surface=surface or material("Ground", (0.2, 0.5, 0.3)))
    obj.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", count, 0.5
    settings.root_radius, settings.tip_radius, settings.radius_scale = 2.0, 1.0, 0.01
    settings.use_close_tip, settings.render_step = False, 2
    for key, value in changes.items():
        setattr(settings, key, value)
    return obj


def curves(points, radius=None, name="Curls"):
    """Return a Curves object of strands with as many points each, (s, k, 3)."""
    import bpy

    points = np.asarray(points, np.float32)
    data = bpy.data.hair_curves.new(name)
    if len(points):  # without any, Blender 5.0 ends
        data.add_curves([points.shape[1]] * len(points))
        data.attributes["position"].data.foreach_set("vector", points.ravel())
    if radius is not None:
        layer = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
        layer.data.foreach_set("value", np.full(points.shape[0] * points.shape[1], radius, np.float32))
    return bpy_link(bpy.data.objects.new(name, data))


def area(mesh):
    first, second = mesh.positions[:, 1] - mesh.positions[:, 0], mesh.positions[:, 2] - mesh.positions[:, 0]
    return np.linalg.norm(np.cross(first, second), axis=1).sum() / 2


def hair_of(read):
    """Return the meshes of hair: those that no lightmap holds."""
    return [mesh for mesh in read.scene.meshes if mesh.atlas < 0]


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_particles_are_as_wide_as_their_settings_say(scale):
    """Both sides of a ribbon have pi / 2 of the strand's mean diameter, a little less at the root."""
    obj = hairy()
    obj.scale, obj.location = (scale,) * 3, (700, -300, 11)
    (hair,) = hair_of(read_scene())
    expected = 37 * 0.5 * 0.015 * np.pi / 2 * 2 * scale
    assert 0.92 * expected < area(hair) < 1.02 * expected
    assert hair.name == "Lawn"


def test_view_layers_without_hair_have_none():
    import bpy

    hairy()
    curves([[(0, 0, 1), (1, 0, 1)]])
    assert len(hair_of(read_scene())) == 2
    bpy.context.view_layer.use_strand = False
    assert not hair_of(read_scene())


def test_closed_tips_and_shapes_make_thinner_hair():
    areas = []
    for number, changes in enumerate(({"shape": -0.6}, {"shape": 0.6}, {"use_close_tip": True})):
        hairy(name=f"Lawn {number}", **changes).location.x = 2 * number
    areas = [area(hair) for hair in hair_of(read_scene())]
    plain = 37 * 0.5 * 0.015 * np.pi / 2 * 2
    assert areas[1] < 0.93 * plain < 1.07 * plain < areas[0]
    assert areas[2] == pytest.approx(0.01375 / 0.015 * plain, rel=0.05)


def test_hair_points_where_blender_draws_it():
    import bpy

    obj = hairy(5)
    obj.rotation_euler, obj.location = (0.4, 1.1, -0.3), (2, 3, 5)
    bpy.context.view_layer.update()
    read = read_scene()
    (hair,) = hair_of(read)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    system = evaluated.particle_systems[0]
    tips = np.array([system.co_hair(object=evaluated, particle_no=number, step=4) for number in range(5)])
    corners = hair.positions.reshape(-1, 3) + read.scene.origin
    nearest = np.linalg.norm(corners[:, None] - tips, axis=2).min(axis=0)
    assert (nearest < 0.02).all()


def test_children_of_renders_stand_for_their_parents():
    hairy(7, child_type="INTERPOLATED", child_percent=2, rendered_child_count=5, render_step=3)
    (hair,) = hair_of(read_scene())
    assert len(np.unique(hair.face)) == 7 * 5 * 8 * 2


@pytest.mark.parametrize(
    ("changes", "count"), [({"render_type": "NONE"}, 0), ({"type": "EMITTER"}, 0), ({}, 1)]
)
def test_only_hair_drawn_as_paths_counts(changes, count):
    obj = hairy(**changes)
    assert len(hair_of(read_scene())) == count
    obj.hemibake.role = "NO_LIGHTMAP"
    other = square("Baked")
    other.location.x = 3
    assert len(hair_of(read_scene())) == count + 1
    obj.hemibake.role = "IGNORED"
    assert not hair_of(read_scene())


def test_an_emitter_that_is_not_shown_shows_its_hair():
    obj = hairy()
    obj.show_instancer_for_viewport = obj.show_instancer_for_render = False
    square("Floor")
    read = read_scene()
    assert [mesh.name for mesh in read.scene.meshes if mesh.atlas >= 0] == ["Floor"]
    assert [mesh.name for mesh in hair_of(read)] == ["Lawn"]


@pytest.mark.parametrize(("radius", "expected"), [(0.03, 0.03), (None, 0.005)])
def test_curves_have_their_radius(radius, expected):
    square()
    obj = curves([[(0, 0, 0), (0, 0, 1), (0, 0.001, 2)], [(1, 0, 0), (1, 1, 0), (1, 2, 0.001)]], radius)
    obj.scale = (2, 2, 2)
    before = snapshot()
    (hair,) = hair_of(read_scene())
    assert snapshot() == before
    assert area(hair) == pytest.approx(2 * 2 * expected * np.pi * 2 * 4, rel=0.02)
    assert not read_scene().notes


def test_strands_without_a_length_or_points_are_left_out():
    square()
    curves([[(1, 1, 1), (1, 1, 1), (1, 1, 1)]], 0.1, "Point")
    curves(np.zeros((0, 3, 3)), None, "Empty")
    assert not hair_of(read_scene())


def test_hair_has_the_material_of_its_slot_or_the_override():
    import bpy

    obj = hairy(material=2)
    obj.data.materials.append(material("Grass", (0.1, 0.7, 0.2)))
    read = read_scene()
    (hair,) = hair_of(read)
    assert {read.scene.materials[index].name for index in hair.material} == {"Grass"}
    bpy.context.view_layer.material_override = material("Clay")
    read = read_scene()
    assert {surface.name for surface in read.scene.materials} == {"Clay"}
    assert len(hair_of(read)) == 1


def test_textures_of_hair_are_their_mean():
    import bpy

    surface = material("Striped")
    image = bpy.data.images.new("Stripes", 2, 1, float_buffer=True, is_data=True)
    image.pixels.foreach_set(np.float32([0.2, 0.4, 0.6, 1, 0.6, 0.2, 0.0, 1]))
    node = surface.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    surface.node_tree.links.new(node.outputs[0], surface.node_tree.nodes["Principled BSDF"].inputs[0])
    hairy(3, surface=surface)
    read = read_scene()
    (hair,) = hair_of(read)
    entry = read.scene.materials[hair.material[0]]
    assert entry.reflectance == pytest.approx([0.4, 0.3, 0.3], abs=1e-3) and entry.reflectance_map is None


def test_too_many_strands_are_thinned_out_and_named(monkeypatch):
    hairy(401)
    (hair,) = hair_of(read_scene())
    monkeypatch.setattr(part("operators.scene.scene_objects"), "_MOST_HAIR", 16 * 59)
    read = read_scene()
    (thinned,) = hair_of(read)
    assert len(thinned.positions) == 16 * 59
    assert area(thinned) == pytest.approx(area(hair), rel=0.02)
    (note,) = read.notes
    assert note.startswith("'Lawn': too much hair for a bake") and note.objects == ("Lawn",)


def test_ribbons_are_as_wide_as_strands_on_the_mean_and_face_both_ways():
    """Seen along x, a strand along z of diameter 1 and length 2 covers an area of 2, less what is cut off."""
    ribbons, strands = part("operators.scene.objects.strand_ribbons"), part("operators.scene.objects.strands")
    count = 2003
    points = np.zeros((count, 3, 3))
    points[:, :, 2] = [0, 0.7, 2]
    whole = strands.Strands(points.reshape(-1, 3), np.full(3 * count, 0.5), np.arange(0, 3 * count + 1, 3), 0)
    corners = ribbons.make_ribbons(whole)
    flat = corners.positions[:, :, 1:].astype(np.float64)
    first, second = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    signed = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    assert signed[signed > 0].sum() / count == pytest.approx(2 - 0.5 * ribbons._LIFT, rel=0.04)
    assert signed.sum() == pytest.approx(0, abs=1e-6)
    assert np.linalg.norm(corners.normals, axis=2) == pytest.approx(1, abs=1e-5)


def test_ribbons_begin_off_the_root_along_the_strand():
    """A bent strand begins beyond its first points, a short one in its middle."""
    ribbons, strands = part("operators.scene.objects.strand_ribbons"), part("operators.scene.objects.strands")
    bent = [(0, 0, 0), (0, 0, 0.3), (0, 0.2, 0.3), (0, 5, 0.3)]
    short = [(9, 0, 0), (9, 0, 0.01)]
    points = np.array([*bent, (20, 0, 0), *short], np.float64)
    whole = strands.Strands(points, np.ones(len(points)), np.array([0, 4, 5, 7]), 0)
    corners = ribbons.make_ribbons(whole).positions.reshape(-1, 3)
    first, second = corners[corners[:, 0] < 5], corners[corners[:, 0] > 5]
    assert first.mean(axis=0) == pytest.approx([0, (ribbons._LIFT - 0.3 + 5) / 2, 0.3], abs=1e-5)
    assert second.mean(axis=0) == pytest.approx([9, 0, 0.0075], abs=1e-5) and len(second) == 12
