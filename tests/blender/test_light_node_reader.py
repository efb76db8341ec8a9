"""Light nodes give the light of Cycles' bake for any profile, rotation and scale."""

import time

import numpy as np
import pytest

from tests.blender.things import bpy_link, mesh_object, part, read_scene

#: Squares around the lamp, each with a cell of the lightmap, and texels of the lightmap.
_SQUARES, _TEXELS = 36, 48


@pytest.fixture
def around():
    """Return an object of small squares that face the origin, which is 0.7 to 2 m away."""
    rng = np.random.default_rng(5)
    z, azimuth = np.linspace(-0.999, 0.97, _SQUARES), 2.4 * np.arange(_SQUARES)
    radius = np.sqrt(1 - z * z)
    directions = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)
    x = np.cross(directions, (0.3, 0.5, 0.7))
    x /= np.linalg.norm(x, axis=1)[:, None]
    y = np.cross(directions, x)
    outline = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)]) * 0.03
    spread = outline[:, :1] * x[:, None] + outline[:, 1:] * y[:, None]
    corners = (directions[:, None] + spread) * rng.uniform(0.7, 2, (_SQUARES, 1, 1))
    width = int(np.sqrt(_SQUARES))
    cells = np.stack([np.arange(_SQUARES) % width, np.arange(_SQUARES) // width], axis=1)
    uvs = (cells[:, None] + 0.5 + outline / 0.03 * 0.3) / width
    faces = np.arange(4 * _SQUARES).reshape(-1, 4).tolist()
    obj = mesh_object("Around", corners.reshape(-1, 3).tolist(), faces, uvs.reshape(-1, 2))
    obj.data.materials.append(white())
    return obj


def white():
    import bpy

    material = bpy.data.materials.new("White")
    tree = part("operators.compat").new_node_tree(material)
    tree.nodes.clear()
    output, diffuse = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("OutputMaterial", "BsdfDiffuse"))
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    return material


def noded(kind="POINT", **values):
    """Return a lamp with nodes, its tree and its Emission."""
    import bpy

    data = bpy.data.lights.new("Lamp", kind)
    data.energy = 40
    if data.node_tree is None:
        data.use_nodes = True
    for name, value in values.items():
        setattr(data, name, value)
    obj = bpy_link(bpy.data.objects.new("Lamp", data))
    tree = data.node_tree
    return obj, tree, next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")


def hemibakes() -> np.ndarray:
    """Return Hemibake's direct light of each square, (squares, 3)."""
    import bpy

    engine = part("engine")
    bpy.context.scene.hemibake.resolution = _TEXELS
    settings = engine.Settings(resolution=_TEXELS, outputs=("direct",), light_samples=256)
    lightmap = engine.finished(part("engine.session").bake(read_scene().scene, settings))
    return _means(lightmap.image[0], lightmap.has_patch[0])


def cycles(obj, samples=128) -> np.ndarray:
    """Return Cycles' direct light of each square, (squares, 3)."""
    import bpy

    image = bpy.data.images.new("Reference", _TEXELS, _TEXELS, float_buffer=True, is_data=True)
    tree = obj.data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, tree.nodes.active = image, node
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    bpy.context.view_layer.update()
    with bpy.context.temp_override(active_object=obj, object=obj, selected_objects=[obj]):
        bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT"}, margin=0, uv_layer="Lightmap")
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(_TEXELS, _TEXELS, 4)
    return _means(pixels[..., :3], pixels[..., 3] > 0)


def _means(image, has_patch) -> np.ndarray:
    """Return the mean of each cell's inner texels."""
    width = int(np.sqrt(_SQUARES))
    assert has_patch.reshape(width, _TEXELS // width, width, -1).any(axis=(1, 3)).all()
    cells = image.reshape(width, _TEXELS // width, width, -1, 3)[:, 2:-2, :, 2:-2]
    return cells.mean(axis=(1, 3), dtype=np.float64).reshape(-1, 3)


def ies(horizontal, vertical, candelas) -> str:
    rows = [vertical, horizontal, *np.asarray(candelas, float)]
    head = f"IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 {len(vertical)} {len(horizontal)} 1 1 0 0 0\n1 1 10\n"
    return head + "\n".join(" ".join(str(value) for value in row) for row in rows)


def candelas(horizontal, vertical, seed=0):
    """Return a profile that is bumpy and never flat."""
    h, v = np.radians(horizontal)[:, None], np.radians(vertical)
    waves = 2 + np.cos(v) + 0.7 * np.sin(v) * np.cos(h - seed) + 0.4 * np.sin(3 * v) * np.cos(2 * h)
    return 30 * np.clip(waves, 0, None)


UPTO = {name: np.linspace(0, end, count) for name, end, count in [("180", 180, 19), ("90", 90, 7)]}
PROFILES = {
    "rotational": ([0], UPTO["180"]),
    "quarter": (np.linspace(0, 90, 4), UPTO["180"]),
    "half": (np.linspace(0, 180, 9), UPTO["180"]),
    "full": (np.linspace(0, 360, 17), UPTO["180"]),
    "uneven": ([0, 10, 45, 180, 200, 310, 360], [0, 5, 20, 60, 61, 120, 180]),
    "downwards": (np.linspace(0, 360, 9), UPTO["90"]),
}


def profile(name) -> str:
    if name == "peaked":
        vertical = [0, 2, 4, 6, 8, 10, 15, 90, 180]
        return ies([0], vertical, [[9000, 7000, 3000, 800, 100, 20, 5, 1, 0]])
    horizontal, vertical = PROFILES[name]
    return ies(horizontal, vertical, candelas(horizontal, vertical))


def ies_node(tree, emission, text, socket="Strength"):
    import bpy

    node = tree.nodes.new("ShaderNodeTexIES")
    node.ies = bpy.data.texts.new("profile.ies")
    node.ies.write(text)
    tree.links.new(node.outputs[0], emission.inputs[socket])
    return node


def compare(obj, tolerance=0.01, steep=0):
    """Bake with both and compare; a few squares may lie where light is steep, such as the rim of a cone."""
    ours, theirs = hemibakes(), cycles(obj)
    assert theirs.max() > 0 and np.ptp(theirs) > 0
    apart = np.abs(ours - theirs).max(axis=1) > tolerance * (theirs.max(axis=1) + 0.02 * theirs.max())
    assert apart.sum() <= steep, (ours[apart], theirs[apart])


def compare_ies(obj, tolerance=0.01, steep=0):
    """Compare with Cycles 5; before, it took 0 for the neighbours beyond 0 and 360 degrees."""
    import bpy

    compare(obj, tolerance if bpy.app.version >= (5, 0, 0) else 0.15, steep)


@pytest.mark.parametrize("name", [*PROFILES, "peaked"])
def test_an_ies_profile_is_that_of_cycles(around, name):
    obj, tree, emission = noded(shadow_soft_size=0)
    obj.rotation_euler = (0.4, -0.3, 1.1)
    ies_node(tree, emission, profile(name))
    compare_ies(around, steep=1 if name == "peaked" else 0)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (0.4, 1.5, 1), (-1, 1, 2)])
def test_a_profile_on_other_lamps_turned_and_scaled(around, kind, scale):
    sizes = {"SPOT": {"spot_size": 2.5, "shadow_soft_size": 0}, "AREA": {"size": 0.1}}
    obj, tree, emission = noded(kind, **sizes.get(kind, {"shadow_soft_size": 0.2}))
    obj.rotation_euler, obj.scale = (1.2, 0.5, -2), scale
    ies_node(tree, emission, profile("full"))
    compare_ies(around, steep=4)


def test_colour_strength_and_profile_multiply(around):
    """A product in Math nodes, a temperature, and the profile on the colour."""
    _, tree, emission = noded(shadow_soft_size=0, color=(1, 0.5, 0.2))
    warm, product = tree.nodes.new("ShaderNodeBlackbody"), tree.nodes.new("ShaderNodeMath")
    warm.inputs[0].default_value = 2700
    product.operation = "MULTIPLY"
    product.inputs[1].default_value = 0.7
    node = ies_node(tree, emission, profile("half"))
    node.inputs["Strength"].default_value = 1.7
    tree.links.new(node.outputs[0], product.inputs[0])
    tree.links.new(product.outputs[0], emission.inputs["Strength"])
    tree.links.new(warm.outputs[0], emission.inputs["Color"])
    assert read_scene().notes == ()
    compare_ies(around)


@pytest.mark.parametrize("output", ["Quadratic", "Linear", "Constant"])
def test_light_falloff(around, output):
    _, tree, emission = noded(shadow_soft_size=0)
    node = tree.nodes.new("ShaderNodeLightFalloff")
    node.inputs["Strength"].default_value, node.inputs["Smooth"].default_value = 3, 0.8
    tree.links.new(node.outputs[output], emission.inputs["Strength"])
    compare(around)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "SUN"])
def test_other_nodes_are_what_cycles_makes_of_them(around, kind):
    """Noise over directions, through a ramp of colours."""
    obj, tree, emission = noded(kind, **{"SUN": {"angle": 0}}.get(kind, {"shadow_soft_size": 0}))
    obj.rotation_euler, obj.scale = (0.3, 0.2, 0.1), (1, 0.5, 1)
    noise, coordinates = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Normal"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
    compare(around, 0.02)


def test_an_ies_file_beside_the_blend(around, tmp_path):
    import bpy

    text = profile("half").replace("TILT", "[OTHER] turned by 45\N{DEGREE SIGN}\nTILT").replace("\n", "\r\n")
    (tmp_path / "lamp.ies").write_bytes(text.encode("latin-1"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    _, tree, emission = noded(shadow_soft_size=0)
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.filepath = "EXTERNAL", "//lamp.ies"
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    compare_ies(around)


@pytest.mark.parametrize("text", [None, "", "hello", profile("full")[:200]])
def test_a_broken_ies_file_is_named_and_baked_as_in_cycles(around, text):
    _, tree, emission = noded(shadow_soft_size=0)
    node = ies_node(tree, emission, text or "")
    if text is None:
        node.mode, node.filepath = "EXTERNAL", "//nowhere.ies"
    (note,) = read_scene().notes
    assert "IES" in note and "'Lamp'" in note
    ours, theirs = hemibakes(), cycles(around)
    assert ours == pytest.approx(theirs, rel=0.01)


def test_lamps_leave_nothing_behind(around):
    import bpy

    for kind in ("POINT", "SPOT", "AREA", "SUN"):
        _, tree, emission = noded(kind)
        noise, warm = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBlackbody")
        tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
        tree.links.new(warm.outputs[0], noise.inputs["Scale"])
    kinds = ("scenes", "objects", "lights", "meshes", "materials", "images", "texts", "node_groups")
    before = {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds}
    notes = read_scene().notes
    assert {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds} == before
    assert len(notes) == 1 and "'Lamp.002'" in notes[0]


def test_a_flat_lamp_takes_no_longer():
    """Seen from a lamp scaled to almost nothing along an axis, all directions but two are the same."""
    lamp, tree, emission = noded()
    noise, coordinate = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinate.outputs["Normal"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], emission.inputs["Strength"])
    import bpy

    bake_lamp, seconds = part("operators.scene.light.light_bake").bake_lamp, []
    context = part("operators.scene").SceneContext(bpy.context)
    for scale in (1.0, 1.0, 1e-4, 1e-6):
        began = time.process_time()
        assert bake_lamp(lamp.data, np.diag([scale, 1.0, -1.0, 1.0]), context).profile is not None
        seconds.append(time.process_time() - began)
    assert max(seconds[2:]) < 4 * min(seconds[:2])
