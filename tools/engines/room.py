"""A room for tests of engines: lightmaps of two sizes, instances of meshes, and names that engines change."""

from __future__ import annotations

import importlib
import math
import sys
from types import ModuleType

from .cornell import ROOT

#: Widths of the lightmaps of the room, and of the atlas "Boxes", texels.
WIDTHS = (96, 64)


def bake(**outputs: object) -> None:
    """Build the room in an empty file, and bake it in draft quality.

    outputs:  settings of the scene
    """
    import bpy

    build()
    settings = bpy.context.scene.hemibake
    settings.quality = "draft"
    for name, value in outputs.items():
        setattr(settings, name, value)
    settings.resolution = WIDTHS[0]
    bpy.ops.hemibake.bake()
    boxes = [obj for obj in bpy.context.scene.objects if obj.hemibake.atlas == "Boxes" or obj.is_instancer]
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in boxes)
    bpy.context.view_layer.objects.active = boxes[0]
    settings.target, settings.resolution = "SELECTED", WIDTHS[1]
    bpy.ops.hemibake.bake()
    settings.target = "ALL"


def build() -> None:
    """Build the Cornell box in an empty file with two boxes of one mesh, and instances of a third one."""
    import bpy

    cornell_box = box_module()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    cornell_box.build()
    short, tall = bpy.data.objects["Short Box"], bpy.data.objects["Tall Box"]
    twin = bpy.data.objects.new("Box.001", short.data)
    twin.location, twin.rotation_euler, twin.scale = (-0.6, -0.5, 0), (0, 0, 0.4), (0.5, 0.5, 0.8)
    bpy.context.scene.collection.objects.link(twin)
    short.name, tall.name = 'Wall/"1":2%', "Tall-col"
    short.hemibake.atlas = twin.hemibake.atlas = "Boxes"
    _add_instances()
    bpy.data.objects["Floor"].name = "Boden.ü"
    bpy.context.view_layer.update()


def _add_instances() -> None:
    """Add a small box, and two empties that show its collection, one of them turned."""
    import bpy

    cornell_box = box_module()
    red = bpy.data.materials["Red"]
    source = cornell_box.box("Stool", red, (0.2, 0.2, 0.3), (0.75, 0.5), math.radians(10))
    collection = bpy.data.collections.new("Stools")
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.collection.objects.unlink(source)
    collection.objects.link(source)
    for place, turn in (((-0.75, -1.25, 0), 0.0), ((-0.5, -1.4, 0), 0.3)):
        empty = bpy.data.objects.new("Stool", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.rotation_euler = place, (0, 0, turn)
        bpy.context.scene.collection.objects.link(empty)


def bake_terrace(outputs: set[str]) -> dict:
    """Bake a floor with a box under a sun in an empty file; return the sun for show.gd, y up."""
    import bpy
    from mathutils import Euler, Vector

    cornell_box = box_module()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    grey = cornell_box.material("Grey", (0.5, 0.4, 0.3))
    cornell_box.wall("Floor", grey, (0, 0, 0), (0, 0, 0))
    cornell_box.box("Box", grey, (0.5, 0.5, 0.5), (0.2, 0.1), 0.3)
    cornell_box.camera()
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y
    bpy.context.scene.camera.location = (0, -3, 2.5)
    bpy.context.scene.camera.rotation_euler = (math.radians(50), 0, 0)
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.angle = 2.0, 0.0
    light = bpy.data.objects.new("Sun", data)
    light.rotation_euler = (0.4, 0.5, 0.2)
    bpy.context.scene.collection.objects.link(light)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.outputs = "draft", 128, outputs
    bpy.ops.hemibake.bake()
    x, y, z = Euler(light.rotation_euler).to_matrix() @ Vector((0, 0, -1))
    return {"energy": data.energy / math.pi, "direction": [x, z, -y]}


def bake_two_groups() -> None:
    """Bake the Cornell box, whose lamp and world are light groups, with a state Night."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    box_module().build()
    bpy.data.objects["Front Wall"].visible_shadow = bpy.data.objects["Front Wall"].visible_diffuse = False
    scene = bpy.context.scene
    for name in ("Lamp", "Sky"):
        bpy.context.view_layer.lightgroups.add(name=name)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color, scene.world.lightgroup = (0.3, 0.3, 0.3), "Sky"
    bpy.data.objects["Light"].lightgroup = "Lamp"
    settings = scene.hemibake
    settings.quality, settings.resolution, settings.outputs = "draft", 64, {"combined", "light_groups"}
    bpy.ops.hemibake.bake()
    state = settings.light_states.add()
    state.name = "Night"
    for name, color in (("Lamp", (0.2, 0.3, 0.5)), ("Sky", (0.0, 0.1, 1.0))):
        group = state.groups.add()
        group.name, group.color, group.strength = name, color, 1.5


def box_module() -> ModuleType:
    """Return the example that builds the Cornell box."""
    if (examples := str(ROOT / "examples")) not in sys.path:
        sys.path.insert(0, examples)
    return importlib.import_module("cornell_box")


def bake_twins() -> None:
    """Bake the room, in which two boxes share a mesh, with states of its lamp and of a second one."""
    import bpy

    build()
    scene = bpy.context.scene
    lamp = bpy.data.objects.new("Blue", bpy.data.lights.new("Blue", "POINT"))
    lamp.data.energy, lamp.data.color, lamp.location = 4.0, (0.6, 0.7, 1.0), (0.6, -0.6, 1.2)
    scene.collection.objects.link(lamp)
    for name, obj in (("Lamp", bpy.data.objects["Light"]), ("Blue", lamp)):
        bpy.context.view_layer.lightgroups.add(name=name)
        obj.lightgroup = name
    settings = scene.hemibake
    settings.quality, settings.resolution, settings.outputs = "draft", WIDTHS[0], {"combined", "light_groups"}
    bpy.ops.hemibake.bake()
    for name, group, strength in (("Day", "Blue", 0.0), ("Night", "Lamp", 0.3)):
        state = settings.light_states.add()
        state.name = name
        dimmed = state.groups.add()
        dimmed.name, dimmed.color, dimmed.strength = group, (1.0, 0.6, 0.4), strength
