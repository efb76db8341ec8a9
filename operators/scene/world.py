"""World nodes -> constant radiance of the surroundings."""

from __future__ import annotations

import bpy
import numpy as np

from ..compat import node_tree
from .materials import ShaderReader


def read_world(world: bpy.types.World | None, notes: list[str]) -> np.ndarray:
    """Return the radiance of a world, (3,) float32: Background colour times strength.

    Sentences about what could not be taken over are appended to `notes`.
    """
    if world is None:
        return np.zeros(3, np.float32)
    tree = node_tree(world)
    if tree is None:
        return np.array(world.color, np.float32)[:3]
    output = tree.get_output_node("CYCLES")
    if output is None:
        return np.zeros(3, np.float32)
    reader = ShaderReader(f"World '{world.name}'", notes)
    return np.maximum(reader.surface(output.inputs["Surface"]).emission, 0).astype(np.float32)
