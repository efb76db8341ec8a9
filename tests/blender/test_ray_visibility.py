"""Ray visibility of objects, lights and worlds, and volumes, as Cycles' diffuse bake treats them."""

import numpy as np
import pytest

from tests.blender.things import bpy_link, material, part, read_scene, square


def shown_material(name):
    """Return the material of a mesh in the scene as it was read."""
    scene = read_scene().scene
    mesh = next(mesh for mesh in scene.meshes if mesh.name == name)
    return scene.materials[mesh.material[0]]


def passed(surface):
    """Return the straight transmittance of a material for shadow rays and for gathered light."""
    return surface.transmission.shadow.offset.mean(), surface.transmission.bounce.offset.mean()


UNHEEDED = ("camera", "glossy", "transmission", "volume_scatter")


@pytest.mark.parametrize(
    ("flag", "expected"), [("shadow", (1, 0)), ("diffuse", (0, 1)), *((flag, (0, 0)) for flag in UNHEEDED)]
)
def test_objects_of_one_material_differ_in_ray_visibility(flag, expected):
    surface = material(emission=2.0)
    square("Plain", surface=surface)
    other = square("Other", surface=surface)
    other.location.z = 1
    setattr(other, f"visible_{flag}", False)
    assert passed(shown_material("Plain")) == (0, 0) and shown_material("Plain").emission.any()
    hidden = shown_material("Other")
    assert passed(hidden) == expected
    assert hidden.emission.any() == (flag != "diffuse")
    assert read_scene().notes == () and len(read_scene().objects) == 2


def test_evaluated_materials_are_hidden_from_rays():
    surface = material("Noise")
    tree = surface.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    square("Other", surface=surface).visible_diffuse = False
    assert passed(shown_material("Other")) == (0, 1)


def test_instances_are_hidden_with_what_makes_them():
    import bpy

    parts = bpy.data.collections.new("Parts")
    part_object = square("Part", surface=material())
    bpy.context.scene.collection.objects.unlink(part_object)
    parts.objects.link(part_object)
    maker = bpy_link(bpy.data.objects.new("Maker", None))
    maker.instance_type, maker.instance_collection = "COLLECTION", parts
    maker.visible_shadow = False
    assert passed(shown_material("Part")) == (1, 0)


def test_lights_and_worlds_without_diffuse_visibility_are_dark():
    import bpy

    square(surface=material())
    lamp = bpy.data.lights.new("Lamp", "POINT")
    obj = bpy_link(bpy.data.objects.new("Lamp", lamp))
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    assert len(read_scene().scene.lights) == 1 and read_scene().scene.world.any()
    obj.visible_diffuse = world.cycles_visibility.diffuse = False
    assert read_scene().scene.lights == () and not read_scene().scene.world.any()


def test_a_world_is_read_as_bounces_see_it(monkeypatch):
    """Camera rays see a bright color, bounces another one, also where Blender has to render the world."""
    import bpy

    monkeypatch.setattr(part("operators.scene.light.refined_panorama"), "_ROWS", (32, 64))

    square(surface=material())
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    tree = part("operators.compat").new_node_tree(world)
    background = tree.nodes["Background"]
    path, mix, bright = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "MixShader", "Background")
    )
    background.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1)
    bright.inputs["Strength"].default_value = 50
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    for shader, socket in zip((background, bright), mix.inputs[1:], strict=True):
        tree.links.new(shader.outputs[0], socket)
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    assert read_scene().scene.world == pytest.approx(np.float32([0.1, 0.2, 0.3]))

    gradient = tree.nodes.new("ShaderNodeTexGradient")
    tree.links.new(gradient.outputs[0], bright.inputs["Strength"])
    worlds = len(bpy.data.worlds)
    rendered = read_scene().scene.world
    assert rendered.ndim == 3 and len(bpy.data.worlds) == worlds
    assert rendered.reshape(-1, 3) == pytest.approx(
        np.full((rendered.size // 3, 3), [0.1, 0.2, 0.3]), rel=1e-3
    )


def test_a_volume_without_a_surface_is_transparent_and_noted():
    import bpy

    surface = material("Fog")
    tree = surface.node_tree
    tree.nodes.clear()
    output, fog = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("OutputMaterial", "VolumeScatter"))
    square("Fog", surface=surface)
    assert passed(shown_material("Fog")) == (0, 0) and not shown_material("Fog").reflectance.any()
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    world = bpy.context.scene.world = bpy.data.worlds.new("Haze")
    sky = part("operators.compat").new_node_tree(world)
    haze = sky.nodes.new("ShaderNodeVolumeScatter")
    sky.links.new(haze.outputs[0], sky.nodes["World Output"].inputs["Volume"])
    assert passed(shown_material("Fog")) == (1, 1)
    assert read_scene().notes == (
        "The volumes of materials 'Fog' are not baked.", "World 'Haze': its volume is not baked."
    )  # fmt: skip


def test_materials_that_cycles_cannot_evaluate_get_a_mean_color(monkeypatch):
    surface = material("Broken", (0.2, 0.4, 0.6))
    tree = surface.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], tree.nodes["Principled BSDF"].inputs["Roughness"])
    tree.links.new(noise.outputs[0], tree.nodes["Principled BSDF"].inputs["Alpha"])
    tree.nodes["Principled BSDF"].inputs["Alpha"].default_value = 0.75
    square("Thing", surface=surface)

    def fail(*arguments):
        raise RuntimeError("Error: out of memory\n")

    monkeypatch.setattr(part("operators.scene.materials.material_table"), "bake_pass", fail)
    result = shown_material("Thing")
    assert result.reflectance == pytest.approx((0.2, 0.4, 0.6)) and passed(result) == (0.25, 0.25)
    (note,) = read_scene().notes
    assert "'Broken'" in note and "node 'Noise Texture'" in note and "out of memory" in note


@pytest.mark.parametrize(
    ("socket", "value", "expected"),
    [
        ("Alpha", 0.25, (0, 0.75)),
        # Glass stops shadow rays in Cycles anyway; the light that it refracts arrives by bounces.
        ("Transmission Weight", 1.0, (0.9, 0.9)),
    ],
)
@pytest.mark.parametrize("evaluated", [False, True])
def test_materials_without_transparent_shadows_block_lights_only(socket, value, expected, evaluated):
    surface = material("Clear", (0.9**2 / 0.96**2,) * 3)
    principled = surface.node_tree.nodes["Principled BSDF"]
    principled.inputs[socket].default_value, principled.inputs["IOR"].default_value = value, 1.5
    if evaluated:
        noise = surface.node_tree.nodes.new("ShaderNodeTexNoise")
        surface.node_tree.links.new(noise.outputs[0], principled.inputs["Roughness"])
    square("Other", surface=surface)
    assert passed(shown_material("Other")) == pytest.approx((expected[1],) * 2, abs=0.01)
    surface.use_transparent_shadow = False
    assert passed(shown_material("Other")) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("glass", "expected"), [(True, (0.9, 0.9)), (False, (0, 0))])
def test_refraction_passes_light_without_transparent_shadows(glass, expected):
    import bpy

    surface = material("Clear")
    tree = surface.node_tree
    refraction = tree.nodes.new("ShaderNodeBsdfRefraction")
    refraction.inputs["Color"].default_value = (0.9, 0.9, 0.9, 1)
    tree.links.new(refraction.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    square("Other", surface=surface)
    surface.use_transparent_shadow = False
    bpy.context.scene.hemibake.glass_transmits = glass
    assert passed(shown_material("Other")) == pytest.approx(expected)


@pytest.mark.parametrize(("emission", "textured"), [(0.0, False), (1.0, False), (1.0, True)])
def test_sampled_light_through_materials_without_transparent_shadows_is_noted(emission, textured):
    surface = material("Clear")
    alpha = surface.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
    alpha.default_value = 0.5
    if textured:
        noise = surface.node_tree.nodes.new("ShaderNodeTexNoise")
        surface.node_tree.links.new(noise.outputs[0], alpha)
    square("Pane", surface=surface)
    square("Glow", surface=material("Glow", emission=emission))
    assert not any("Transparent Shadows" in note for note in read_scene().notes)
    surface.use_transparent_shadow = False
    is_noted = any("'Clear'" in note and "Transparent Shadows" in note for note in read_scene().notes)
    assert is_noted == (emission > 0)
