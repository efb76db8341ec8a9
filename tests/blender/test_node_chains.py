"""Long chains of nodes, shared inputs and nested groups are read in linear time, without recursion."""

import pytest

from tests.blender.things import material, part, read_scene, square

#: Nodes in a row: more than Python's recursion limit admits, which is 1000 calls.
LONG = 300


def chain(count, make):
    """Return the tree of a square's material whose shader passes `count` further nodes.

    make:  function that makes a node of a tree from the output of the node before
    """
    obj = square(surface=material(colour=(0.6, 0.4, 0.2)))
    tree = obj.active_material.node_tree
    output = tree.get_output_node("CYCLES")
    last = output.inputs["Surface"].links[0].from_socket
    for _ in range(count):
        last = make(tree, last)
    tree.links.new(last, output.inputs["Surface"])
    return tree


def mix(tree, shader):
    node = tree.nodes.new("ShaderNodeMixShader")
    node.inputs[0].default_value = 0
    tree.links.new(shader, node.inputs[1])
    return node.outputs[0]


def mix_with_itself(tree, shader):
    node = tree.nodes.new("ShaderNodeMixShader")
    for socket in node.inputs[1:3]:
        tree.links.new(shader, socket)
    return node.outputs[0]


def add(tree, shader):
    node = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(shader, node.inputs[1])
    return node.outputs[0]


@pytest.mark.parametrize("make", [mix, mix_with_itself, add])
def test_chains_of_shaders(make):
    chain(LONG, make)
    (surface,) = read_scene().scene.materials
    assert surface.reflectance_map is None
    assert surface.reflectance == pytest.approx((0.6, 0.4, 0.2), abs=1e-4)


def test_chains_of_shaders_that_cannot_be_read_get_mean_colors():
    import bpy

    tree = chain(LONG, mix_with_itself)
    shader = tree.nodes["Principled BSDF"]
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
    materials = part("operators.scene.materials.mean_colors")
    pixels = part("operators.scene.materials.pixels")
    mean = materials.mean_color(bpy.data.materials["Grey"], [], pixels.PixelCache([]), True)
    assert mean.reflectance == pytest.approx((0.6, 0.4, 0.2), abs=1e-4)


@pytest.mark.parametrize("is_color", [False, True])
def test_chains_of_values(is_color):
    """Each node uses the value before twice: without memory, the time would double with each."""
    tree = square(surface=material(colour=(1, 1, 1))).active_material.node_tree
    node = tree.nodes.new("ShaderNodeRGB" if is_color else "ShaderNodeValue")
    node.outputs[0].default_value = (0.999, 0.999, 0.999, 1) if is_color else 0.5
    last = node.outputs[0]
    for _ in range(LONG):
        if is_color:
            node = tree.nodes.new("ShaderNodeMixRGB")
            node.blend_type, node.inputs[0].default_value = "MULTIPLY", 1
            node.inputs[2].default_value = (0.999, 0.999, 0.999, 1)
            tree.links.new(last, node.inputs[1])
        else:
            node = tree.nodes.new("ShaderNodeMath")
            node.operation = "MAXIMUM"
            for socket in node.inputs[:2]:
                tree.links.new(last, socket)
        last = node.outputs[0]
    tree.links.new(last, tree.nodes["Principled BSDF"].inputs["Base Color"])
    (surface,) = read_scene().scene.materials
    right = 0.999 ** (LONG + 1) if is_color else 0.5
    assert surface.reflectance == pytest.approx((right,) * 3, abs=1e-4)


def test_nested_groups():
    """A metal in groups of groups is found as a mirror."""
    import bpy

    tree = chain(0, mix)
    inner = None
    for level in range(60):
        group = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        end = group.nodes.new("NodeGroupOutput")
        if inner is None:
            node = group.nodes.new("ShaderNodeBsdfAnisotropic")
            node.inputs["Roughness"].default_value = 0.1
        else:
            node = group.nodes.new("ShaderNodeGroup")
            node.node_tree = inner
        group.links.new(node.outputs[0], end.inputs[0])
        inner = group
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = inner
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    assert part("operators.scene.materials.smooth_metals").is_mirror(tree)
    assert read_scene().scene.materials
