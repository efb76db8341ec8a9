"""Scenes with texels that show several surfaces. Each is built in an empty file and has a camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy

from tools.verification.renders import aim
from tools.verification.scenes import lamp, material, open_glb, world


@dataclass(frozen=True)
class View:
    """Settings of a scene's bake and picture.

    resolution:  of the lightmap, texels
    exposure:    of the picture, stops
    removed:     objects that are left out of the pictures of lightmaps
    """

    resolution: int
    exposure: float = 0.0
    removed: tuple[str, ...] = ()


#: Every scene by name.
SCENES: dict[str, Callable[[], View]] = {}


def scene(function: Callable[[], View]) -> Callable[[], View]:
    """Register a scene under its function's name."""
    SCENES[function.__name__] = function
    return function


@scene
def leak() -> View:
    """A wall of 2 cm between a lit and a dim half of a room, seen from the dim one; texels of 4 cm."""
    thin_wall()
    aim((1.5, 0.72, 0.7), (0.84, 0.3, 0.02))
    return View(128, exposure=2.2)


@scene
def contact() -> View:
    """Boxes that are 5 cm in the floor, under an even sky; texels of 8 cm."""
    grey = material("Grey")
    block("Floor", (-2, -2, -0.3), (2, 2, 0), grey)
    for index, (x, y) in enumerate(((-0.61, -0.43), (0.37, 0.11), (-0.3, 0.83))):
        block(f"Box {index}", (x, y, -0.05), (x + 0.47, y + 0.43, 0.5), grey)
    world((1, 1, 1), 0.9)
    aim((1.0, -1.35, 0.95), (0.0, 0.0, 0.05))
    return View(128)


@scene
def hidden() -> View:
    """What a floor shows where a box and a ball, taken away for the picture, stood on it."""
    grey = material("Grey")
    block("Floor", (-2, -2, -0.3), (2, 2, 0), grey)
    box = block("Box", (-0.5, -0.4, -0.05), (0.5, 0.4, 0.6), grey)
    box.location, box.rotation_euler = (-0.75, 0.2, 0), (0, 0, 0.5)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(0.8, -0.2, 0.25))
    bpy.context.object.name = "Ball"
    bpy.context.object.data.materials.append(grey)
    world((0.6, 0.75, 1), 0.5)
    lamp("POINT", (1.5, 1.4, 1.7), energy=120, shadow_soft_size=0.1)
    aim((0.4, -3.3, 3.0), (0.05, -0.1, 0))
    return View(128, removed=("Box", "Ball"))


def register_files(folder: Path) -> None:
    """Register the scenes of a folder that are there."""
    if (folder / "house.glb").exists():

        @scene
        def house() -> View:
            """A house whose charts are a few texels each and often smaller than one."""
            open_glb(folder / "house.glb", folder)
            make_diffuse()
            aim((0.3, -0.5, 0.24), (-0.01, -0.01, 0.06))
            return View(512, exposure=-1.2)


def make_diffuse() -> None:
    """Take shine and metal from all materials: lightmaps have none of it."""
    for surface in bpy.data.materials:
        for node in surface.node_tree.nodes if surface.node_tree else ():
            if node.bl_idname == "ShaderNodeBsdfPrincipled":
                for name in ("Metallic", "Specular IOR Level"):
                    for link in list(node.inputs[name].links):
                        surface.node_tree.links.remove(link)
                    node.inputs[name].default_value = 0


def thin_wall() -> None:
    """Add a wall of 2 cm between a lit and a dim half of a room."""
    grey = material("Grey")
    block("Room", (0, 0, 0), (1.6, 0.8, 0.8), grey, inside=True)
    block("Wall", (0.81, -0.03, -0.03), (0.83, 0.83, 0.83), grey)
    for position, energy in (((0.4, 0.4, 0.5), 20), ((1.3, 0.4, 0.7), 0.5)):
        lamp("POINT", position, energy=energy, shadow_soft_size=0.02)


def block(name: str, low, high, surface: bpy.types.Material, inside: bool = False) -> bpy.types.Object:
    """Add a box between two corners, seen from outside or from inside."""
    corners = [tuple((low, high)[i >> axis & 1][axis] for axis in range(3)) for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [face[::-1] if inside else face for face in faces])
    mesh.materials.append(surface)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    return obj
