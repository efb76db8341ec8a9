"""Scenes whose render has other objects or meshes than the viewport; unusual units and meshes."""

from __future__ import annotations

import math

import bpy
import numpy as np

from tools.verification.scenes import (
    GROUPS,
    ORIGINALS,
    SETTINGS,
    WORKING_SPACES,
    add,
    box,
    checker,
    floor,
    lamp,
    link_image,
    material,
    picture,
    scene,
    stage,
    world,
)


def _light() -> None:
    lamp("SUN", energy=2.5, angle=0.08)
    world(strength=0.5)


@scene
def subdivision_levels():
    """A cube that a render subdivides to a ball, without a lightmap."""
    floor()
    obj = box(None, (0.3, 0.1, 0.5))
    obj.scale, obj.hemibake.role = (1.5, 1.3, 1.2), "NO_LIGHTMAP"
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 3
    _light()


@scene
def only_in_renders():
    """A node group that makes a roof in renders alone (Is Viewport)."""
    stage()
    obj = add("Roof", bpy.ops.mesh.primitive_plane_add, material("Roof", (0.4, 0.6, 0.3)), size=1.5)
    obj.location, obj.hemibake.role = (0.2, 0, 1.2), "NO_LIGHTMAP"
    tree = bpy.data.node_groups.new("Roof", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "GeometryNodeIsViewport", "GeometryNodeSwitch", "NodeGroupOutput")
    source, viewport, switch, sink = (tree.nodes.new(name) for name in names)
    switch.input_type = "GEOMETRY"
    tree.links.new(viewport.outputs[0], switch.inputs["Switch"])
    tree.links.new(source.outputs[0], switch.inputs["False"])
    tree.links.new(switch.outputs[0], sink.inputs[0])
    obj.modifiers.new("Roof", "NODES").node_group = tree
    _light()


@scene
def eye_hidden_objects():
    """A lamp and a wall with a lightmap that the eye icon hides, and a box that renders hide."""
    stage()
    wall = add("Wall", bpy.ops.mesh.primitive_plane_add, material("Wall", (0.7, 0.2, 0.2)), size=1.4)
    wall.location, wall.rotation_euler = (-0.8, 0.3, 0.75), (0, math.pi / 2, 0.3)
    spot = lamp("SPOT", energy=150, shadow_soft_size=0.1, spot_size=1.2, spot_blend=0.3)
    block = add("Block", bpy.ops.mesh.primitive_cube_add, None, size=1, location=(0, 0, 1.4))
    block.hide_render = True
    _light()
    for obj in (wall, spot):
        obj.hide_set(True)


@scene
def nested_collections():
    """Instances of a collection with a hidden and an inner collection; a collection left out of the layer."""
    floor()
    outer, inner, hidden = (bpy.data.collections.new(name) for name in ("Outer", "Inner", "Hidden"))
    outer.children.link(inner)
    outer.children.link(hidden)
    hidden.hide_render = True
    excluded = bpy.data.collections.new("Excluded")
    bpy.context.scene.collection.children.link(excluded)
    for number, target in enumerate((inner, hidden, excluded)):
        obj = box(material(f"Box {number}", (0.7, 0.5, 0.2 + 0.2 * number)), (0, 0, 0.4 + 0.3 * number))
        bpy.context.scene.collection.objects.unlink(obj)
        target.objects.link(obj)
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True
    for number in range(3):
        instance = bpy.data.objects.new(f"Instance {number}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", outer
        instance.location, instance.hide_render = (1.2 * number - 1.1, 0.4 - 0.3 * number, 0), number == 1
        bpy.context.scene.collection.objects.link(instance)
    _light()


@scene
def scattered_objects():
    """Instances by Geometry Nodes and by particles, of objects that are hidden in renders."""
    stage()
    shapes = [
        box(material(f"Shape {number}", (0.7, 0.5, 0.2 + 0.4 * number)), (4, 4, 0)) for number in range(2)
    ]
    points = bpy.data.meshes.new("Points")
    points.from_pydata([(-0.9, 0.3, 0.7), (0.2, -0.6, 0.9), (0.8, 0.7, 0.6)], [], [])
    scatter = bpy.data.objects.new("Scatter", points)
    bpy.context.scene.collection.objects.link(scatter)
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "GeometryNodeObjectInfo", "GeometryNodeInstanceOnPoints", "NodeGroupOutput")
    source, info, place, sink = (tree.nodes.new(name) for name in names)
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = shapes[0], True
    tree.links.new(source.outputs[0], place.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], place.inputs["Instance"])
    tree.links.new(place.outputs[0], sink.inputs[0])
    scatter.modifiers.new("Scatter", "NODES").node_group = tree
    air = add("Air", bpy.ops.mesh.primitive_plane_add, None, size=1, location=(-0.5, -0.6, 1.3))
    air.show_instancer_for_render = air.show_instancer_for_viewport = False
    air.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = air.particle_systems[0].settings
    settings.type, settings.count, settings.render_type = "HAIR", 3, "OBJECT"
    settings.instance_object, settings.particle_size, settings.hair_length = shapes[1], 0.4, 1
    for shape in shapes:
        shape.hide_render = True
    _light()


@scene
def diffuse_rays_pass():
    """A roof and a glowing card that diffuse rays do not meet."""
    stage()
    roof = add("Roof", bpy.ops.mesh.primitive_plane_add, material("Roof"), size=1.6, location=(0.3, 0.2, 1.1))
    glow = material("Glow", (0, 0, 0), Emission_Color=(1, 0.5, 0.3, 1), Emission_Strength=5)
    card = add("Card", bpy.ops.mesh.primitive_plane_add, glow, size=0.8, location=(-1, 0, 0.9))
    card.rotation_euler.x = math.pi
    for obj in (roof, card):
        obj.visible_diffuse, obj.hemibake.role = False, "NO_LIGHTMAP"
    _light()


@scene
def unit_scale():
    """A stage in millimeters, with texels per meter: coordinates are 1,000 times as large."""
    stage()
    lamp("SUN", energy=2.5, angle=0.08)
    world(strength=0.5)
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = "METRIC", 0.001
    for obj in bpy.context.scene.objects:
        obj.scale = tuple(1000 * np.array(obj.scale))
        obj.location = tuple(1000 * np.array(obj.location))


SETTINGS["unit_scale"] = {"size_mode": "DENSITY", "texels_per_metre": 14.0}


@scene
def working_space():
    """A stage with an image and with colors within Rec.709, in ACEScg."""
    floor(material("Floor", (0.6, 0.35, 0.25)))
    surface = material("Box")
    link_image(surface, picture("Checker", checker(seed=3)), "Base Color")
    box(surface, (0.4, 0.2, 0.35))
    lamp("AREA", energy=60, size=0.5, color=(0.6, 0.9, 0.7))
    world((0.35, 0.45, 0.8), strength=0.4)


WORKING_SPACES["working_space"] = "ACEScg"


def _colored_room() -> None:
    """A room with walls of strong colors, open at the top, so that most light is reflected several times."""
    walls = {
        "Floor": (0.9, 0.8, 0.1),
        "Left": (0.9, 0.05, 0.02),
        "Right": (0.03, 0.85, 0.1),
        "Back": (0.1, 0.2, 0.9),
    }
    places = {
        "Floor": ((0, 0, 0), (0, 0, 0)),
        "Left": ((-1, 0, 1), (0, math.pi / 2, 0)),
        "Right": ((1, 0, 1), (0, -math.pi / 2, 0)),
        "Back": ((0, 1, 1), (math.pi / 2, 0, 0)),
    }
    for name, (location, turn) in places.items():
        options = {"size": 2, "location": location, "rotation": turn}
        add(name, bpy.ops.mesh.primitive_plane_add, material(name, walls[name]), **options)
    lamp("AREA", energy=60, size=0.5, color=(0.9, 0.7, 0.6))


@scene
def strong_colors():
    """Bounces between walls of strong colors, in ACEScg."""
    _colored_room()


@scene
def strong_colors_rec2020():
    """Bounces between walls of strong colors, in Rec.2020."""
    _colored_room()


WORKING_SPACES |= {"strong_colors": "ACEScg", "strong_colors_rec2020": "Linear Rec.2020"}


@scene
def light_group():
    """The map of a dim lamp's group, beside a bright sun, a sky and a second lamp."""
    stage()
    dim = lamp("AREA", energy=4, size=0.4, color=(1, 0.6, 0.3))
    other = lamp("POINT", location=(0.8, -0.7, 1.2), energy=90, shadow_soft_size=0.1)
    _light()
    for name in ("Dim", "Bright"):
        bpy.context.view_layer.lightgroups.add(name=name)
    dim.lightgroup, other.lightgroup = "Dim", "Bright"


GROUPS["light_group"] = "Dim"
SETTINGS["light_group"] = {"outputs": {"combined", "light_groups"}}


@scene
def collapsed_faces():
    """A floor with 2,000 faces without area, which get no texels."""
    obj = floor()
    plane, flat = obj.data, bpy.data.meshes.new("Collapsed")
    corners = [tuple(vertex.co) for vertex in plane.vertices]
    rows = np.linspace(-1.9, 1.9, 2000)
    points = [(x + step, 0.3 * x, 0.0) for x in rows for step in (0, 0.0005, 0.001)]
    faces = [(4 + 3 * row, 5 + 3 * row, 6 + 3 * row) for row in range(len(rows))]
    flat.from_pydata([*corners, *points], [], [*(tuple(face.vertices) for face in plane.polygons), *faces])
    flat.materials.append(plane.materials[0])
    obj.data = flat
    box(None, (0.4, 0.2, 0.35))
    _light()


@scene
def material_override():
    """A view layer whose override replaces the materials of all objects."""
    stage()
    black = material("Black", (0, 0, 0))
    add("Roof", bpy.ops.mesh.primitive_plane_add, black, size=1.6, location=(0.3, 0.2, 1.1))
    bpy.context.view_layer.material_override = material("Override", (0.75, 0.6, 0.45))
    _light()


@scene
def shared_objects():
    """The second of two scenes that share the stage; the first one has a lamp and a roof of its own."""
    stage()
    lamp("AREA", energy=300, shape="SQUARE", size=0.8)
    add("Roof", bpy.ops.mesh.primitive_plane_add, None, size=1.6, location=(0.3, 0.2, 1.1))
    evening = bpy.data.scenes.new("Evening")
    for name in ("Floor", "Box"):
        evening.collection.objects.link(bpy.data.objects[name])
    bpy.context.window.scene = evening
    _light()


_SEEN_IN_RENDERS = (
    "subdivision_levels", "only_in_renders", "eye_hidden_objects", "nested_collections", "scattered_objects",
    "diffuse_rays_pass", "shared_objects",
)  # fmt: skip

ORIGINALS.update(dict.fromkeys(_SEEN_IN_RENDERS, "Floor"))
