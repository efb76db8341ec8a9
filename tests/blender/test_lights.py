"""Light objects become engine lights with Cycles' units and rules."""

import numpy as np
import pytest

from tests.blender.things import bpy_link, read_scene, square


def lamp(kind, **values):
    import bpy

    data = bpy.data.lights.new("Lamp", kind)
    for name, value in values.items():
        setattr(data, name, value)
    return bpy_link(bpy.data.objects.new("Lamp", data))


def read_light():
    square()
    (light,) = read_scene().scene.lights
    return light


def test_point():
    lamp("POINT", energy=100, color=(1, 0.5, 0.25), shadow_soft_size=0.2).location = (1, 2, 3)
    light = read_light()
    assert light.kind == "point" and light.soft and light.radius == pytest.approx(0.2)
    assert light.strength == pytest.approx(np.array([1, 0.5, 0.25]) * 100 / (4 * np.pi), rel=1e-5)
    assert light.position + read_scene().scene.origin == pytest.approx([1, 2, 3])


def test_spot():
    lamp("SPOT", energy=10, spot_size=1.0, spot_blend=0.3).rotation_euler = (np.pi / 2, 0, 0)
    light = read_light()
    assert (light.kind, light.half_angle, light.blend) == ("spot", pytest.approx(0.5), pytest.approx(0.3))
    assert -light.axes[2] == pytest.approx([0, 1, 0], abs=1e-6)


def test_sun():
    lamp("SUN", energy=3, angle=0.1)
    light = read_light()
    assert light.kind == "sun" and light.half_angle == pytest.approx(0.05)
    assert light.strength == pytest.approx([3, 3, 3])


@pytest.mark.parametrize(("shape", "area"), [("SQUARE", 4.0), ("RECTANGLE", 2.0), ("ELLIPSE", np.pi / 2)])
def test_area_with_scale(shape, area):
    lamp("AREA", energy=12, shape=shape, size=2, size_y=1, spread=1.0).scale = (2, 3, 1)
    light = read_light()
    assert light.strength == pytest.approx(np.full(3, 12 / (np.pi * area * 6)), rel=1e-5)
    assert light.half_angle == pytest.approx(0.5) and light.ellipse == (shape == "ELLIPSE")


def test_exposure_temperature_and_normalization():
    obj = lamp("AREA", energy=12, shape="SQUARE", size=2)
    if not hasattr(obj.data, "exposure"):
        pytest.skip("Lights have these since 4.5.")
    obj.data.exposure, obj.data.normalize = 1.0, False
    obj.data.use_temperature, obj.data.temperature = True, 3000
    light = read_light()
    warm = np.array(obj.data.temperature_color)[:3]
    assert light.strength == pytest.approx(24 / np.pi * warm, rel=1e-5)
    assert light.strength[0] > 2 * light.strength[2]


def test_shadowless_and_hidden_lights():
    import bpy

    lamp("POINT", use_shadow=False)
    hidden = lamp("POINT")
    hidden.hide_render = True
    bpy.context.view_layer.update()
    assert not read_light().casts_shadow


def test_instances_of_a_light_are_lights():
    import bpy

    obj = lamp("POINT", energy=5)
    inside = bpy.data.collections.new("Lamps")
    bpy.context.scene.collection.objects.unlink(obj)
    inside.objects.link(obj)
    for number in range(3):
        instance = bpy_link(bpy.data.objects.new("Instance", None))
        instance.instance_type, instance.instance_collection = "COLLECTION", inside
        instance.location.x = number
    square()
    scene = read_scene().scene
    assert sorted(light.position[0] + scene.origin[0] for light in scene.lights) == pytest.approx([0, 1, 2])


def test_lamp_of_negative_power_is_named_and_left_out():
    lamp("POINT", energy=-5)
    square()
    read = read_scene()
    assert not read.scene.lights
    assert any("Light 'Lamp'" in note and "negative" in note for note in read.notes)


def test_portals_are_named_and_not_used():
    obj = lamp("AREA")
    obj.data.cycles.is_portal = True
    square()
    read = read_scene()
    assert read.scene.lights == () and "Portals" in read.notes[0] and "'Lamp'" in read.notes[0]


@pytest.mark.parametrize("kind", ["SUN", "SPOT", "AREA"])
def test_lamps_scaled_to_0_light_nothing_and_are_named(kind):
    """As in Cycles; a sun may be flat across, and a point may be scaled to nothing."""
    lamp(kind).scale = (1, 1, 0)
    lamp("POINT").scale = (0, 0, 0)
    lamp("SUN").scale = (0, 0, 1)
    square()
    read = read_scene()
    assert [light.kind for light in read.scene.lights] == ["point", "sun"]
    assert read.notes == ("Lamps that are scaled to 0 light nothing: 'Lamp'.",)


def test_a_bake_with_lamps_scaled_to_0_ends():
    import bpy

    for kind in ("SPOT", "AREA"):
        obj = lamp(kind)
        obj.scale = (0, 0, 0)
        if hasattr(obj.data, "normalize"):
            obj.data.normalize = False
    square()
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def test_light_linking_is_named():
    import bpy

    obj = lamp("POINT")
    obj.light_linking.receiver_collection = bpy.data.collections.new("Only these")
    square()
    read = read_scene()
    assert len(read.scene.lights) == 1 and "Light linking" in read.notes[0]


def test_nodes_of_a_light_multiply_its_power():
    obj = lamp("POINT", energy=4 * np.pi)
    if obj.data.node_tree is None:
        obj.data.use_nodes = True
    emission = next(node for node in obj.data.node_tree.nodes if node.bl_idname == "ShaderNodeEmission")
    emission.inputs["Strength"].default_value = 2.5
    assert read_light().strength == pytest.approx([2.5, 2.5, 2.5])


def noded(kind="POINT", **values):
    """Return a lamp that shines 1 W/sr with nodes, its tree and its Emission."""
    obj = lamp(kind, energy=4 * np.pi, **values)
    if obj.data.node_tree is None:
        obj.data.use_nodes = True
    tree = obj.data.node_tree
    return obj, tree, next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")


@pytest.mark.parametrize("socket", ["Color", "Strength"])
@pytest.mark.parametrize("kind", ["TexIES", "Blackbody", "LightFalloff", "TexImage", "TexNoise"])
def test_nodes_of_any_kind_on_a_light_end_in_light(kind, socket):
    _, tree, emission = noded()
    node = tree.nodes.new(f"ShaderNode{kind}")
    tree.links.new(node.outputs[0], emission.inputs[socket])
    light = read_light()
    assert np.isfinite(light.strength).all() and light.strength.any()
