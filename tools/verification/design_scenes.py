"""Scenes whose light differs by design: rooms behind glass, smooth metal, dense hair."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy
import numpy as np

from tools.headless import ROOT
from tools.verification.material_scenes import closure
from tools.verification.scenes import ROOMS, SCENES, add, box, floor, lamp, material, open_blend, scene, world

#: Openings of the windows of living_room: from and to, m.
_WINDOWS = (((-3.4, -2.255, 1.1), (-0.6, -2.245, 3.4)), ((0.6, -2.255, 1.1), (3.4, -2.245, 3.4)))

#: Width by which panes reach into their frames, m.
_INTO_FRAME = 0.01


def register_rooms(folder: Path) -> None:
    """Register the living room of a folder with closed panes in its windows."""
    if (folder / "living_room.blend").exists():
        SCENES["living_room_glass"] = lambda: _living_room_glass(folder / "living_room.blend")
        ROOMS["living_room_glass"] = (256, 64)


def _living_room_glass(path: Path) -> None:
    """The living room with closed slabs of glass in its windows, and a sky without a sun."""
    open_blend(path)
    glass = closure("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45)
    inset = np.array((_INTO_FRAME, 0, _INTO_FRAME))
    for low, high in _WINDOWS:
        _pane(glass, low - inset, high + inset)
    _sunless_sky()


def _pane(surface: bpy.types.Material, low: np.ndarray, high: np.ndarray) -> None:
    """Add a closed slab without a lightmap."""
    pane = add("Pane", bpy.ops.mesh.primitive_cube_add, surface, size=1, location=(low + high) / 2)
    pane.scale, pane.hemibake.role = high - low, "NO_LIGHTMAP"


def _sunless_sky() -> None:
    """Make a Sky Texture without a sun disc the world."""
    tree = world(strength=0.2).node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    types = {item.identifier for item in sky.bl_rna.properties["sky_type"].enum_items}
    sky.sky_type = "SINGLE_SCATTERING" if "SINGLE_SCATTERING" in types else "NISHITA"
    sky.sun_disc, sky.sun_elevation, sky.sun_rotation = False, math.radians(35), math.radians(200)
    tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])


@scene
def interior_glass() -> None:
    """The furnished room of the gallery, whose window has a closed pane, by the light of its sky."""
    sys.path.insert(0, str(ROOT / "examples"))
    from gallery_scenes import interior

    interior.build()
    for obj in [obj for obj in bpy.data.objects if obj.type == "LIGHT" and obj.data.type == "SUN"]:
        bpy.data.objects.remove(obj)


ROOMS["interior_glass"] = (256, 32)


def _metal_room(roughness: float) -> None:
    """A closed room of metal, whose lamp also lights a floor and a box of plaster."""
    metal = material("Metal", (0.8, 0.75, 0.7), Metallic=1.0, Roughness=roughness)
    walls = add("Walls", bpy.ops.mesh.primitive_cube_add, metal, size=3, location=(0, 0, 1.5))
    walls.data.flip_normals()
    plaster = material("Plaster")
    add("Ground", bpy.ops.mesh.primitive_plane_add, plaster, size=2.98, location=(0, 0, 0.01))
    box(material("Box", (0.7, 0.3, 0.2)), (0.5, 0.3, 0.35))
    lamp("AREA", (0, 0, 2.9), (0, 0.001, 0), energy=50, shape="SQUARE", size=0.7)


def _metal_beside_wall(roughness: float) -> None:
    """A sheet of metal that the sun lights from above, beside a wall that it lights no more."""
    _sheet_and_wall(roughness)
    lamp("SUN", (0, 0.15, 3), (0, 0, 0), energy=3.0, angle=0.05)


def _metal_before_wall(roughness: float) -> None:
    """A sheet of metal that mirrors the sun towards a wall, which a black screen shades."""
    _sheet_and_wall(roughness)
    black = material("Black", (0.0, 0.0, 0.0))
    screen = add("Screen", bpy.ops.mesh.primitive_plane_add, black, size=4, location=(0, -2, 6))
    screen.rotation_euler.x, screen.hemibake.role = math.pi / 2, "NO_LIGHTMAP"
    lamp("SUN", (0, -3, 3), (0, 0, 0), energy=3.0, angle=0.05)


def _sheet_and_wall(roughness: float) -> None:
    """Add a sheet of metal that fills half the view of a wall."""
    metal = material("Metal", (0.8, 0.75, 0.7), Metallic=1.0, Roughness=roughness)
    add("Sheet", bpy.ops.mesh.primitive_plane_add, metal, size=4)
    wall = add("Wall", bpy.ops.mesh.primitive_plane_add, material("Wall"), size=4, location=(0, 2.0, 2.01))
    wall.rotation_euler.x = math.pi / 2


@scene
def dense_fur() -> None:
    """A floor below a plate of dense curls."""
    _fur(6000, 0.004, (0.3, 0.2, 0.12))


@scene
def black_fur() -> None:
    """A floor below a plate of dense curls that are black and thick."""
    _fur(3000, 0.012, (0.01, 0.01, 0.01))


def _fur(count: int, radius: float, color: tuple[float, float, float]) -> None:
    """Add a floor, and strands of 0.4 m above 1.8 x 1.8 m of it, in the light of sun and sky."""
    floor()
    data = bpy.data.hair_curves.new("Fur")
    data.add_curves([5] * count)
    step, random = np.arange(5) / 4, np.random.default_rng(3)
    roots, bend = random.uniform(-0.9, 0.9, (count, 2)), random.uniform(-0.3, 0.3, (count, 2))
    points = np.zeros((count, 5, 3), np.float32)
    points[..., :2] = roots[:, None] + bend[:, None] * step[:, None] ** 2
    points[..., 2] = 0.2 + 0.4 * step
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    attribute.data.foreach_set("value", np.full(5 * count, radius, np.float32))
    data.materials.append(material("Strands", color))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Fur", data))
    lamp("SUN", energy=2.5, angle=0.1)
    world(strength=0.4)


for _roughness in (0.3, 0.5, 1.0):
    for _kind in (_metal_room, _metal_beside_wall, _metal_before_wall):
        _name = f"{_kind.__name__[1:]}_{_roughness:g}"
        SCENES[_name] = lambda kind=_kind, roughness=_roughness: kind(roughness)
