"""Loss of the light through glass with the angle of incidence, for materials that Cycles evaluates."""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.scene.transmission import Fresnel
from .closures import crossed_faces, passes_glass, refractive_index
from .tree_nodes import used_nodes

#: Index of refraction where nodes determine it: that of Blender's default.
_DEFAULT_IOR = 1.5


def glass_fresnel(tree: bpy.types.NodeTree | None) -> Fresnel | None:
    """Return the loss for the mean IOR of a tree's glass closures; None without glass.

    All glass counts as thin walls if every closure of glass is one.
    """
    nodes = [node for node in used_nodes(tree) if passes_glass(node)]
    if not nodes:
        return None
    indices = [refractive_index(node) or _DEFAULT_IOR for node in nodes]
    return Fresnel(float(np.mean(indices)), faces=min(map(crossed_faces, nodes)))
