"""Differences between Blender versions."""

from __future__ import annotations

import bpy
import numpy as np

#: Options of a property for a path that may be relative to the .blend (//); the flag exists since 4.5.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

#: Handlers for writing datablocks to a file, and for bringing them from another file (since 4.3).
FILE_EVENTS = [name for name in ("save_pre", "blend_import_post") if hasattr(bpy.app.handlers, name)]


def gltf_binary_data() -> type:
    """Return the glTF exporter's type for bytes of a buffer; its module was renamed after 4.2."""
    try:
        from io_scene_gltf2.io.exp.binary_data import BinaryData
    except ModuleNotFoundError:
        from io_scene_gltf2.io.exp.gltf2_io_binary_data import BinaryData
    return BinaryData


def node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """Return the shader node tree of a datablock if it uses nodes, else None.

    Blender 5.0 gave each material and world a node tree and deprecated `use_nodes` (release notes 5.0, Python
    API). Before, the tree is used only if `use_nodes` is on.
    """
    if bpy.app.version < (5, 0, 0) and not datablock.use_nodes:
        return None
    return datablock.node_tree


def light_nodes(lamp: bpy.types.Light) -> bpy.types.NodeTree | None:
    """Return the nodes of a light that uses nodes, else None; Blender 5.3 deprecated `use_nodes`."""
    return lamp.node_tree if bpy.app.version >= (5, 3, 0) or lamp.use_nodes else None


def light_power(lamp: bpy.types.Light) -> float:
    """Return the power of a light with its exposure (since 4.5)."""
    return float(lamp.energy) * 2.0 ** float(getattr(lamp, "exposure", 0.0))


def light_temperature(lamp: bpy.types.Light) -> np.ndarray:
    """Return the colour of a light's temperature, (3,) float64; white without one (before 4.5)."""
    if not getattr(lamp, "use_temperature", False):
        return np.ones(3)
    return np.array(lamp.temperature_color, np.float64)[:3]


def blackbody(temperature: float) -> np.ndarray | None:
    """Return the colour of a Blackbody node, (3,) float64; None before 4.5, where only Cycles computes it."""
    lamp = bpy.data.lights.new("hemibake", "POINT")
    try:
        if not hasattr(lamp, "temperature_color"):
            return None
        lamp.use_temperature, lamp.temperature = True, temperature
        return np.array(lamp.temperature_color, np.float64)[:3]
    finally:
        bpy.data.lights.remove(lamp)


def plain_lamp(lamp: bpy.types.Light) -> bpy.types.Light:
    """Reset all properties of a light except shape, energy and nodes; a spot becomes a point light."""
    lamp.animation_data_clear()
    if lamp.type == "SPOT":
        lamp.type = "POINT"
        lamp = lamp.type_recast()
    plain = {
        "color": (1, 1, 1), "exposure": 0, "use_temperature": False, "normalize": True, "use_shadow": False,
        "shadow_soft_size": 0, "spread": np.pi, "angle": 0,
    }  # fmt: skip
    for name, value in plain.items():
        if hasattr(lamp, name):
            setattr(lamp, name, value)
    return lamp


def set_panorama(camera: bpy.types.Camera) -> None:
    """Make a camera equirectangular; before 5.0 this is a setting of Cycles."""
    camera.type = "PANO"
    if hasattr(camera, "panorama_type"):
        camera.panorama_type = "EQUIRECTANGULAR"
    else:
        camera.cycles.panorama_type = "EQUIRECTANGULAR"


def new_node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """Return the node tree of a new datablock; before 5.0 it must be created."""
    if bpy.app.version < (5, 0, 0):
        datablock.use_nodes = True
    return datablock.node_tree


def remove_scene(scene: bpy.types.Scene) -> None:
    """Remove a scene; `scenes.remove` crashes in 4.3 without a window, as in `blender -b FILE -c`."""
    bpy.data.batch_remove([scene])


def multiplies_by_alpha(image: bpy.types.Image) -> bool:
    """Return True if Cycles multiplies an image's colours by its alpha.

    Before 5.2 it does so for byte images, since then for the alpha mode Straight (measured in 4.2, 5.0, 5.2).
    """
    return image.alpha_mode == "STRAIGHT" if bpy.app.version >= (5, 2, 0) else not image.is_float


def node_input(node: bpy.types.Node, *names: str) -> bpy.types.NodeSocket | None:
    """Return the first input with one of the names, since sockets were renamed between versions."""
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None:
            return socket
    return None
