"""Every place where Blender versions differ."""

from __future__ import annotations

import bpy

#: Options of a property that holds a path which may start at the .blend (//); 4.5 introduced the flag.
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()


def node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """Return the shader nodes in use, or None.

    Blender 5.0 gave every material and world a node tree and deprecated `use_nodes`
    (release notes 5.0, Python API); before, the tree counts only while `use_nodes` is on.
    """
    if bpy.app.version < (5, 0, 0) and not datablock.use_nodes:
        return None
    return datablock.node_tree


def new_node_tree(datablock: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree:
    """Return the node tree of a new datablock, made where Blender does not make it (before 5.0)."""
    if bpy.app.version < (5, 0, 0):
        datablock.use_nodes = True
    return datablock.node_tree


def node_input(node: bpy.types.Node, *names: str) -> bpy.types.NodeSocket | None:
    """Return the first input with one of the names: sockets were renamed over the years."""
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None:
            return socket
    return None
