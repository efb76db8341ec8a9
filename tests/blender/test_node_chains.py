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


#: Depth of nested groups: 2**DEEP visits if each use counts. Blender itself needs 5 s to nest 25.
DEEP = 16


def doubly_nested(inner):
    """Return a group that contains a group which it uses twice, and so on."""
    import bpy

    below = None
    for level in range(DEEP):
        group = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        start, end = (group.nodes.new(f"NodeGroup{name}") for name in ("Input", "Output"))
        nodes = [group.nodes.new("ShaderNodeGroup") for _ in range(2)] if below else [inner(group)]
        for node in nodes if below else ():
            node.node_tree = below
        last = start.outputs[0]
        for node in nodes:
            group.links.new(last, node.inputs[0])
            last = node.outputs[0]
        group.links.new(last, end.inputs[0])
        below = group
    return below


def nested_color(inner):
    """Return a square whose color passes nested groups."""
    obj = square(surface=material(colour=(1, 1, 1)))
    tree = obj.active_material.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = doubly_nested(inner)
    node.inputs[0].default_value = (0.6, 0.4, 0.2, 1)
    tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return obj


def reroute(tree):
    return tree.nodes.new("NodeReroute")


def fresnel_mix(tree):
    node, fresnel = tree.nodes.new("ShaderNodeMixRGB"), tree.nodes.new("ShaderNodeFresnel")
    tree.links.new(fresnel.outputs[0], node.inputs[2])
    tree.links.new(tree.nodes["Group Input"].outputs[0], node.inputs[1])
    return node


def object_color(tree):
    node, info = tree.nodes.new("ShaderNodeMixRGB"), tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(info.outputs["Color"], node.inputs[2])
    return node


def test_groups_that_use_a_group_twice():
    """Cycles copies a group for each use, so nothing is evaluated here."""
    tree = nested_color(reroute).active_material.node_tree
    nodes = part("operators.scene.materials.tree_nodes")
    assert len(list(nodes.used_nodes(tree))) == 3 + 4 * (DEEP - 1) + 3
    assert len(list(nodes.all_nodes(tree))) == 3 + 4 * (DEEP - 1) + 3


def test_nested_groups_that_depend_on_the_view():
    view = part("operators.scene.materials.view_nodes")
    assert view.depends_on_view(nested_color(fresnel_mix).active_material.node_tree)
    assert not view.depends_on_view(nested_color(reroute).active_material.node_tree)


def test_nested_groups_that_depend_on_the_object():
    import bpy

    surface, groups = nested_color(object_color).active_material, len(bpy.data.node_groups)
    objects = part("operators.scene.materials.object_nodes")
    depends = objects.dependence(surface.node_tree)
    assert depends.sources == (("INFO", "Color"),)
    frozen = objects.FrozenCopy(surface, {("INFO", "Color"): (0.2, 0.4, 0.6, 1)})
    assert len(bpy.data.node_groups) == groups + DEEP
    assert not objects.dependence(frozen.copy.node_tree).sources
    frozen.remove()
    assert len(bpy.data.node_groups) == groups


def test_digests_of_nested_groups():
    """A digest contains each group once, and changes with a node in it."""
    surface = nested_color(object_color).active_material
    digest = part("operators.scene.materials.evaluation_digest").evaluation_digest
    before = digest(surface, [], [], 8, True)
    assert before is not None and before == digest(surface, [], [], 8, True)
    surface.node_tree.nodes["Group"].node_tree.nodes["Group"].inputs[0].default_value = (1, 0, 0, 1)
    assert before != digest(surface, [], [], 8, True)


def test_skies_and_previews_of_nested_groups():
    tree = nested_color(object_color).active_material.node_tree
    assert part("operators.scene.light.sky_sun").sky_nodes(tree) == []
    assert part("operators.result.preview_material")._has_diffuse(tree)


def test_group_of_view_nodes_counts_only_where_it_is_used():
    """A group's output that is not fed by the viewer gives no note."""
    import bpy

    group = bpy.data.node_groups.new("Two", "ShaderNodeTree")
    for name in ("Flat", "Rim"):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketColor")
    start, end = (group.nodes.new(f"NodeGroup{name}") for name in ("Input", "Output"))
    for number in range(2):
        group.links.new(start.outputs[number], end.inputs[number])
    obj = square(surface=material())
    tree = obj.active_material.node_tree
    node, fresnel = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeFresnel")
    node.node_tree = group
    tree.links.new(fresnel.outputs[0], node.inputs["Rim"])
    base = tree.nodes["Principled BSDF"].inputs["Base Color"]
    view = part("operators.scene.materials.view_nodes")
    tree.links.new(node.outputs["Flat"], base)
    assert not view.depends_on_view(tree)
    tree.links.new(node.outputs["Rim"], base)
    assert view.depends_on_view(tree)


def test_long_chains_of_light_nodes():
    """Each Math node multiplies the value before by 1, or by itself."""
    import bpy

    square(surface=material())
    data = bpy.data.lights.new("Lamp", "POINT")
    data.use_nodes = True
    obj = bpy.data.objects.new("Lamp", data)
    bpy.context.scene.collection.objects.link(obj)
    tree = data.node_tree
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 1.0
    last = value.outputs[0]
    for number in range(LONG):
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = "MULTIPLY"
        tree.links.new(last, node.inputs[0])
        node.inputs[1].default_value = 3.0 if number == 7 else 1.0
        if number < 7:
            tree.links.new(last, node.inputs[1])
        last = node.outputs[0]
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    emission.inputs["Color"].default_value = (1, 1, 1, 1)
    tree.links.new(last, emission.inputs["Strength"])
    reader = part("operators.scene.light.light_node_reader").LightNodeReader([])
    assert reader.read(tree, "Lamp").colour == pytest.approx((3, 3, 3))
