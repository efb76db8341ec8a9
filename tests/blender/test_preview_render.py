"""Renders of the preview, without any lamp, against renders of the original in its light."""

import numpy as np
import pytest

from tests.blender.things import SQUARE_UVS, bpy_link, mesh_object, part, pixels, snapshot, square
from tests.rows import long

#: Pixels of a render, and of the blocks whose means are compared.
_WIDTH, _BLOCK = 48, 8


class Nodes:
    """Builds the node tree of a new material."""

    def __init__(self, name="Test"):
        import bpy

        self.material = bpy.data.materials.new(name)
        self.tree = part("operators.compat").new_node_tree(self.material)
        self.tree.nodes.clear()
        self.output = self.tree.nodes.new("ShaderNodeOutputMaterial")

    def add(self, kind, settings=None, **inputs):
        """Add a node; inputs are values, or outputs of nodes."""
        import bpy

        node = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in (settings or {}).items():
            setattr(node, name, value)
        for name, value in inputs.items():
            socket = node.inputs[int(name[1:]) if name[1:].isdigit() else name.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node.outputs[0]

    def principled(self, **inputs):
        """Add a Principled BSDF without the shine of its surface, which no lightmap has."""
        return self.add("BsdfPrincipled", **{"Specular_IOR_Level": 0.0, **inputs})

    def done(self, shader):
        self.tree.links.new(shader, self.output.inputs["Surface"])
        return self.material


def picture(alpha=None):
    """Return an image of random colours."""
    import bpy

    image = bpy.data.images.new("Picture", 7, 5, alpha=True, float_buffer=True, is_data=True)
    values = np.random.default_rng(3).uniform(0.2, 0.9, (5, 7, 4)).astype(np.float32)
    values[..., 3] = 1 if alpha is None else np.indices((5, 7)).sum(axis=0) % 2
    image.pixels.foreach_set(values.reshape(-1))
    image.pack()
    return image


def textured():
    nodes = Nodes()
    uv = nodes.add("UVMap", {"uv_map": "Picture"})
    colour = nodes.add("TexImage", {"image": picture(), "interpolation": "Closest"}, Vector=uv)
    return nodes.done(nodes.principled(Base_Color=colour))


def leaf():
    """Holes where an image's alpha is 0."""
    nodes = Nodes()
    uv = nodes.add("UVMap", {"uv_map": "Picture"})
    colour = nodes.add("TexImage", {"image": picture(alpha=0), "interpolation": "Closest"}, Vector=uv)
    cut = nodes.add("Math", {"operation": "GREATER_THAN"}, _0=colour.node.outputs["Alpha"], _1=0.5)
    return nodes.done(nodes.principled(Base_Color=colour, Alpha=cut))


def blended():
    nodes = Nodes()
    return nodes.done(nodes.principled(Base_Color=(0.7, 0.5, 0.2, 1), Alpha=0.4))


def culled():
    """The back is not there, by nodes."""
    nodes = Nodes()
    back = nodes.add("NewGeometry").node.outputs["Backfacing"]
    front = nodes.add("BsdfDiffuse", Color=(0.8, 0.3, 0.2, 1))
    return nodes.done(nodes.add("MixShader", _0=back, _1=front, _2=nodes.add("BsdfTransparent")))


def glowing():
    nodes = Nodes()
    colour = nodes.add("TexVoronoi", Scale=6.0).node.outputs["Color"]
    return nodes.done(
        nodes.principled(Base_Color=(0.2, 0.6, 0.9, 1), Emission_Color=colour, Emission_Strength=0.7)
    )


def mixed():
    """Noise chooses between a diffuse and a glowing shader."""
    nodes = Nodes()
    noise = nodes.add("TexNoise", Scale=4.0)
    glow = nodes.add("Emission", Color=(0.1, 0.4, 0.9, 1), Strength=1.3)
    diffuse = nodes.add("BsdfDiffuse", Color=(0.9, 0.5, 0.1, 1))
    return nodes.done(nodes.add("MixShader", _0=noise, _1=diffuse, _2=glow))


def procedural():
    nodes = Nodes()
    return nodes.done(nodes.principled(Base_Color=nodes.add("TexNoise", Scale=5.0).node.outputs["Color"]))


def grouped():
    """A group with a group in it, and in that the shader."""
    import bpy

    def group(name, inner):
        tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
        tree.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        node = tree.nodes.new(inner if isinstance(inner, str) else "ShaderNodeGroup")
        if not isinstance(inner, str):
            node.node_tree = inner
        tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], node.inputs[0])
        tree.links.new(node.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
        return tree

    nodes = Nodes()
    noise = nodes.add("TexNoise", Scale=5.0).node.outputs["Color"]
    tree = group("Outer", group("Inner", "ShaderNodeBsdfDiffuse"))
    return nodes.done(nodes.add("Group", {"node_tree": tree}, Tint=noise))


def metal():
    """Half a mirror, without lamps to be mirrored."""
    nodes = Nodes()
    return nodes.done(nodes.principled(Base_Color=(0.9, 0.7, 0.4, 1), Metallic=0.6, Roughness=0.0))


def embossed():
    """A normal map: tilts of 20 degrees about, another one in each of 35 cells."""
    import bpy

    image = bpy.data.images.new("Normals", 7, 5, float_buffer=True, is_data=True)
    normals = np.random.default_rng(11).normal(size=(5, 7, 3)) * (0.3, 0.3, 0) + (0, 0, 1)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    values = np.concatenate([0.5 + 0.5 * normals, np.ones((5, 7, 1))], axis=2)
    image.pixels.foreach_set(values.astype(np.float32).reshape(-1))
    image.pack()
    nodes = Nodes()
    uv = nodes.add("UVMap", {"uv_map": "Picture"})
    colour = nodes.add("TexImage", {"image": image, "interpolation": "Closest"}, Vector=uv)
    normal = nodes.add("NormalMap", {"uv_map": "Picture"}, Color=colour)
    return nodes.done(nodes.principled(Base_Color=(0.8, 0.6, 0.3, 1), Normal=normal))


SURFACES = [textured, leaf, blended, culled, glowing, mixed, procedural, grouped, metal]


@pytest.fixture
def stage():
    """A camera above a floor in the light of a sun and of a grey sky.

    The floor glows and reflects little: lightmaps have no light that the backs of surfaces reflect.
    """
    import bpy

    scene = bpy.context.scene
    scene.hemibake.resolution, scene.hemibake.hemicube = 64, "32"
    sun = bpy_link(bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN")))
    sun.data.energy, sun.rotation_euler = 2.0, (0.5, 0.2, 0)
    world = scene.world = bpy.data.worlds.new("Sky")
    tree = part("operators.compat").new_node_tree(world)
    next(node for node in tree.nodes if node.type == "BACKGROUND").inputs["Color"].default_value = (
        0.5,
    ) * 3 + (1,)
    nodes = Nodes("Floor")
    shader = nodes.principled(
        Base_Color=(0.03, 0.05, 0.04, 1), Emission_Color=(0.1, 0.3, 0.2, 1), Emission_Strength=1.0
    )
    floor = square("Floor", uvs=None, surface=nodes.done(shader))
    floor.scale, floor.location = (2.2, 2.2, 1), (-0.6, -0.6, -0.7)
    camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.5
    camera.location, scene.camera = (0.5, 0.5, 3), camera
    return scene


def render(scene, folder, samples) -> np.ndarray:
    """Return means of blocks of pixels of a render."""
    import bpy

    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, False
    scene.cycles.device = "CPU"
    scene.render.resolution_x = scene.render.resolution_y = _WIDTH
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / f"{len(list(folder.iterdir()))}.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    blocks = pixels(image)[..., :3].reshape(_WIDTH // _BLOCK, _BLOCK, _WIDTH // _BLOCK, _BLOCK, 3)
    bpy.data.images.remove(image)
    return blocks.mean(axis=(1, 3))


def preview_differs(scene, folder, samples=32) -> float:
    """Return the RMS difference of the preview without lamps to the lit original, relative to the mean."""
    import bpy

    original = render(scene, folder, samples)
    bpy.ops.hemibake.bake()
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    bpy.data.objects["Sun"].hide_render, scene.world = True, None
    shown = render(scene, folder, samples)
    return float(np.sqrt(((shown - original) ** 2).mean()) / original.mean())


def shown_square(surface, name="Shown"):
    """Return a square with a UV map for textures."""
    obj = square(name, uvs=None, surface=surface)
    obj.data.uv_layers.new(name="Picture").uv.foreach_set("vector", np.ravel(SQUARE_UVS))
    return obj


@pytest.mark.parametrize("surface", SURFACES)
def test_preview_looks_like_the_original(stage, tmp_path, surface):
    obj = shown_square(surface())
    if surface is culled:
        obj.rotation_euler, obj.location = (np.pi, 0, 0), (0.3, 1, 0)
    if surface is metal:
        stage.world = None
    difference = preview_differs(stage, tmp_path)
    assert difference < 0.006


@pytest.mark.parametrize(
    ("turn", "scale", "location"),
    [(0.0, (1, 1, 1), (0, 0, 0)), (2.1, (1, 1, 1), (1.1, 0.3, 0)), (0.4, (-1, 1, 1), (1, -0.2, 0))],
    ids=["plain", "turned", "mirrored"],
)
def test_directional_maps_shade_normal_maps(stage, tmp_path, turn, scale, location):
    """As the original, where a plain lightmap is flat; the maps are of the world, however objects turn.

    The shadow of bumps is that of Cycles since Blender 4.5; before, they are darker.
    """
    import bpy

    obj = shown_square(embossed())
    obj.rotation_euler.z, obj.scale, obj.location = turn, scale, location
    shaded, flat = errors_of_shading(stage, tmp_path)
    assert shaded < (0.02 if bpy.app.version >= (4, 5) else 0.03) and shaded < 0.4 * flat


@pytest.mark.parametrize(
    ("output", "names", "light"),
    [
        ("directional", ("L0", "L1 x", "L1 y", "L1 z"), lambda e, l0, tilt, n: e + tilt @ (n - (0, 0, 1))),
        (
            "spherical_harmonics",
            ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z"),
            lambda e, l0, tilt, n: l0 * (1 + 2 * tilt @ n),
        ),
    ],
)
@pytest.mark.parametrize("normal", [(0.48, -0.36, 0.8), long((-0.6, 0.0, 0.8)), long((0.28, 0.96, 0.0))])
def test_the_preview_decodes_directional_maps_as_the_manifest_tells(
    stage, tmp_path, output, names, light, normal
):
    """Maps of one colour each, and one tilted normal; what would be negative is black."""
    import bpy

    nodes = Nodes()
    tilted = nodes.add("CombineXYZ", X=normal[0], Y=normal[1], Z=normal[2])
    obj = shown_square(nodes.done(nodes.principled(Base_Color=(0.8, 0.6, 0.3, 1), Normal=tilted)))
    obj.location = (0.2, 0.2, 0)
    stage.hemibake.outputs = {"combined", output}
    bpy.ops.hemibake.bake()
    l0 = np.array([0.5, 0.7, 0.9])
    tilt = np.array([[0.4, -0.9, 0.1], [0.3, -0.4, 0.2], [0.5, -0.5, 0.3]])
    for name, colour in zip(names, (l0, *tilt.T), strict=True):
        fill(bpy.data.images[f"Lightmap {name}"], colour)
    flat = np.array([0.4, 0.5, 0.6])
    fill(bpy.data.images["Lightmap"], flat)
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    bpy.data.objects["Sun"].hide_render, stage.world = True, None
    shown = render(stage, tmp_path, 4)[3, 3]
    expected = (0.8, 0.6, 0.3) * np.maximum(light(flat, l0, tilt, np.array(normal)), 0)
    assert shown == pytest.approx(expected, rel=1e-3, abs=1e-4)


def fill(image, colour):
    """Give all texels of an image one colour."""
    values = np.ones((image.size[1], image.size[0], 4), np.float32)
    values[..., :3] = colour
    image.pixels.foreach_set(values.reshape(-1))
    image.update()


def errors_of_shading(scene, folder) -> list[float]:
    """Return RMS errors of previews with and without directional maps, relative to the original's mean."""
    import bpy

    original = render(scene, folder, 128)
    scene.hemibake.outputs = {"combined", "directional"}
    bpy.ops.hemibake.bake()
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    bpy.data.objects["Sun"].hide_render, scene.world = True, None
    pictures = [render(scene, folder, 16)]
    bpy.ops.hemibake.preview()
    for entry in scene.hemibake.lightmaps:
        entry.directional = "NONE"
    bpy.ops.hemibake.preview()
    pictures.append(render(scene, folder, 16))
    return [float(np.sqrt(((shown - original) ** 2).mean()) / original.mean()) for shown in pictures]


def by_collections(source, places):
    """Let empties show a collection with an object that is nowhere else."""
    import bpy

    collection = bpy.data.collections.new("Sources")
    bpy.context.scene.collection.objects.unlink(source)
    collection.objects.link(source)
    for place in places:
        empty = bpy_link(bpy.data.objects.new("Empty", None))
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, place


def by_vertices(source, places):
    """Let the vertices of an object show another one."""
    parent = mesh_object("Points", places, [])
    source.parent, parent.instance_type = parent, "VERTS"


def by_nodes(source, places):
    """Let Geometry Nodes show an object on points; it is shown itself, too."""
    import bpy

    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    info, scatter = tree.nodes.new("GeometryNodeObjectInfo"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = source, True
    scatter.inputs["Scale"].default_value = source.scale
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    mesh_object("Points", places, []).modifiers.new("Scatter", "NODES").node_group = tree
    source.location = (0.3, 0.92, 0)


@pytest.mark.parametrize("show", [by_nodes, long(by_collections), long(by_vertices)])
def test_preview_of_instances_looks_like_the_original(stage, tmp_path, show):
    """Some are in a shadow, some are not."""
    import bpy

    source = shown_square(procedural(), "Source")
    source.scale = (0.4, 0.4, 1)
    places = [(0.45 * x, 0.5 * y, 0) for x in (0, 1, 2) for y in (0, 1)]
    show(source, places)
    stage.hemibake.resolution, bpy.data.lights["Sun"].angle = 128, 1.0
    nodes = Nodes("Black")
    roof = square("Roof", uvs=None, surface=nodes.done(nodes.add("BsdfDiffuse", Color=(0, 0, 0, 1))))
    roof.location, roof.hemibake.role, roof.visible_camera = (0.2, -0.8, 0.4), "NO_LIGHTMAP", False
    assert preview_differs(stage, tmp_path, samples=256) < 0.02
    before = snapshot()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    (table,) = [image for image in bpy.data.images if image.name == "Source (places)"]
    assert pixels(table).tobytes() == before["images"]["Source (places)"]
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    assert not [image for image in bpy.data.images if "places" in image.name]
    assert not [material for material in bpy.data.materials if "lightmap" in material.name]


@pytest.mark.parametrize(
    ("tilt", "limit"), [((0, 0), 0.02), long((0.3, -0.2), 0.05)], ids=["turned", "tilted"]
)
def test_directional_maps_shade_normal_maps_of_instances(stage, tmp_path, tilt, limit):
    """Of one object, each with a turn of its own: the maps are of the world, not of the object.

    Where the sun is far off the normal the fit is off by a few percent.
    """
    import bpy

    source = shown_square(embossed(), "Source")
    source.scale = (0.6, 0.6, 1)
    by_collections(source, [(0, 0, 0), (1.2, 0.1, 0.1), (0.6, 1.2, 0.2)])
    empties = [obj for obj in bpy.data.objects if obj.type == "EMPTY"]
    for empty, turn in zip(empties, (0.0, 1.8, 4.0), strict=True):
        empty.rotation_euler = (*tilt, turn)
    stage.hemibake.resolution = 128
    shaded, flat = errors_of_shading(stage, tmp_path)
    assert shaded < 0.06 and shaded < 0.5 * flat


def test_preview_of_every_kind_of_slot_looks_like_the_original(stage, tmp_path):
    """One material in light and in shadow, a slot of the object's own, no slot, a material without nodes.

    The grey of the last two shines a little in the original.
    """
    import bpy

    stage.camera.data.ortho_scale, stage.hemibake.resolution = 2.1, 128
    bpy.data.lights["Sun"].angle = 1.0
    shared, plain = procedural(), bpy.data.materials.new("Plain")
    plain.diffuse_color = (0.9, 0.3, 0.1, 1)
    surfaces = [shared, shared, textured(), None, plain]
    objects = [shown_square(None, name) for name in ("Lit", "Shaded", "Own", "Bare", "Plain")]
    for index, (obj, surface) in enumerate(zip(objects, surfaces, strict=True)):
        obj.location, obj.scale = (0.7 * (index % 3) - 0.5, 0.8 * (index // 3) - 0.1, 0), (0.6, 0.6, 1)
        if surface is not None:
            obj.data.materials.append(None if obj.name == "Own" else surface)
    objects[2].material_slots[0].link = "OBJECT"
    objects[2].material_slots[0].material = surfaces[2]
    nodes = Nodes("Black")
    roof = square("Roof", uvs=None, surface=nodes.done(nodes.add("BsdfDiffuse", Color=(0, 0, 0, 1))))
    roof.location, roof.hemibake.role, roof.visible_camera = (0.2, -0.8, 0.4), "NO_LIGHTMAP", False
    objects[1].hemibake.atlas = "Other"
    assert preview_differs(stage, tmp_path, samples=256) < 0.02
    materials = [obj.material_slots[0].material for obj in objects[:2]]
    assert materials[0] != materials[1] and objects[0].hemibake.image != objects[1].hemibake.image
