"""Small scenes for `make verify`, one for each feature. Each is built in an empty file."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from tools.verification.doubled_faces import remove_doubled_faces

#: Every scene by name.
SCENES: dict[str, Callable[[], None]] = {}

#: Scenes whose light comes from lamps alone have the narrow limits; whole rooms the wide one.
ROOMS: dict[str, tuple[int, int]] = {}

#: Objects that Cycles also bakes in the user's own scene, by scene: their light shows that the reference has
#: all objects of a render.
ORIGINALS: dict[str, str] = {}

#: Limits of RMSE off edges and of bias, per cent, of scenes that differ by design (docs/design/accuracy.md).
BY_DESIGN: dict[str, tuple[float, float]] = {}

#: Light groups whose own map is compared, by scene; the reference has the lights of the group only.
GROUPS: dict[str, str] = {}

#: Settings by name that a scene needs in addition to those of every scene.
SETTINGS: dict[str, dict[str, object]] = {}

#: Working spaces other than Rec.709, by scene; Blender has them since 5.0.
WORKING_SPACES: dict[str, str] = {}

#: Words that a note of the bake must contain, by scene.
NOTES: dict[str, str] = {}


def scene(function: Callable[[], None]) -> Callable[[], None]:
    """Register a scene under its function's name."""
    SCENES[function.__name__] = function
    return function


def material(name: str, colour=(0.6, 0.6, 0.6), **inputs) -> bpy.types.Material:
    """Return a Principled material without shine."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    node = result.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1)
    node.inputs["Specular IOR Level"].default_value = 0
    for socket, value in inputs.items():
        node.inputs[socket.replace("_", " ")].default_value = value
    return result


def add(name: str, maker: Callable, surface: bpy.types.Material | None = None, **options) -> bpy.types.Object:
    """Add a primitive and return it."""
    maker(**options)
    obj = bpy.context.object
    obj.name = name
    if surface is not None:
        obj.data.materials.append(surface)
    return obj


def floor(surface: bpy.types.Material | None = None) -> bpy.types.Object:
    return add("Floor", bpy.ops.mesh.primitive_plane_add, surface or material("Floor"), size=4)


def box(surface: bpy.types.Material | None = None, location=(0.4, 0.2, 0.3)) -> bpy.types.Object:
    surface = surface or material("Box", (0.7, 0.3, 0.2))
    return add("Box", bpy.ops.mesh.primitive_cube_add, surface, size=0.6, location=location)


def stage() -> None:
    """A floor and a box on it, a little above so that nothing coincides."""
    floor()
    box(location=(0.4, 0.2, 0.35))


def lamp(kind: str, location=(-0.6, -0.4, 1.8), aim=(0.2, 0.1, 0), **values) -> bpy.types.Object:
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in values.items():
        setattr(data, name, value)
    obj = bpy.data.objects.new("Lamp", data)
    bpy.context.scene.collection.objects.link(obj)
    obj.location = location
    direction = np.array(aim) - np.array(location)
    obj.rotation_euler.z = math.atan2(direction[1], direction[0]) - math.pi / 2
    obj.rotation_euler.x = math.acos(-direction[2] / np.linalg.norm(direction))
    return obj


def world(colour=(0.5, 0.6, 0.8), strength=1.0) -> bpy.types.World:
    result = bpy.data.worlds.new("World")
    if result.node_tree is None:
        result.use_nodes = True
    node = result.node_tree.nodes["Background"]
    node.inputs["Color"].default_value = (*colour, 1)
    node.inputs["Strength"].default_value = strength
    bpy.context.scene.world = result
    return result


def picture(name: str, pixels: np.ndarray, space: str = "sRGB", is_float: bool = False) -> bpy.types.Image:
    """Return an image of (h, w, 4) numbers."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = space
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    image.update()
    image.pack()
    return image


def checker(size: int = 8, seed: int = 0) -> np.ndarray:
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(seed).uniform(0.1, 0.9, (size, size, 3))
    return pixels


def link_image(surface: bpy.types.Material, image: bpy.types.Image, socket: str, output: str = "Color"):
    """Link an image texture to an input of the Principled BSDF; return the texture node."""
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs[output], tree.nodes["Principled BSDF"].inputs[socket])
    return node


@scene
def point():
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0)


@scene
def point_soft():
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0.25)


@scene
def point_sphere():
    stage()
    lamp("POINT", energy=60, shadow_soft_size=0.25, use_soft_falloff=False)


@scene
def spot():
    stage()
    lamp("SPOT", energy=120, shadow_soft_size=0.1, spot_size=math.radians(60), spot_blend=0.4)


@scene
def spot_scaled():
    stage()
    obj = lamp("SPOT", energy=120, shadow_soft_size=0.1, spot_size=math.radians(60), spot_blend=0.4)
    obj.scale = (1.5, 0.7, 1.0)


@scene
def sun():
    stage()
    lamp("SUN", energy=3, angle=math.radians(6))


@scene
def area_square():
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.6)


@scene
def area_rectangle_scaled():
    stage()
    obj = lamp("AREA", energy=60, shape="RECTANGLE", size=0.6, size_y=0.3)
    obj.scale = (1.5, 0.7, 1)


@scene
def area_disk():
    stage()
    lamp("AREA", energy=60, shape="DISK", size=0.6)


@scene
def area_ellipse():
    stage()
    lamp("AREA", energy=60, shape="ELLIPSE", size=0.8, size_y=0.4)


@scene
def area_spread():
    stage()
    lamp("AREA", energy=60, shape="SQUARE", size=0.5, spread=math.radians(70))


@scene
def light_options():
    """Exposure, no normalization, temperature, where the version has them; a second lamp without shadow."""
    stage()
    obj = lamp("AREA", energy=20, shape="SQUARE", size=0.7)
    if hasattr(obj.data, "exposure"):
        obj.data.exposure, obj.data.normalize = 0.5, False
        obj.data.use_temperature, obj.data.temperature = True, 3200
    lamp("POINT", location=(1.0, -0.8, 1.2), energy=15, use_shadow=False, color=(0.2, 0.5, 1.0))


@scene
def instanced_lights():
    stage()
    inside = bpy.data.collections.new("Lamps")
    obj = lamp("POINT", location=(0, 0, 1.5), energy=30, shadow_soft_size=0.1)
    bpy.context.scene.collection.objects.unlink(obj)
    inside.objects.link(obj)
    for number in range(3):
        instance = bpy.data.objects.new(f"Instance {number}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", inside
        instance.location = (number - 1, 0.5 - number / 2, 0.2 * number)
        bpy.context.scene.collection.objects.link(instance)


@scene
def world_constant():
    stage()
    world()


def _hdri_pixels() -> np.ndarray:
    pixels = np.ones((64, 128, 4), np.float32)
    v, u = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(128) + 0.5) / 128, indexing="ij")
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = (
        0.2 + 0.6 * v,
        0.4 + 0.3 * np.cos(6.28 * u),
        0.2 + 0.8 * v,
    )
    pixels[44:47, 20:24, :3] = 150
    return pixels


@scene
def world_hdri():
    """An image with a small sun, turned by a Mapping node."""
    stage()
    tree = world(strength=0.8).node_tree
    node, mapping, coordinates = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord")
    )
    node.image = picture("Sky", _hdri_pixels(), "Linear Rec.709", True)
    mapping.inputs["Rotation"].default_value = (0, 0, 1.0)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


@scene
def world_gradient():
    """Nodes that only Blender evaluates."""
    stage()
    tree = world().node_tree
    gradient, coordinates = tree.nodes.new("ShaderNodeTexGradient"), tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Color"], tree.nodes["Background"].inputs["Color"])


@scene
def sky_sun():
    """A sky whose sun disc is narrower than the pixels of a picture of the world."""
    stage()
    tree = world(strength=0.3).node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    types = {item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items}
    sky.sky_type = "MULTIPLE_SCATTERING" if "MULTIPLE_SCATTERING" in types else "NISHITA"
    sky.sun_elevation, sky.sun_rotation, sky.sun_size = (math.radians(angle) for angle in (52, 140, 0.3))
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])


@scene
def textured():
    """An image with its own UV map, turned and repeated."""
    surface = material("Tiles")
    node = link_image(surface, picture("Tiles", checker()), "Base Color")
    tree = surface.node_tree
    uv, mapping = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeMapping")
    uv.uv_map = "UVMap"
    mapping.inputs["Rotation"].default_value = (0, 0, 0.6)
    mapping.inputs["Scale"].default_value = (1.7, 1.3, 1)
    mapping.inputs["Location"].default_value = (0.2, 0.4, 0)
    tree.links.new(uv.outputs[0], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    floor(surface)
    box(material("White", (0.9, 0.9, 0.9)), (0.4, 0.2, 0.35))
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)


@scene
def procedural():
    surface = material("Noise")
    tree = surface.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    floor(surface)
    box(material("White", (0.9, 0.9, 0.9)), (0.4, 0.2, 0.35))
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)


@scene
def vertex_colours():
    surface = material("Painted")
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    obj = floor(surface)
    paint = obj.data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    paint.data.foreach_set("color", [0.9, 0.1, 0.1, 1, 0.1, 0.9, 0.1, 1, 0.1, 0.1, 0.9, 1, 0.9, 0.9, 0.9, 1])
    box(material("White", (0.9, 0.9, 0.9)), (0.4, 0.2, 0.35))
    lamp("AREA", energy=60, shape="SQUARE", size=0.8)


@scene
def several_materials():
    floor()
    obj = box(None, (0.4, 0.2, 0.35))
    obj.data.materials.append(material("Green", (0.1, 0.7, 0.2)))
    obj.data.materials.append(
        material("Glow", (0.2, 0.2, 0.2), Emission_Color=(1, 0.8, 0.5, 1), Emission_Strength=3)
    )
    for polygon in obj.data.polygons:
        polygon.material_index = polygon.index % 3
    lamp("AREA", energy=40, shape="SQUARE", size=0.8)


def _holes(threshold: float | None) -> None:
    floor()
    pixels = checker(8, 3)
    pixels[..., 3] = np.random.default_rng(4).uniform(0, 1, (8, 8))
    surface = material("Leaves", (0.2, 0.6, 0.2))
    node = link_image(surface, picture("Leaves", pixels), "Alpha", "Alpha")
    tree = surface.node_tree
    if threshold is not None:
        math_node = tree.nodes.new("ShaderNodeMath")
        math_node.operation = "GREATER_THAN"
        math_node.inputs[1].default_value = threshold
        tree.links.new(node.outputs["Alpha"], math_node.inputs[0])
        tree.links.new(math_node.outputs[0], tree.nodes["Principled BSDF"].inputs["Alpha"])
    leaf = add("Leaf", bpy.ops.mesh.primitive_plane_add, surface, size=1.6, location=(0.1, 0, 0.7))
    leaf.rotation_euler = (math.pi, 0, 0)
    leaf.hemibake.role = "NO_LIGHTMAP"
    lamp("AREA", energy=60, shape="SQUARE", size=0.2)
    world(strength=0.2)


@scene
def alpha_clipped():
    _holes(0.5)


@scene
def alpha_blended():
    _holes(None)


@scene
def alpha_modes():
    """Images of each alpha mode around a lamp, two of them with a linked alpha."""
    lamp("POINT", (0, 0, 1.5), energy=60, shadow_soft_size=0.1)
    pixels = checker(8, 5)
    pixels[..., 3] = np.random.default_rng(6).uniform(0.2, 1, (8, 8))
    for index, mode in enumerate(("STRAIGHT", "PREMUL", "CHANNEL_PACKED", "NONE")):
        surface = material(mode)
        image = picture(mode, pixels)
        image.alpha_mode = mode
        node = link_image(surface, image, "Base Color")
        if index % 2:
            surface.node_tree.links.new(
                node.outputs["Alpha"], surface.node_tree.nodes["Principled BSDF"].inputs["Alpha"]
            )
        place = (index % 2 - 0.5, index // 2 - 0.5, 0)
        add(mode, bpy.ops.mesh.primitive_plane_add, surface, size=0.9, location=place)
    add("Ground", bpy.ops.mesh.primitive_plane_add, material("Ground"), size=4, location=(0, 0, -0.3))


@scene
def emission_small():
    """A small bright quad, which is sampled as a light."""
    stage()
    glow = material("Glow", (0, 0, 0), Emission_Color=(1, 0.9, 0.7, 1), Emission_Strength=40)
    quad = add("Quad", bpy.ops.mesh.primitive_plane_add, glow, size=0.3, location=(-0.5, 0.3, 1.2))
    quad.rotation_euler = (0.4, math.pi, 0)
    quad.hemibake.role = "NO_LIGHTMAP"


@scene
def emission_large():
    """A large dim ceiling, which the hemicubes see."""
    stage()
    glow = material("Glow", (0, 0, 0), Emission_Color=(1, 0.9, 0.7, 1), Emission_Strength=1)
    add(
        "Ceiling", bpy.ops.mesh.primitive_plane_add, glow, size=6, location=(0, 0, 2)
    ).hemibake.role = "NO_LIGHTMAP"


@scene
def emission_textured():
    stage()
    glow = material("Glow", (0, 0, 0), Emission_Strength=20)
    link_image(glow, picture("Screen", checker(4, 7)), "Emission Color")
    quad = add("Screen", bpy.ops.mesh.primitive_plane_add, glow, size=0.5, location=(-0.5, 0.3, 1.2))
    quad.rotation_euler = (0.4, math.pi, 0)


@scene
def smooth_sphere():
    """Shading normals differ from the facets: no dark facets along the terminator."""
    floor()
    ball = add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, material("Ball", (0.7, 0.7, 0.7)),
               segments=32, ring_count=16, radius=0.5, location=(0.2, 0.1, 0.7))  # fmt: skip
    ball.data.polygons.foreach_set("use_smooth", [True] * len(ball.data.polygons))
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def linked_duplicates():
    floor()
    first = box(None, (0.8, 0.5, 0.4))
    for number, location in enumerate([(-0.6, -0.4, 0.4), (-0.5, 0.8, 0.5)]):
        copy = bpy.data.objects.new(f"Copy {number}", first.data)
        copy.location, copy.scale = location, (1 + 0.4 * number,) * 3
        bpy.context.scene.collection.objects.link(copy)
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def collection_instances():
    floor()
    inside = bpy.data.collections.new("Boxes")
    original = box(None, (0, 0, 0.4))
    bpy.context.scene.collection.objects.unlink(original)
    inside.objects.link(original)
    for number in range(3):
        instance = bpy.data.objects.new(f"Instance {number}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", inside
        instance.location, instance.rotation_euler = (number - 1, 0.6 - 0.5 * number, 0), (0, 0, 0.5 * number)
        bpy.context.scene.collection.objects.link(instance)
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def geometry_nodes_instances():
    floor()
    original = box(None, (1.2, -1.2, 0.35))
    points = add("Points", bpy.ops.mesh.primitive_plane_add, None, size=1.6, location=(0, 0, 0.5))
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeObjectInfo", "NodeGroupOutput")
    source, instances, info, sink = (tree.nodes.new(name) for name in names)
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = original, True
    tree.links.new(source.outputs[0], instances.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], instances.inputs["Instance"])
    tree.links.new(instances.outputs[0], sink.inputs[0])
    points.modifiers.new("Instances", "NODES").node_group = tree
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def scaled_and_mirrored():
    floor()
    obj = box(None, (0.4, 0.2, 0.5))
    obj.scale, obj.rotation_euler = (-1.4, 0.6, 0.8), (0.2, 0.1, 0.5)
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def curve_occluders():
    """A tube, a text and metaballs cast shadows and reflect."""
    floor()
    red = material("Red", (0.8, 0.1, 0.1))
    curve = add("Tube", bpy.ops.curve.primitive_bezier_circle_add, red, radius=0.4, location=(0.5, 0.4, 0.4))
    curve.data.bevel_depth = 0.08
    text = add("Text", bpy.ops.object.text_add, red, location=(-0.9, -0.6, 0.1))
    text.data.extrude, text.rotation_euler = 0.05, (1.3, 0, 0)
    add("Ball", bpy.ops.object.metaball_add, red, type="BALL", radius=0.5, location=(-0.5, 0.7, 0.5))
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def roles():
    """An occluder that shades and bounces, and an ignored box that does neither."""
    floor()
    box(None, (0.4, 0.2, 0.35)).hemibake.role = "NO_LIGHTMAP"
    box(None, (-0.8, -0.6, 0.6)).hemibake.role = "IGNORED"
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(strength=0.3)


@scene
def room():
    """A closed room with a lamp: many bounces."""
    add(
        "Room",
        bpy.ops.mesh.primitive_cube_add,
        material("Walls", (0.7, 0.7, 0.65)),
        size=3,
        location=(0, 0, 1.5),
    )
    bpy.context.object.data.flip_normals()
    box(None, (0.4, 0.2, 0.35))
    lamp("AREA", location=(0, 0, 2.8), aim=(0, 0.001, 0), energy=60, shape="SQUARE", size=0.8)


ROOMS["room"] = (64, 512)


def register_files(folder: Path) -> None:
    """Register the scenes of a folder that are there, each with its resolution and samples."""
    if (folder / "living_room.blend").exists():
        SCENES["living_room"] = lambda: open_blend(folder / "living_room.blend")
        ROOMS["living_room"] = (256, 64)
    if (folder / "house.glb").exists():
        SCENES["house"] = lambda: _open_house(folder)
        ROOMS["house"] = (512, 64)
    if (folder / "tile-game-room6.glb").exists():
        SCENES["tile_game_room"] = lambda: open_glb(folder / "tile-game-room6.glb", folder)
        ROOMS["tile_game_room"] = (128, 256)
    if (folder / "CornellBox.glb").exists():
        SCENES["cornell_box"] = lambda: bpy.ops.import_scene.gltf(filepath=str(folder / "CornellBox.glb"))
        ROOMS["cornell_box"] = (256, 64)


def _open_house(folder: Path) -> None:
    """Open the house without its 2,506 doubled faces, which darken each other in Cycles."""
    open_glb(folder / "house.glb", folder)
    remove_doubled_faces()


def open_blend(path: Path) -> None:
    """Open a file in Object Mode, so that its meshes can be changed."""
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    if bpy.context.object is not None and bpy.context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.scene.hemibake.directory = "//"


def open_glb(path: Path, folder: Path) -> None:
    bpy.ops.import_scene.gltf(filepath=str(path))
    tree = world(strength=1.0).node_tree
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.load(str(folder / "spiaggia_di_mondello_1k.hdr"))
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
