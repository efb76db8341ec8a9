"""Scenes of shapes, instances and roles, and of outputs other than all light."""

from __future__ import annotations

import math

import bpy

from .stage import add, box, floor, into_collection, lamp, link, material, plane, show, smooth, stage, world


def _light() -> None:
    lamp("AREA", energy=60, shape="SQUARE", size=0.5)
    world(0.3)


def smooth_sphere() -> None:
    """Shading normals are not those of the facets."""
    floor()
    smooth(add("Ball", bpy.ops.mesh.primitive_uv_sphere_add, material("Ball"), segments=32, ring_count=16,
               radius=0.5, location=(0.2, 0.1, 0.7)))  # fmt: skip
    _light()


def shadow_terminator() -> None:
    """A coarse smooth ball in grazing sun."""
    floor()
    smooth(add("Ball", bpy.ops.mesh.primitive_ico_sphere_add, material("Ball"), subdivisions=2, radius=0.6,
               location=(0.2, 0.1, 0.7)))  # fmt: skip
    lamp("SUN", location=(-1.5, 0, 0.6), energy=3, angle=0.02)


def linked_duplicates() -> None:
    floor()
    first = box(None, (0.8, 0.5, 0.4))
    for number, place in enumerate([(-0.6, -0.4, 0.4), (-0.5, 0.8, 0.5)]):
        copy = link(bpy.data.objects.new(f"Copy {number}", first.data))
        copy.location, copy.scale = place, (1 + 0.4 * number,) * 3
    _light()


def collection_instances() -> None:
    floor()
    boxes = into_collection("Boxes", box(None, (0, 0, 0.4)))
    for number in range(3):
        show(boxes, (number - 1, 0.6 - 0.5 * number, 0), rotation_euler=(0, 0, 0.5 * number))
    _light()


def geometry_node_instances() -> None:
    """Boxes on the vertices of a plane."""
    floor()
    original = box(None, (0, 0, 0))
    original.scale = (0.6, 0.6, 0.6)
    boxes = into_collection("Boxes", original)
    carrier = plane("Carrier", None, 1.4, location=(0, 0, 0.45))
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeCollectionInfo", "NodeGroupOutput")
    source, instances, info, sink = (tree.nodes.new(name) for name in names)
    info.inputs["Collection"].default_value = boxes
    info.transform_space = "RELATIVE"
    tree.links.new(source.outputs[0], instances.inputs["Points"])
    tree.links.new(info.outputs[0], instances.inputs["Instance"])
    tree.links.new(instances.outputs[0], sink.inputs[0])
    carrier.modifiers.new("Scatter", "NODES").node_group = tree
    carrier.rotation_euler = (0, 0, 0.3)
    _light()


def scaled_and_mirrored() -> None:
    floor()
    box(None, (0.4, 0.2, 0.5), scale=(-1.4, 0.6, 0.8), rotation_euler=(0.2, 0.1, 0.5))
    _light()


def sheared() -> None:
    """A turned child of a parent of unequal scale."""
    floor()
    parent = link(bpy.data.objects.new("Parent", None))
    parent.scale, parent.location = (1.6, 0.7, 1), (0.2, 0.1, 0.1)
    box(None, (0, 0, 0.4), rotation_euler=(0.1, 0.2, 0.7)).parent = parent
    _light()


def modifiers() -> None:
    """Subdivision and Displace."""
    floor()
    obj = box(None, (0.3, 0.1, 0.55))
    obj.scale = (1.5, 1.5, 1.5)
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 2
    obj.modifiers["Subdivision"].render_levels = 2
    displace = obj.modifiers.new("Displace", "DISPLACE")
    displace.texture = bpy.data.textures.new("Clouds", "CLOUDS")
    displace.strength = 0.15
    smooth(obj)
    _light()


def curve_occluders() -> None:
    """A tube, a text and metaballs cast shadows and reflect."""
    floor()
    red = material("Red", (0.8, 0.1, 0.1))
    curve = add("Tube", bpy.ops.curve.primitive_bezier_circle_add, red, radius=0.4, location=(0.5, 0.4, 0.4))
    curve.data.bevel_depth = 0.08
    text = add("Text", bpy.ops.object.text_add, red, location=(-0.9, -0.6, 0.1), rotation_euler=(1.3, 0, 0))
    text.data.extrude = 0.05
    add("Ball", bpy.ops.object.metaball_add, red, type="BALL", radius=0.5, location=(-0.5, 0.7, 0.5))
    _light()


def roles() -> None:
    """An occluder shades and bounces; what is ignored, hidden or off in renders does neither."""
    floor()
    box().hemibake.role = "OCCLUDER"
    box(None, (-0.8, -0.6, 0.6)).hemibake.role = "IGNORED"
    box(None, (-0.8, 0.6, 0.6)).hide_render = True
    box(None, (0.8, -0.8, 0.6)).hide_set(True)
    _light()


def sunk_box() -> None:
    """Texels inside and half inside of something."""
    floor()
    box(None, (0.37, 0.21, 0.13), rotation_euler=(0, 0, 0.4))
    _light()


def far_from_origin() -> None:
    """Ten kilometres away."""
    stage()
    _light()
    for obj in bpy.context.scene.objects:
        obj.location.x += 1e4


def direct_only() -> None:
    stage()
    _light()
    bpy.context.scene.hemibake.outputs = {"direct"}


def indirect_only() -> None:
    stage()
    _light()
    bpy.context.scene.hemibake.outputs = {"indirect"}


def ambient_occlusion() -> None:
    stage()
    bpy.context.scene.hemibake.outputs = {"ambient_occlusion"}
    bpy.context.scene.hemibake.ao_distance = 0.5


SCENES = (
    smooth_sphere, shadow_terminator, linked_duplicates, collection_instances, geometry_node_instances,
    scaled_and_mirrored, sheared, modifiers, curve_occluders, roles, sunk_box, far_from_origin,
    direct_only, indirect_only, ambient_occlusion,
)  # fmt: skip
