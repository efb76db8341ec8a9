"""Every difference between Blender's versions."""

from __future__ import annotations

import bpy
import numpy as np

#: Options of a property that holds a path which may start at the .blend (//); 4.5 introduced the flag.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

#: Handlers of what writes datablocks to a file, or brings them from another one (since 4.3).
FILE_EVENTS = [name for name in ("save_pre", "blend_import_post") if hasattr(bpy.app.handlers, name)]


def gltf_binary_data() -> type:
    """Return what Blender's glTF exporter takes for bytes of a buffer; its module was renamed after 4.2."""
    try:
        from io_scene_gltf2.io.exp.binary_data import BinaryData
    except ModuleNotFoundError:
        from io_scene_gltf2.io.exp.gltf2_io_binary_data import BinaryData
    return BinaryData


def node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """Return the shader nodes in use, or None.

    Blender 5.0 gave every material and world a node tree and deprecated `use_nodes`
    (release notes 5.0, Python API); before, the tree counts only while `use_nodes` is on.
    """
    if bpy.app.version < (5, 0, 0) and not datablock.use_nodes:
        return None
    return datablock.node_tree


def light_nodes(lamp: bpy.types.Light) -> bpy.types.NodeTree | None:
    """Return the nodes of a light that uses nodes, else None; Blender 5.3 deprecated `use_nodes`."""
    return lamp.node_tree if bpy.app.version >= (5, 3, 0) or lamp.use_nodes else None


def light_power(lamp: bpy.types.Light) -> float:
    """Return the energy of a light with its exposure (since 4.5)."""
    return float(lamp.energy) * 2.0 ** float(getattr(lamp, "exposure", 0.0))


def light_temperature(lamp: bpy.types.Light) -> np.ndarray:
    """Return the colour of a light's temperature, (3,) float64, white where it has none (before 4.5)."""
    if not getattr(lamp, "use_temperature", False):
        return np.ones(3)
    return np.array(lamp.temperature_color, np.float64)[:3]


def blackbody(temperature: float) -> np.ndarray | None:
    """Return the colour of a Blackbody node, (3,) float64; None before 4.5, where only Cycles knows."""
    lamp = bpy.data.lights.new("hemibake", "POINT")
    try:
        if not hasattr(lamp, "temperature_color"):
            return None
        lamp.use_temperature, lamp.temperature = True, temperature
        return np.array(lamp.temperature_color, np.float64)[:3]
    finally:
        bpy.data.lights.remove(lamp)


def plain_lamp(lamp: bpy.types.Light) -> bpy.types.Light:
    """Return a lamp of which nothing but shape, energy and nodes counts; a spot becomes a point."""
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
    """Make a camera equirectangular; before 5.0 that is a setting of Cycles."""
    camera.type = "PANO"
    if hasattr(camera, "panorama_type"):
        camera.panorama_type = "EQUIRECTANGULAR"
    else:
        camera.cycles.panorama_type = "EQUIRECTANGULAR"


def new_node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """Return the node tree of a new datablock, made where Blender does not make it (before 5.0)."""
    if bpy.app.version < (5, 0, 0):
        datablock.use_nodes = True
    return datablock.node_tree


def multiplies_by_alpha(image: bpy.types.Image) -> bool:
    """Return True if Cycles multiplies an image's colours by its alpha, which belongs to them.

    Before 5.2 it does so for byte images, since then for the alpha mode Straight (measured in 4.2, 5.0, 5.2).
    """
    return image.alpha_mode == "STRAIGHT" if bpy.app.version >= (5, 2, 0) else not image.is_float


def node_input(node: bpy.types.Node, *names: str) -> bpy.types.NodeSocket | None:
    """Return the first input with one of the names: sockets were renamed over the years."""
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None:
            return socket
    return None
