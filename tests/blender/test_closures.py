"""Surfaces of shader trees: the readers of simple trees agree with Cycles' evaluation of any tree."""

import numpy as np
import pytest

from tests.blender.things import material, part, square

COLOR, OTHER = (0.25, 0.5, 0.75), (0.9, 0.3, 0.1)


def shader_material(build):
    """Return a material whose surface is the output socket that build(tree) returns."""
    surface = material("Tree")
    tree = surface.node_tree
    tree.nodes.remove(tree.nodes["Principled BSDF"])
    tree.links.new(build(tree), tree.get_output_node("CYCLES").inputs["Surface"])
    return surface


def node(tree, kind, **values):
    """Return a new node with values of inputs, whose names have spaces for underscores."""
    result = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in values.items():
        socket = result.inputs[name.replace("_", " ")]
        if hasattr(value, "is_output"):
            tree.links.new(value, socket)
        else:
            is_color = hasattr(value, "__len__")
            socket.default_value = (*value, 1)[: len(socket.default_value)] if is_color else value
    return result


def closure(kind, **values):
    return lambda tree: node(tree, kind, **values).outputs[0]


def mixed(first, second, factor=0.3):
    """Return a builder of a Mix Shader; factor is a number or a function of the tree."""

    def build(tree):
        mix = node(tree, "MixShader")
        for socket, shader in zip(mix.inputs[1:], (first, second), strict=True):
            tree.links.new(shader(tree), socket)
        if callable(factor):
            tree.links.new(factor(tree), mix.inputs[0])
        else:
            mix.inputs[0].default_value = factor
        return mix.outputs[0]

    return build


def added(first, second):
    def build(tree):
        add = node(tree, "AddShader")
        for socket, shader in zip(add.inputs, (first, second), strict=True):
            tree.links.new(shader(tree), socket)
        return add.outputs[0]

    return build


def grouped(inner):
    """Return a function that builds a node group around a shader, with a reroute before the output."""

    def build(tree):
        import bpy

        group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        group.links.new(inner(group), group.nodes.new("NodeGroupOutput").inputs[0])
        outer, reroute = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("NodeReroute")
        outer.node_tree = group
        tree.links.new(outer.outputs[0], reroute.inputs[0])
        return reroute.outputs[0]

    return build


def output_of(kind, name):
    return lambda tree: node(tree, kind).outputs[name]


def constants(result):
    """Return the constants of a material without textures by name, (3,) float32 each."""
    sides = ("shadow", "bounce", "shadow_back", "bounce_back")
    transmission = {name: getattr(result.transmission, name) for name in sides}
    assert not any(side and (side.texture or side.scale.any()) for side in transmission.values())
    values = {name: getattr(result, name) for name in ("reflectance", "emission", "translucency")}
    if result.back is not None:
        values |= {"back": result.back.reflectance, "back_emission": result.back.emission}
    passed = {name: side.offset for name, side in transmission.items() if side is not None}
    falls = {f"{name}_angles": angles_of(side) for name, side in transmission.items() if side is not None}
    return values | passed | falls


def angles_of(side):
    """Return IOR, share of glass and number of faces of a transmittance."""
    fresnel = side.fresnel
    return np.array([1.0, 0.0, 1.0] if fresnel is None else [fresnel.ior, fresnel.share, fresnel.faces])


def read(surface, glass=True):
    """Return the surface that the readers get from a material."""
    tree_of = part("operators.scene.materials.object_nodes").dependence(surface.node_tree)
    cache = part("operators.scene.materials.pixels").PixelCache([])
    reader = part("operators.scene.materials.materials").read_material
    return constants(reader(surface, [], cache, None, tree_of, glass))


def bake_passes(surface, size, glass=True):
    """Return all evaluations by Cycles of a material on a square, and what it depends on."""
    import bpy

    baker = part("operators.scene.materials.shader_bake")
    passes = part("operators.scene.materials.evaluated_passes")
    depends = part("operators.scene.materials.object_nodes").dependence(surface.node_tree)
    obj, depsgraph = square(surface=surface), bpy.context.evaluated_depsgraph_get()
    shape = baker.copy_shape(obj.evaluated_get(depsgraph), "Lightmap", np.eye(4), depsgraph, [surface])
    assert baker.add_lightmap_uv_map(shape.mesh, "Lightmap", None)
    pixels, context = {}, part("operators.scene").SceneContext(bpy.context)
    try:
        for each in passes.passes_of(surface, depends, glass):
            image, covered = baker.bake_pass(each, surface, [shape], size, context, glass)
            pixels[each], pixels[passes.COVERED] = image, covered
    finally:
        baker.remove_shapes([shape])
        bpy.data.objects.remove(obj)
    return pixels, depends


def evaluated_pixels(surface, size):
    """Return the images of all quantities that Cycles evaluates."""
    pixels, _ = bake_passes(surface, size)
    return [image for image in pixels.values() if image.ndim == 3]


def evaluated(surface, glass=True):
    """Return the surface that Cycles evaluates for a material on a square."""
    pixels, depends = bake_passes(surface, 13, glass)
    passes = part("operators.scene.materials.evaluated_passes")
    part("engine.progress").finished(passes.finish_passes(pixels))
    made = part("operators.scene.materials.evaluated_materials").EvaluatedMaterial
    angles = part("operators.scene.materials.closures").glass_fresnel(surface.node_tree) if glass else None
    return constants(made("Tree", pixels, 1.0, depends.by_side, False, angles).material())


DIFFUSE, CLEAR = closure("BsdfDiffuse", Color=COLOR), closure("BsdfTransparent", Color=(1, 1, 1))
TINT, GLOW = closure("BsdfTransparent", Color=OTHER), closure("Emission", Color=OTHER, Strength=3.0)
GLASS = closure("BsdfGlass", Color=COLOR, IOR=1.45)
WINDOW = 1 - (0.45 / 2.45) ** 2
HALF_GLASS = {"Transmission Weight": 0.5, "Metallic": 0.25, "Alpha": 0.8, "Emission Strength": 2.0}
IS_CAMERA = output_of("LightPath", "Is Camera Ray")
IS_SHADOW = output_of("LightPath", "Is Shadow Ray")
BACKFACING = output_of("NewGeometry", "Backfacing")

TREES = {
    "glass": GLASS,
    "refraction": closure("BsdfRefraction", Color=COLOR),
    "tinted": TINT,
    "translucent": closure("BsdfTranslucent", Color=COLOR),
    "toon_and_subsurface": mixed(
        closure("BsdfToon", Color=COLOR), closure("SubsurfaceScattering", Color=OTHER), 0.25
    ),
    "principled": closure("BsdfPrincipled", Base_Color=COLOR, Emission_Color=OTHER, **HALF_GLASS),
    "principled_glass": closure("BsdfPrincipled", Base_Color=COLOR, IOR=1.45, Transmission_Weight=1.0),
    "metal": closure("BsdfPrincipled", Base_Color=COLOR, Metallic=0.7, Roughness=0.9, Alpha=0.8),
    "glossy": mixed(closure("BsdfAnisotropic", Color=COLOR, Roughness=0.4), DIFFUSE, 0.25),
    "rough": closure("BsdfDiffuse", Color=COLOR, Roughness=0.8),
    "curtain": mixed(DIFFUSE, closure("BsdfTranslucent", Color=OTHER), 0.5),
    "tinted_sheet": mixed(DIFFUSE, TINT, 0.5),
    "glow": added(CLEAR, GLOW),
    "bright_sum": added(DIFFUSE, closure("BsdfTransparent", Color=COLOR)),
    "holdout": mixed(closure("Holdout"), GLOW, 0.4),
    "camera_only": mixed(DIFFUSE, CLEAR, IS_CAMERA),
    "unlit": mixed(CLEAR, GLOW, IS_CAMERA),
    "misted_glass": mixed(GLASS, TINT, 0.3),
    "window_portal": mixed(GLASS, CLEAR, IS_SHADOW),
    "one_sided": mixed(GLOW, CLEAR, BACKFACING),
    "two_sided_portal": mixed(mixed(DIFFUSE, GLOW, BACKFACING), CLEAR, IS_SHADOW),
}  # fmt: skip


@pytest.mark.parametrize("name", TREES)
def test_a_reader_agrees_with_cycles(name):
    surface = shader_material(TREES[name])
    fast, general = read(surface), evaluated(surface)
    assert fast.keys() == general.keys()
    for quantity in fast:
        assert fast[quantity] == pytest.approx(general[quantity], rel=2e-3, abs=2e-4), quantity


def number(value):
    """Return a builder of a Value node."""

    def build(tree):
        result = tree.nodes.new("ShaderNodeValue")
        result.outputs[0].default_value = value
        return result.outputs[0]

    return build


def color(tree):
    result = tree.nodes.new("ShaderNodeRGB")
    result.outputs[0].default_value = (*COLOR, 1)
    return result.outputs[0]


def math(operation, first, second, clamp=False):
    def build(tree):
        result = tree.nodes.new("ShaderNodeMath")
        result.operation, result.use_clamp = operation, clamp
        result.inputs[0].default_value, result.inputs[1].default_value = first, second
        return result.outputs[0]

    return build


def complement(tree, value):
    result = math("SUBTRACT", 1.0, 0.0)(tree)
    tree.links.new(value, result.node.inputs[1])
    return result


def ramp(tree):
    result = tree.nodes.new("ShaderNodeValToRGB")
    result.color_ramp.elements[1].color = (*OTHER, 0.5)
    result.inputs["Fac"].default_value = 0.4
    return result.outputs["Color"]


def product(kind, factor):
    def build(tree):
        result = tree.nodes.new(kind)
        result.blend_type = "MULTIPLY"
        if kind == "ShaderNodeMix":
            result.data_type = "RGBA"
        socket, first, second = (socket for socket in result.inputs if socket.enabled)
        socket.default_value, second.default_value = factor, (*OTHER, 1)
        tree.links.new(color(tree), first)
        return next(output for output in result.outputs if output.enabled)

    return build


VALUES = {
    "value": number(0.3),
    "rgb": color,
    "ramp": ramp,
    "mix": product("ShaderNodeMix", 1.0),
    "mix_rgb": product("ShaderNodeMixRGB", 1.0),
    "added": math("ADD", 0.25, 0.5),
    "subtracted": math("SUBTRACT", 0.75, 0.5),
    "multiplied": math("MULTIPLY", 0.75, 0.5),
    "maximum": math("MAXIMUM", 0.75, 0.5),
    "minimum": math("MINIMUM", 0.75, 0.5),
    "clamped": math("ADD", 0.75, 0.5, clamp=True),
    "negative": math("SUBTRACT", 0.25, 0.5, clamp=True),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_reader_of_values_agrees_with_cycles(name):
    """As a color, and as a number that mixes two closures."""

    def build(tree):
        shader = node(tree, "BsdfDiffuse", Color=VALUES[name](tree)).outputs[0]
        return mixed(lambda _: shader, GLOW, VALUES[name])(tree)

    surface = shader_material(build)
    fast, general = read(surface), evaluated(surface)
    for quantity in fast:
        assert fast[quantity] == pytest.approx(general[quantity], rel=2e-3, abs=2e-4), quantity


@pytest.mark.parametrize(
    "operation", ["GREATER_THAN", "LESS_THAN", "ROUND", "not GREATER_THAN", "not LESS_THAN"]
)
@pytest.mark.parametrize("value", [0.0, 0.3, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("limit", [0.0, 0.5, 1.0])
def test_a_reader_of_thresholds_agrees_with_cycles(operation, value, limit):
    """Equal numbers do not exceed each other; Less Than reads the limit first, and 1 - x the opposite."""
    numbers = (limit, value) if operation in {"LESS_THAN", "not GREATER_THAN"} else (value, limit)
    cut = math(operation.removeprefix("not "), *numbers)

    def factor(tree):
        return complement(tree, cut(tree)) if operation.startswith("not ") else cut(tree)

    surface = shader_material(mixed(DIFFUSE, CLEAR, factor))
    fast, general = read(surface), evaluated(surface)
    for quantity in fast:
        assert fast[quantity] == pytest.approx(general[quantity], rel=2e-3, abs=2e-4), quantity


def test_a_clamped_product_is_evaluated_by_cycles():
    def build(tree):
        result = product("ShaderNodeMix", 1.0)(tree)
        result.node.clamp_result = True
        return node(tree, "Emission", Color=result, Strength=2.0).outputs[0]

    surface = shader_material(build)
    with pytest.raises(part("operators.scene.materials.sockets").ComplexError):
        read(surface)


@pytest.mark.parametrize("vector_type", ["POINT", "TEXTURE"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest"])
@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
def test_a_reader_of_textures_agrees_with_cycles(extension, interpolation, vector_type):
    """Each texel is the mean over its area; Cycles takes few samples of it."""
    import bpy

    from engine.scene.texture import sample

    pixels = np.ones((3, 5, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(3).integers(0, 256, (3, 5, 3)) / np.float32(255)
    image = bpy.data.images.new("Picture", 5, 3)
    image.pixels.foreach_set(pixels.ravel())
    surface = shader_material(closure("Emission", Strength=1.0))
    tree = surface.node_tree
    shown, mapping, uvs = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexImage", "Mapping", "UVMap"))
    shown.image, shown.extension, shown.interpolation = image, extension, interpolation
    uvs.uv_map, mapping.vector_type = "Lightmap", vector_type
    mapping.inputs["Location"].default_value = (0.2, -0.3, 0)
    mapping.inputs["Rotation"].default_value = (0, 0, 0.5)
    mapping.inputs["Scale"].default_value = (1.7, -0.8, 1)
    emission = next(each for each in tree.nodes if each.bl_idname == "ShaderNodeEmission")
    for output, socket in (
        (uvs.outputs[0], mapping.inputs[0]),
        (mapping.outputs[0], shown.inputs[0]),
        (shown.outputs["Color"], emission.inputs["Color"]),
    ):
        tree.links.new(output, socket)
    texture = read_texture(surface)
    (general,) = evaluated_pixels(surface, 40)
    steps = (np.arange(40 * 8) + 0.5) / 320
    uv = np.stack(np.meshgrid(steps, steps), axis=-1)
    mapped = uv @ texture.transform[:, :2].T + texture.transform[:, 2]
    linear = sample(texture.pixels, mapped.reshape(-1, 2), texture)
    means = linear.reshape(40, 8, 40, 8, 3).mean(axis=(1, 3))
    difference = np.abs(means - general)[5:-5, 5:-5]
    assert np.median(difference) < 0.01 and np.quantile(difference, 0.8) < 0.05


def read_texture(surface):
    """Return the texture of the emission that the reader gets from a material."""
    pixels = part("operators.scene.materials.pixels")
    cache, reader = pixels.PixelCache([]), part("operators.scene.materials.materials").read_material
    while True:
        try:
            return reader(surface, [], cache).emission_map
        except pixels.PixelsNeededError as unread:
            for _ in unread.reading:
                pass


def test_glass_is_opaque_without_its_setting():
    surface = shader_material(mixed(GLASS, DIFFUSE, 0.5))
    for values in (read(surface, glass=False), evaluated(surface, glass=False)):
        assert values["bounce"] == pytest.approx(0)
        assert values["reflectance"] == pytest.approx(np.array(COLOR) / 2, abs=1e-4)
    assert read(surface)["shadow"] == pytest.approx(np.array(COLOR) * WINDOW / 2, abs=1e-4)


def test_only_the_light_through_glass_falls_with_the_angle():
    """Refraction has no Fresnel loss in Cycles; thin glass of low IOR reflects too little for a patch."""

    def share(name):
        return read(shader_material(TREES[name]))["bounce_angles"]

    assert share("glass") == pytest.approx([1.45, 1, 1])
    assert share("refraction") == pytest.approx([1, 0, 1])
    glass, tint = 0.7 * WINDOW * np.mean(COLOR), 0.3 * np.mean(OTHER)
    assert share("misted_glass") == pytest.approx([1.45, glass / (glass + tint), 1])
    clear = read(shader_material(closure("BsdfGlass", Color=(1, 1, 1), IOR=1.05)))
    assert (clear["reflectance"] == 0).all() and clear["bounce"].min() > 0.999


def test_quantities_of_a_tinted_sheet_belong_to_its_opaque_part():
    values = read(shader_material(TREES["tinted_sheet"]))
    assert values["bounce"] == pytest.approx(np.array(OTHER) / 2)
    assert values["reflectance"] == pytest.approx(np.array(COLOR) / 2 / (1 - 0.45))
    assert read(shader_material(TREES["glow"]))["emission"] == pytest.approx(np.array(OTHER) * 3 * 64)


def test_constants_stand_for_kinds_of_rays():
    unlit = read(shader_material(TREES["unlit"]))
    assert unlit["bounce"].tolist() == unlit["shadow"].tolist() == [1, 1, 1] and not unlit["emission"].any()
    seen = read(shader_material(TREES["camera_only"]))
    assert not seen["bounce"].any() and seen["reflectance"] == pytest.approx(COLOR)
    portal = read(shader_material(TREES["window_portal"]))
    assert portal["shadow"].tolist() == [1, 1, 1]
    assert portal["bounce"] == pytest.approx(np.array(COLOR) * WINDOW)
    panel = read(shader_material(TREES["one_sided"]))
    assert panel["bounce_back"].tolist() == [1, 1, 1] and not panel["bounce"].any()
    assert panel["emission"] == pytest.approx(np.array(OTHER) * 3) and not panel["back_emission"].any()


@pytest.mark.parametrize("kind", ["BsdfDiffuse", "BsdfPrincipled"])
@pytest.mark.parametrize(
    ("roughness", "single", "both", "notes"),
    [(0, 0.5, 0.5, 0), (0.2, 0.47963, 0.48463, 0), (0.8, 0.43002, 0.44620, 1)],
)
def test_rough_diffuse_closures_reflect_less(kind, roughness, single, both, notes):
    """Known means over all directions without and with the energy that Cycles restores since Blender 4.3."""
    import bpy

    name = "Roughness" if kind == "BsdfDiffuse" else "Diffuse Roughness"
    surface = shader_material(
        closure(kind, **{"Color" if kind == "BsdfDiffuse" else "Base Color": (0.5,) * 3})
    )
    inputs = next(each for each in surface.node_tree.nodes if each.name != "Material Output").inputs
    if name not in inputs:
        pytest.skip("Blender 4.3 introduced Diffuse Roughness")
    inputs[name].default_value = roughness
    expected = both if bpy.app.version >= (4, 3) else single
    assert read(surface)["reflectance"] == pytest.approx([expected] * 3, rel=1e-4)
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    collected.add(surface)
    assert sum("diffuse roughness" in note for note in collected.sentences()) == notes


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_a_muted_color_node_is_read_as_a_number(level):
    """A muted Gamma node passes its own color to Roughness, Coat Weight and Transmission Weight."""
    diffuse = shader_material(closure("BsdfDiffuse", Color=COLOR))
    coated = shader_material(closure("BsdfPrincipled", Coat_Tint=COLOR))
    for surface, kind, names in (
        (diffuse, "BsdfDiffuse", ["Roughness"]),
        (coated, "BsdfPrincipled", ["Coat Weight", "Transmission Weight"]),
    ):
        tree = surface.node_tree
        gamma = node(tree, "Gamma", Color=(level,) * 3)
        gamma.mute = True
        shader = next(each for each in tree.nodes if each.bl_idname == f"ShaderNode{kind}")
        for name in names:
            tree.links.new(gamma.outputs[0], shader.inputs[name])
    dull = np.array(read(diffuse)["reflectance"]) < np.array(COLOR) * 0.999
    assert (dull == (level > 0)).all()
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    collected.add(diffuse), collected.add(coated)
    sentences = collected.sentences()
    assert any("diffuse roughness" in text for text in sentences) == (level > 0)
    assert any("coat" in text for text in sentences) == (level > 0)


def test_a_muted_number_node_is_read_as_a_color():
    """A muted Math node passes its own number, a grey, to a color."""
    surface = shader_material(closure("BsdfRefraction"))
    tree = surface.node_tree
    scaled = node(tree, "Math")
    scaled.mute = True
    shader = next(each for each in tree.nodes if each.bl_idname == "ShaderNodeBsdfRefraction")
    tree.links.new(scaled.outputs[0], shader.inputs["Color"])
    assert not part("operators.scene.materials.tint_nodes").may_tint(surface)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("BsdfToon", "Toon nodes, which bakes treat as Diffuse. Replace the nodes."),
        (
            "BsdfRayPortal",
            "Ray Portal nodes, through which light of a bake does not pass. "
            "Replace them with Transparent BSDF nodes.",
        ),
    ],
)
def test_closures_that_bakes_treat_differently_are_named(kind, words):
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    for build in (closure(kind, Color=COLOR), closure("BsdfDiffuse", Color=COLOR)):
        collected.add(shader_material(build))
    assert collected.sentences() == [f"Materials 'Tree' have {words}"]


def test_groups_are_evaluated_by_cycles():
    surface = shader_material(grouped(grouped(TREES["two_sided_portal"])))
    assert surface.node_tree.nodes.get("Group") is not None
    with pytest.raises(part("operators.scene.materials.sockets").ComplexError) as error:
        read(surface)
    assert error.value.node == "Group"
    expected, measured = read(shader_material(TREES["two_sided_portal"])), evaluated(surface)
    assert expected.keys() == measured.keys()
    for quantity in expected:
        assert measured[quantity] == pytest.approx(expected[quantity], rel=2e-3, abs=2e-4), quantity


def test_a_thin_wall_transmits_diffuse_light():
    surface = shader_material(
        closure("BsdfPrincipled", Base_Color=COLOR, Subsurface_Weight=0.75, Transmission_Weight=0.5, IOR=1.45)
    )
    inputs = surface.node_tree.nodes["Principled BSDF"].inputs
    if "Thin Wall" not in inputs:
        pytest.skip("Blender 5.2 introduced Thin Wall")
    inputs["Thin Wall"].default_value, inputs["Subsurface Anisotropy"].default_value = True, 0.2
    fast, general = read(surface), evaluated(surface)
    assert fast["bounce"] == pytest.approx(np.array(COLOR) / 2 * WINDOW**2)
    opaque = 1 - fast["bounce"].max()
    diffuse, mirrored = np.array(COLOR) / 2 / opaque, (1 - WINDOW) / 2 / opaque
    assert fast["translucency"] == pytest.approx(diffuse * 0.75 * 0.6)
    assert fast["reflectance"] == pytest.approx(diffuse * (1 - 0.75 * 0.6) + mirrored)
    for quantity in fast:
        assert fast[quantity] == pytest.approx(general[quantity], rel=2e-3, abs=2e-4), quantity


def test_nodes_that_are_not_connected_cost_no_evaluation():
    surface = shader_material(grouped(TINT))
    tree = surface.node_tree
    muted = node(tree, "BsdfDiffuse")
    muted.mute = True
    node(tree, "Emission")
    depends = part("operators.scene.materials.object_nodes").dependence(tree)
    passes = part("operators.scene.materials.evaluated_passes").passes_of(surface, depends, True)
    assert [each.quantity for each in passes] == ["through"]
    sheen = shader_material(grouped(closure("BsdfSheen")))
    assert not part("operators.scene.materials.evaluated_passes").passes_of(sheen, depends, True)


def metal(conductor):
    """Return a builder of a Metallic BSDF; a physical conductor without multiple scattering, or F82."""

    def build(tree):
        result = node(tree, "BsdfMetallic", Base_Color=COLOR, Roughness=0.7)
        if conductor:
            result.fresnel_type, result.distribution = "PHYSICAL_CONDUCTOR", "GGX"
            result.inputs["IOR"].default_value = (0.2, 0.9, 1.4)
            result.inputs["Extinction"].default_value = (3.1, 2.4, 1.8)
        return result.outputs[0]

    return build


@pytest.mark.parametrize("conductor", [False, True])
def test_metals_agree_with_cycles(conductor):
    import bpy

    if not hasattr(bpy.types, "ShaderNodeBsdfMetallic"):
        pytest.skip("Blender 4.3 introduced the Metallic BSDF")
    surface = shader_material(metal(conductor))
    fast, general = read(surface), evaluated(surface)
    assert fast["reflectance"] == pytest.approx(general["reflectance"], rel=2e-3)
    assert 0.1 < fast["reflectance"].min() < fast["reflectance"].max() < 0.9


def test_rough_metal_loses_energy_between_its_microfacets():
    """Albedos that give Cycles' light in a closed metal room of roughness 1, per cent: 76, 47, 28."""
    albedo = part("operators.scene.materials.gloss").metal_albedo(np.array([0.9, 0.7, 0.5]), 1.0, True)
    assert albedo == pytest.approx([0.76, 0.47, 0.28], rel=0.12)
    smooth = part("operators.scene.materials.gloss").metal_albedo(np.array([0.9, 0.7, 0.5]), 0.0, False)
    assert smooth == pytest.approx([0.905, 0.714, 0.524], abs=1e-3)


def glossy(roughness=0.2, color=COLOR):
    return closure("BsdfAnisotropic", Color=color, Roughness=roughness)


MIRRORS = {
    "mirror": (glossy(), True),
    "in_a_group": (grouped(glossy()), True),
    "rough": (glossy(0.8), False),
    "black": (glossy(color=(0.1, 0.1, 0.1)), False),
    "coat": (mixed(DIFFUSE, glossy(), 0.2), False),
    "half": (mixed(DIFFUSE, glossy(), output_of("TexNoise", "Color")), True),
    "pane": (mixed(CLEAR, glossy(), output_of("Fresnel", "Fac")), False),
    "metal": (closure("BsdfPrincipled", Metallic=1.0, Roughness=0.3), True),
    "plastic": (closure("BsdfPrincipled", Roughness=0.1), False),
    "sum": (added(GLOW, glossy()), True),
}


@pytest.mark.parametrize("name", MIRRORS)
def test_mirrors_are_named(name):
    build, is_named = MIRRORS[name]
    notes = part("operators.scene.materials.surface_notes").SurfaceNotes(True)
    notes.add(shader_material(build))
    named = [note for note in notes.sentences() if "instead of mirroring it: 'Tree'" in note]
    assert len(named) == is_named


@pytest.mark.parametrize("kind", ["ShaderNodeValToRGB", "ShaderNodeHueSaturation", "ShaderNodeRGBToBW"])
def test_muted_nodes_pass_values_of_other_types(kind):
    """A muted node feeds its own unlinked input, a number for a color or a color for a number."""
    surface = shader_material(closure("BsdfPrincipled", Metallic=1.0))
    tree = surface.node_tree
    principled = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    for name in ("Base Color", "Roughness", "Metallic"):
        muted = tree.nodes.new(kind)
        muted.mute = True
        tree.links.new(muted.outputs[0], principled.inputs[name])
    assert isinstance(part("operators.scene.materials.smooth_metals").is_mirror(tree), bool)


def test_shared_shaders_are_examined_once():
    """Each of 60 nested Mix Shaders uses the one below twice."""
    surface = shader_material(glossy())
    tree = surface.node_tree
    output = tree.get_output_node("CYCLES").inputs["Surface"]
    for _ in range(60):
        mix, below = tree.nodes.new("ShaderNodeMixShader"), output.links[0].from_socket
        for socket in mix.inputs[1:]:
            tree.links.new(below, socket)
        tree.links.new(mix.outputs[0], output)
    assert part("operators.scene.materials.smooth_metals").is_mirror(tree)


def test_unknown_closures_are_named():
    surface = shader_material(mixed(closure("EeveeSpecular"), DIFFUSE))
    notes = part("operators.scene.materials.surface_notes").SurfaceNotes(True)
    notes.add(surface)
    (note,) = notes.sentences()
    assert "'Tree'" in note and "'Specular BSDF'" in note


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("BsdfTransparent", {"Color": (0.9, 0.5, 0.5, 1)}, True),
        ("BsdfTransparent", {"Color": (0.5, 0.5, 0.5, 1)}, False),
        ("BsdfDiffuse", {"Color": (0.9, 0.5, 0.5, 1)}, False),
        ("BsdfPrincipled", {"Base Color": (0.9, 0.5, 0.5, 1)}, False),
        ("BsdfPrincipled", {"Base Color": (0.9, 0.5, 0.5, 1), "Transmission Weight": 0.3}, True),
    ],
)
def test_colored_closures_that_transmit_may_tint(kind, values, expected):
    """Also in a group; what no link connects to the output does not count."""
    import bpy

    tint_nodes = part("operators.scene.materials.tint_nodes")
    surface = bpy.data.materials.new("Pane")
    tree = part("operators.compat").new_node_tree(surface)
    tree.nodes.clear()
    group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    closure, end = group.nodes.new(f"ShaderNode{kind}"), group.nodes.new("NodeGroupOutput")
    for name, value in values.items():
        closure.inputs[name].default_value = value
    group.links.new(closure.outputs[0], end.inputs[0])
    node, output = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeOutputMaterial")
    node.node_tree = group
    assert not tint_nodes.may_tint(surface) and not tint_nodes.may_tint(None)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    assert tint_nodes.may_tint(surface) == expected


@pytest.mark.parametrize(
    ("kind", "noted"),
    [("BsdfSheen", "sheen"), ("BsdfHairPrincipled", "hair nodes"), ("BsdfDiffuse", None)],
)
def test_closures_whose_reflection_is_not_baked_are_named(kind, noted):
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    collected.add(shader_material(closure(kind)))
    assert [noted in note for note in collected.sentences()] == [True] * (noted is not None)


@pytest.mark.parametrize("emission", [0.0, 1.0])
@pytest.mark.parametrize(("output", "count"), [("Transparent Depth", 1), ("Is Shadow Ray", 0)])
def test_alpha_by_ray_depth_is_named(output, count, emission):
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    surface = material("Screen", emission=emission)
    path = surface.node_tree.nodes.new("ShaderNodeLightPath")
    alpha = surface.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
    surface.node_tree.links.new(path.outputs[output], alpha)
    collected.add(surface)
    assert len(collected.sentences()) == count


@pytest.mark.parametrize(("smooth", "count"), [(0.0, 0), (1.0, 1)])
def test_smooth_falloff_of_surfaces_is_named(smooth, count):
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    surface = material("Lamp")
    falloff = surface.node_tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Smooth"].default_value = smooth
    strength = surface.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"]
    surface.node_tree.links.new(falloff.outputs["Quadratic"], strength)
    collected.add(surface)
    assert len(collected.sentences()) == count


def test_nodes_that_bakes_evaluate_differently_are_named():
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    names = ("Lacquer", "Clear Coat", "Fading", "Faint", "Dirty")
    coated, plain, far, faint, dirty = map(material, names)
    dirty.node_tree.nodes["Principled BSDF"].inputs["Sheen Weight"].default_value = 0.2
    for surface, tint in ((coated, 0.4), (plain, 1.0)):
        node = surface.node_tree.nodes["Principled BSDF"]
        node.inputs["Coat Weight"].default_value = 0.7
        node.inputs["Coat Tint"].default_value = (1, tint, 1, 1)
    tree = far.node_tree
    path = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(path.outputs["Ray Length"], tree.nodes["Principled BSDF"].inputs["Emission Strength"])
    strength = faint.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"]
    faint.node_tree.links.new(
        faint.node_tree.nodes.new("ShaderNodeLightFalloff").outputs["Constant"], strength
    )
    occlusion = dirty.node_tree.nodes.new("ShaderNodeAmbientOcclusion")
    dirty.node_tree.links.new(
        occlusion.outputs["Color"], dirty.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    for surface in (coated, plain, far, faint, dirty):
        collected.add(surface)
    assert collected.sentences() == [
        "The tint of the coat of materials 'Lacquer' is not baked.",
        "Materials 'Fading', 'Faint' depend on Ray Length. A bake uses the length 1. Replace that node.",
        "Materials 'Dirty' have sheen, whose reflected light is not baked. Set it to 0 for the same light in "
        "renders.",
        "Materials 'Dirty': bakes evaluate their Ambient Occlusion nodes without other objects. Bake the "
        "node into an image.",
    ]


@pytest.mark.parametrize(
    ("kind", "output", "target", "expected"),
    [
        ("LayerWeight", "Facing", "diffuse", True),
        ("Fresnel", "Factor", "gloss", False),
        ("CameraData", "View Distance", "diffuse", True),
        ("NewGeometry", "Incoming", "color", True),
        ("NewGeometry", "Normal", "color", False),
        ("TexCoord", "Reflection", "color", True),
        ("TexCoord", "UV", "color", False),
    ],
)
def test_materials_that_depend_on_the_view_are_named(kind, output, target, expected):
    """A Fresnel factor of a mix with gloss is not: a bake has the mean of gloss only."""
    surface = material("View")
    tree = surface.node_tree
    viewed, mix = node(tree, kind), node(tree, "MixShader")
    color, other = (
        node(tree, "BsdfDiffuse"),
        node(tree, "BsdfAnisotropic" if target == "gloss" else "Emission"),
    )
    source = next(each for each in viewed.outputs if each.name in (output, "Fac"))
    tree.links.new(source, color.inputs["Color"] if target == "color" else mix.inputs[0])
    for shader, socket in zip((color, other), mix.inputs[1:3], strict=True):
        tree.links.new(shader.outputs[0], socket)
    collected = part("operators.scene.materials.surface_notes").SurfaceNotes(glass=True)
    collected.add(surface)
    assert not any("view" in note for note in collected.sentences())
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    collected.add(surface)
    notes = [note for note in collected.sentences() if "depend on the view" in note]
    assert len(notes) == expected and all("'View'" in note for note in notes)


@pytest.mark.parametrize(
    ("target", "metallic", "expected"),
    [
        ("Roughness", 0.0, False),
        ("Roughness", 0.5, True),
        ("Normal", 0.5, False),
        ("Coat Weight", 0.5, False),
        ("Emission Color", 0.0, False),
        ("Emission Strength", 0.0, True),
        ("Base Color", 0.0, True),
        ("Displacement", 0.0, False),
        ("camera branch", 0.0, False),
    ],
)
@pytest.mark.parametrize("grouped", [False, True])
def test_views_that_do_not_reach_baked_light_are_not_named(target, metallic, expected, grouped):
    """The value of the viewer passes a node, a reroute and, if grouped, a group."""
    surface = material("View")
    tree = surface.node_tree
    output = tree.get_output_node("CYCLES")
    principled = tree.nodes["Principled BSDF"]
    principled.inputs["Metallic"].default_value = metallic
    principled.inputs["Emission Strength"].default_value = 0.0
    viewed, scaled, bend = node(tree, "CameraData"), node(tree, "Math"), tree.nodes.new("NodeReroute")
    tree.links.new(viewed.outputs["View Distance"], bend.inputs[0])
    source = bend.outputs[0]
    if grouped:
        source = through_group(tree, source)
    tree.links.new(source, scaled.inputs[0])
    if target == "camera branch":
        path, mix, light = node(tree, "LightPath"), node(tree, "MixShader"), node(tree, "Emission")
        tree.links.new(scaled.outputs[0], light.inputs["Strength"])
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        tree.links.new(principled.outputs[0], mix.inputs[1])
        tree.links.new(light.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs["Surface"])
    else:
        place = output if target == "Displacement" else principled
        tree.links.new(scaled.outputs[0], place.inputs[target])
    assert part("operators.scene.materials.view_nodes").depends_on_view(tree) == expected


def through_group(tree, source):
    """Return the second output of a group that passes its second input; the first ones are a constant."""
    import bpy

    group = bpy.data.node_groups.new("Pass", "ShaderNodeTree")
    for name in ("First", "Second"):
        for direction in ("INPUT", "OUTPUT"):
            group.interface.new_socket(name, in_out=direction, socket_type="NodeSocketFloat")
    entry, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    for index in range(2):
        group.links.new(entry.outputs[index], end.inputs[index])
    passing = node(tree, "Group")
    passing.node_tree = group
    tree.links.new(source, passing.inputs[1])
    constant = node(tree, "Value")
    tree.links.new(constant.outputs[0], passing.inputs[0])
    return passing.outputs[1]


def test_other_inputs_of_a_group_are_not_mixed_up():
    """A view value that enters a group and leaves it by an unused output does not count."""
    surface = material("View")
    tree = surface.node_tree
    viewed = node(tree, "LayerWeight")
    passing = through_group(tree, viewed.outputs["Facing"]).node
    base = tree.nodes["Principled BSDF"].inputs["Base Color"]
    tree.links.new(passing.outputs[0], base)
    depends_on_view = part("operators.scene.materials.view_nodes").depends_on_view
    assert not depends_on_view(tree)
    tree.links.new(passing.outputs[1], base)
    assert depends_on_view(tree)


def test_long_chains_of_reroutes_reach_the_viewer():
    surface = material("View")
    tree = surface.node_tree
    source = node(tree, "LayerWeight").outputs["Facing"]
    for _ in range(400):
        bend = tree.nodes.new("NodeReroute")
        tree.links.new(source, bend.inputs[0])
        source = bend.outputs[0]
    tree.links.new(source, tree.nodes["Principled BSDF"].inputs["Base Color"])
    assert part("operators.scene.materials.view_nodes").depends_on_view(tree)


@pytest.mark.parametrize("quantity", ["reflect", "transmit"])
def test_clear_texels_beside_opaque_ones_have_their_reflectance(quantity):
    """The mean over a texel at the rim of a leaf must not count clear parts; half clear texels count half."""
    passes = part("operators.scene.materials.evaluated_passes")
    values, through = np.zeros((5, 7, 3), np.float32), np.ones((5, 7, 3), np.float32)
    values[2, 1], through[2, 1] = 0.6, 0.0
    values[2, 3], through[2, 3] = 0.3, 0.5
    pixels = {
        passes.COVERED: np.ones((5, 7), bool),
        passes.Pass(quantity): values,
        passes.Pass("through"): through,
    }
    evaluated = part("operators.scene.materials.evaluated_materials").EvaluatedMaterial
    made = evaluated("Leaf", pixels, 1.0, False, True).material()
    texture = made.reflectance_map if quantity == "reflect" else made.translucency_map
    row = np.float32([0.6, 0.6, 0.5, 0.3, 0.3, 0, 0])
    expected = np.zeros((5, 7), np.float32)
    expected[1:4] = row
    assert texture.pixels[..., 1] == pytest.approx(expected)
    assert (made.transmission.bounce.texture.pixels[..., 0] == through[..., 0]).all()


#: Closures and True if they emit light.
SHINING = {
    "principled": (closure("BsdfPrincipled", Emission_Color=OTHER, Emission_Strength=1.0), True),
    "black principled": (closure("BsdfPrincipled", Emission_Color=(0, 0, 0), Emission_Strength=1.0), False),
    "principled without strength": (closure("BsdfPrincipled", Emission_Color=OTHER), False),
    "black emission": (closure("Emission", Color=(0, 0, 0)), False),
    "glow": (GLOW, True),
    "no strength": (closure("Emission", Color=OTHER, Strength=0.0), False),
}


@pytest.mark.parametrize("name", SHINING)
def test_black_emission_is_not_evaluated(name):
    passes = part("operators.scene.materials.evaluated_passes")
    build, shines = SHINING[name]
    surface = shader_material(build)
    depends = part("operators.scene.materials.object_nodes").dependence(surface.node_tree)
    found = {each.quantity for each in passes.passes_of(surface, depends, True)}
    assert ("emit" in found) is shines


def test_an_emission_by_nodes_counts():
    def build(tree):
        return node(tree, "Emission", Color=tree.nodes.new("ShaderNodeRGB").outputs[0]).outputs[0]

    may_emit = part("operators.scene.materials.closures").may_emit
    tree = shader_material(build).node_tree
    assert may_emit(next(each for each in tree.nodes if each.bl_idname == "ShaderNodeEmission"))


@pytest.mark.parametrize("source", ["GENERATED", "FILE"])
def test_changed_pixels_of_a_radiance_image_are_searched_for_nan(tmp_path, source):
    import bpy

    image = bpy.data.images.new("Spoilt", 4, 4, float_buffer=True)
    image.file_format = "HDR"
    if source == "FILE":
        image.filepath_raw = str(tmp_path / "spoilt.hdr")
        image.save()
        image = bpy.data.images.load(image.filepath_raw)
    is_finite = part("operators.scene.materials.unphysical")._is_finite
    assert image.source == source and is_finite(image)
    image.pixels[5] = np.nan
    assert not is_finite(image)


def test_each_image_is_searched_for_nan_once(monkeypatch):
    import bpy

    unphysical = part("operators.scene.materials.unphysical")
    image = bpy.data.images.new("Spoilt", 4, 4, float_buffer=True)
    image.pixels[5] = np.nan

    def build(tree):
        texture = node(tree, "TexImage")
        texture.image = image
        return node(tree, "BsdfDiffuse", Color=texture.outputs[0]).outputs[0]

    first, second, checked = shader_material(build), shader_material(build), set()
    assert "'Spoilt' has NaN" in unphysical.invalid_images(first, checked)[0]
    monkeypatch.setattr(unphysical, "_is_finite", None)
    assert unphysical.invalid_images(second, checked) == []
