"""Makes the file that a case describes; runs inside Blender."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

from tests.blender.things import CUBE, INWARD, SQUARE, part
from tests.fuzz.blender_cases import Case, Lamp, Thing

_IES = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 3 1 1 2 0 0 0
1 1 50
0 45 90
0
100 50 0
"""


def build(case: Case, folder: Path) -> None:
    """Make the file in an empty Blender."""
    (folder / "file").write_text("not a folder")
    surfaces = [_surface(kind, f"Surface {i}", folder) for i, kind in enumerate(case.surfaces)]
    made: list[bpy.types.Object] = []
    for index, thing in enumerate(case.things):
        made.append(_thing(thing, f"Thing {index}", made, surfaces))
    for index, lamp in enumerate(case.lamps):
        _lamp(lamp, f"Lamp {index}", folder)
    _world(case.world, folder)
    _set_up(case, made, folder)


def _is_shown(obj) -> bool:
    """Return whether an object is in the view layer, as it is now: only then may it be active."""
    bpy.context.view_layer.update()
    return obj.name in bpy.context.view_layer.objects


def _set_up(case: Case, made: list[bpy.types.Object], folder: Path) -> None:
    settings = bpy.context.scene.hemibake
    for name, value in case.settings.items():
        if name == "directory":
            value = value.format(folder=folder)
        setattr(settings, name, set(value) if name == "outputs" else value)
    if case.saved:
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    if case.active is not None and case.active < len(made) and _is_shown(made[case.active]):
        bpy.context.view_layer.objects.active = made[case.active]
        if case.mode != "OBJECT" and bpy.ops.object.mode_set.poll():
            try:
                bpy.ops.object.mode_set(mode=case.mode)
            except (RuntimeError, TypeError):
                return


# Objects.


def _mesh(name: str, vertices: list, faces: list, edges: list = ()) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, list(edges), faces)
    return mesh


def _ball(name: str) -> bpy.types.Mesh:
    import bmesh

    mesh, shape = bpy.data.meshes.new(name), bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=8, v_segments=5, radius=1)
    shape.to_mesh(mesh)
    shape.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh


def _ngon(name: str) -> bpy.types.Mesh:
    angle = np.linspace(0, 2 * np.pi, 12)[:-1]
    radius = np.where(np.arange(11) % 2, 1.0, 0.4)
    points = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, angle * 0], axis=1)
    return _mesh(name, points.tolist(), [tuple(range(11))])


_MESHES: dict[str, Callable[[str], bpy.types.Mesh]] = {
    "quad": lambda name: _mesh(name, SQUARE, [(0, 1, 2, 3)]),
    "cube": lambda name: _mesh(name, CUBE, [face[::-1] for face in INWARD]),
    "inward cube": lambda name: _mesh(name, CUBE, INWARD),
    "ball": _ball,
    "ngon": _ngon,
    "loose edges": lambda name: _mesh(name, SQUARE, [], [(0, 1), (2, 3)]),
    "nothing": lambda name: _mesh(name, [], []),
    "NaN vertex": lambda name: _mesh(name, [(0, 0, 0), (1, 0, 0), (float("nan"), 1, 0)], [(0, 1, 2)]),
    "far vertex": lambda name: _mesh(name, [*CUBE[:7], (1e10, 1, 1)], INWARD),
    "flat": lambda name: _mesh(name, [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]),
}


def _thing(thing: Thing, name: str, made: list[bpy.types.Object], surfaces: list) -> bpy.types.Object:
    obj = _object(thing, name, made)
    bpy.context.scene.collection.objects.link(obj)
    obj.location, obj.scale = thing.location, thing.scale
    if thing.child and made:
        obj.parent = made[-1]
    if obj.type == "MESH" and obj.data.users == 1:
        _dress(thing, obj.data)
    _add_slots(thing, obj, surfaces)
    for kind in thing.modifiers if obj.type == "MESH" else ():
        modifier = obj.modifiers.new(kind, kind)
        if kind == "NODES":
            modifier.node_group = _instancer()
    obj.hemibake.role, obj.hemibake.atlas = thing.role, thing.atlas
    obj.select_set(thing.selected)
    _hide(thing, obj)
    return obj


def _object(thing: Thing, name: str, made: list[bpy.types.Object]) -> bpy.types.Object:
    """Return an object that is not linked yet."""
    if thing.kind in _MESHES:
        return bpy.data.objects.new(name, _MESHES[thing.kind](name))
    meshes = [obj for obj in made if obj.type == "MESH"]
    if thing.kind == "multi-user":
        return bpy.data.objects.new(name, meshes[-1].data if meshes else _MESHES["quad"](name))
    if thing.kind == "nodes":
        obj = bpy.data.objects.new(name, _MESHES["cube"](name))
        obj.modifiers.new("Instances", "NODES").node_group = _instancer()
        return obj
    if thing.kind == "collection":
        obj = bpy.data.objects.new(name, None)
        obj.instance_type, obj.instance_collection = "COLLECTION", _group(name)
        return obj
    return bpy.data.objects.new(name, _OTHER[thing.kind](name))


def _group(name: str) -> bpy.types.Collection:
    """Return a collection with a mesh and a lamp that only instances show."""
    group = bpy.data.collections.new(f"{name} group")
    group.objects.link(bpy.data.objects.new(f"{name} inner", _MESHES["cube"](f"{name} inner")))
    group.objects.link(bpy.data.objects.new(f"{name} light", bpy.data.lights.new(f"{name} light", "POINT")))
    return group


def _curve(name: str) -> bpy.types.Curve:
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", 0.1
    spline = curve.splines.new("POLY")
    spline.points.add(2)
    for point, corner in zip(spline.points, SQUARE, strict=False):
        point.co = (*corner, 1)
    return curve


def _text(name: str) -> bpy.types.Curve:
    text = bpy.data.curves.new(name, "FONT")
    text.body = "Ä"
    return text


def _metaball(name: str) -> bpy.types.MetaBall:
    ball = bpy.data.metaballs.new(name)
    ball.elements.new()
    return ball


_OTHER: dict[str, Callable] = {
    "curve": _curve,
    "text": _text,
    "metaball": _metaball,
    "empty": lambda name: None,
    "armature": lambda name: bpy.data.armatures.new(name),
    "lattice": lambda name: bpy.data.lattices.new(name),
}


def _instancer() -> bpy.types.NodeTree:
    """Return geometry nodes that put cubes on the points of a mesh."""
    tree = bpy.data.node_groups.new("Instancer", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeMeshCube", "NodeGroupOutput")
    first, points, cube, last = (tree.nodes.new(kind) for kind in kinds)
    cube.inputs["Size"].default_value = (0.1, 0.1, 0.1)
    tree.links.new(first.outputs[0], points.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], points.inputs["Instance"])
    tree.links.new(points.outputs["Instances"], last.inputs[0])
    return tree


def _dress(thing: Thing, mesh: bpy.types.Mesh) -> None:
    """Give a mesh UV layers, material indices and colours."""
    loops = np.repeat(np.arange(len(mesh.polygons)), [len(face.vertices) for face in mesh.polygons])
    columns = int(np.ceil(np.sqrt(max(1, len(mesh.polygons)))))
    angle = np.concatenate([np.linspace(0, 2 * np.pi, n, False) for n in np.bincount(loops)] or [np.zeros(0)])
    inner = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 0.4 + 0.5
    uvs = (inner + np.stack([loops % columns, loops // columns], axis=1)) / columns * thing.spread
    for name in thing.uvs:
        mesh.uv_layers.new(name=name).uv.foreach_set("vector", uvs.astype(np.float32).reshape(-1))
    indices = np.resize(np.array(thing.indices, np.int32), len(mesh.polygons))
    mesh.polygons.foreach_set("material_index", indices)
    if thing.colour_attribute and len(mesh.vertices):
        mesh.color_attributes.new("Colour", "FLOAT_COLOR", "POINT")


def _add_slots(thing: Thing, obj: bpy.types.Object, surfaces: list) -> None:
    if getattr(obj.data, "materials", None) is None:
        return
    for number in thing.slots:
        surface = None if number is None else surfaces[number % len(surfaces)]
        if thing.linked == "DATA":
            obj.data.materials.append(surface)
            continue
        obj.data.materials.append(None)
        slot = obj.material_slots[-1]
        slot.link = "OBJECT"
        slot.material = surface


def _hide(thing: Thing, obj: bpy.types.Object) -> None:
    if thing.hidden == "layer":
        collection = bpy.data.collections.new("Hidden")
        bpy.context.scene.collection.children.link(collection)
        bpy.context.scene.collection.objects.unlink(obj)
        collection.objects.link(obj)
        bpy.context.view_layer.layer_collection.children["Hidden"].exclude = True
        return
    obj.hide_viewport, obj.hide_render = thing.hidden == "viewport", thing.hidden == "render"
    if thing.hidden == "eye":
        obj.hide_set(True)


# Nodes.


def _image(folder: Path, name: str, width: int = 7, height: int = 5) -> bpy.types.Image:
    image = bpy.data.images.new(name, width, height, float_buffer=True)
    image.pixels.foreach_set(np.random.default_rng(width).random(4 * width * height).astype(np.float32))
    image.pack()
    return image


def _missing(folder: Path) -> bpy.types.Image:
    image = bpy.data.images.new("Missing", 4, 4)
    image.source, image.filepath = "FILE", str(folder / "missing.png")
    return image


def _feed(
    tree: bpy.types.NodeTree, kind: str, output: int | str, socket: bpy.types.NodeSocket
) -> bpy.types.Node:
    """Link a new node's output to an input."""
    node = tree.nodes.new(kind)
    tree.links.new(node.outputs[output], socket)
    return node


def _surface(kind: str, name: str, folder: Path) -> bpy.types.Material:
    surface = bpy.data.materials.new(name)
    tree = part("operators.compat").new_node_tree(surface)
    output, principled = tree.nodes["Material Output"], tree.nodes["Principled BSDF"]
    colour = principled.inputs["Base Color"]
    colour.default_value = (0.7, 0.5, 0.3, 1)
    if kind in _SHADERS:
        _SHADERS[kind](tree, output.inputs["Surface"])
    elif kind in _COLOURS:
        _COLOURS[kind](tree, colour, folder)
    elif kind == "no output":
        tree.nodes.remove(output)
    elif kind == "muted":
        principled.mute = True
    elif kind == "volume":
        _feed(tree, "ShaderNodeVolumePrincipled", 0, output.inputs["Volume"])
    elif kind == "backfacing":
        surface.use_backface_culling = True
        _feed(tree, "ShaderNodeNewGeometry", "Backfacing", colour)
    return surface


def _emission(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket) -> None:
    node = _feed(tree, "ShaderNodeEmission", 0, socket)
    node.inputs["Strength"].default_value = 3.0


def _combined(kind: str, inputs: tuple[int, int]) -> Callable:
    """Return a function that adds a shader which combines two others."""

    def feed(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket) -> None:
        node = _feed(tree, kind, 0, socket)
        _emission(tree, node.inputs[inputs[0]])
        _feed(tree, "ShaderNodeBsdfDiffuse", 0, node.inputs[inputs[1]])

    return feed


def _group_shader(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket) -> None:
    group = bpy.data.node_groups.new("Shader group", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    _feed(group, "ShaderNodeBsdfDiffuse", 0, group.nodes.new("NodeGroupOutput").inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], socket)


_SHADERS: dict[str, Callable] = {
    "diffuse": lambda tree, socket: _feed(tree, "ShaderNodeBsdfDiffuse", 0, socket),
    "emission": _emission,
    "transparent": lambda tree, socket: _feed(tree, "ShaderNodeBsdfTransparent", 0, socket),
    "glass": lambda tree, socket: _feed(tree, "ShaderNodeBsdfGlass", 0, socket),
    "holdout": lambda tree, socket: _feed(tree, "ShaderNodeHoldout", 0, socket),
    "mix": _combined("ShaderNodeMixShader", (1, 2)),
    "add": _combined("ShaderNodeAddShader", (0, 1)),
    "mix of nothing": lambda tree, socket: _feed(tree, "ShaderNodeMixShader", 0, socket),
    "group": _group_shader,
    "nothing": lambda tree, socket: tree.links.remove(socket.links[0]),
}


def _image_colour(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> bpy.types.Node:
    node = _feed(tree, "ShaderNodeTexImage", "Color", socket)
    node.image = _image(folder, "Picture")
    return node


def _mapped(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> None:
    picture = _image_colour(tree, socket, folder)
    mapping = _feed(tree, "ShaderNodeMapping", 0, picture.inputs["Vector"])
    mapping.inputs["Scale"].default_value = (3, -2, 0)
    _feed(tree, "ShaderNodeUVMap", 0, mapping.inputs["Vector"]).uv_map = "UVMap"


def _normal_image(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> None:
    bump = _feed(tree, "ShaderNodeNormalMap", 0, socket.node.inputs["Normal"])
    _image_colour(tree, bump.inputs["Color"], folder)


def _missing_image(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> None:
    _feed(tree, "ShaderNodeTexImage", "Color", socket).image = _missing(folder)


def _attribute(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> None:
    node = _feed(tree, "ShaderNodeAttribute", "Color", socket)
    node.attribute_type, node.attribute_name = "OBJECT", "color"


def _vertex_colour(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, folder: Path) -> None:
    _feed(tree, "ShaderNodeVertexColor", "Color", socket).layer_name = "Colour"


_COLOURS: dict[str, Callable] = {
    "image": _image_colour,
    "image and mapping": _mapped,
    "normal image": _normal_image,
    "missing image": _missing_image,
    "noise": lambda tree, socket, folder: _feed(tree, "ShaderNodeTexNoise", 0, socket),
    "vertex colour": _vertex_colour,
    "object info": lambda tree, socket, folder: _feed(tree, "ShaderNodeObjectInfo", "Random", socket),
    "attribute": _attribute,
    "geometry": lambda tree, socket, folder: _feed(tree, "ShaderNodeNewGeometry", "Position", socket),
    "light path": lambda tree, socket, folder: _feed(tree, "ShaderNodeLightPath", "Ray Length", socket),
}


def _lamp(lamp: Lamp, name: str, folder: Path) -> None:
    light = bpy.data.lights.new(name, lamp.kind)
    light.energy = lamp.energy
    if lamp.kind == "AREA":
        light.size = lamp.size
        light.cycles.is_portal = lamp.portal
    elif lamp.kind != "SUN":
        light.shadow_soft_size = lamp.size
    obj = bpy.data.objects.new(name, light)
    obj.location, obj.scale = lamp.location, lamp.scale
    bpy.context.scene.collection.objects.link(obj)
    if lamp.nodes != "none":
        if light.node_tree is None:
            light.use_nodes = True
        _lamp_nodes(lamp.nodes, light.node_tree, folder)


def _lamp_nodes(kind: str, tree: bpy.types.NodeTree, folder: Path) -> None:
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    colour, strength = emission.inputs["Color"], emission.inputs["Strength"]
    if kind == "blackbody":
        _feed(tree, "ShaderNodeBlackbody", 0, colour)
    elif kind == "IES":
        text = bpy.data.texts.new("Profile")
        text.write(_IES)
        _feed(tree, "ShaderNodeTexIES", 0, strength).ies = text
    elif kind == "falloff":
        _feed(tree, "ShaderNodeLightFalloff", "Linear", strength)
    elif kind == "noise":
        _feed(tree, "ShaderNodeTexNoise", 0, strength)
    elif kind == "image":
        _image_colour(tree, colour, folder)
    elif kind == "no output":
        tree.nodes.remove(next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputLight"))


def _world(kind: str, folder: Path) -> None:
    if kind == "none":
        return
    world = bpy.context.scene.world = bpy.data.worlds.new("Surroundings")
    tree = part("operators.compat").new_node_tree(world)
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    colour = background.inputs["Color"]
    if kind in {"image", "odd image"}:
        size = (16, 8) if kind == "image" else (601, 300)
        _feed(tree, "ShaderNodeTexEnvironment", 0, colour).image = _image(folder, "Panorama", *size)
    elif kind == "missing image":
        _feed(tree, "ShaderNodeTexEnvironment", 0, colour).image = _missing(folder)
    elif kind == "sky":
        _feed(tree, "ShaderNodeTexSky", 0, colour)
    elif kind == "noise":
        _feed(tree, "ShaderNodeTexNoise", 0, colour)
    elif kind == "no output":
        tree.nodes.remove(next(node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputWorld"))
