"""Values of Light Path and Geometry nodes for one kind of ray and one side of a surface."""

from __future__ import annotations

from typing import NamedTuple

import bpy

_LIGHT_PATH, _GEOMETRY = "ShaderNodeLightPath", "ShaderNodeNewGeometry"

#: Outputs of the Light Path node that are not 0 for shadow rays, and for diffuse bounces.
_SHADOW = {"Is Shadow Ray": 1.0, "Ray Length": 1.0}
_BOUNCE = {
    "Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Depth": 1.0, "Diffuse Depth": 1.0,
    "Ray Length": 1.0,
}  # fmt: skip


class RayKind(NamedTuple):
    """Kind of ray for which a node tree is evaluated.

    shadow:  True for shadow rays to lights, False for gathered light
    back:    True if the ray hits the back of the surface
    """

    shadow: bool = False
    back: bool = False


#: Gathered light at the front. Used for reflectance and emission, and for transparency unless nodes depend on
#: the kind of ray.
BOUNCE = RayKind()


def is_by_ray(output: bpy.types.NodeSocket) -> bool:
    """Return True if the value of an output depends on the kind of ray."""
    return output.node.bl_idname == _LIGHT_PATH


def is_by_bounce(node: bpy.types.Node) -> bool:
    """Return True if a node gives other values for bounces than for samples of emissive surfaces in Cycles.

    Cycles weights both by multiple importance sampling; bakes have the values of bounces.
    """
    return node.bl_idname == _LIGHT_PATH and any(
        output.is_linked and output.name in _BOUNCE and output.name != "Ray Length" for output in node.outputs
    )


def reads_ray_depth(node: bpy.types.Node) -> bool:
    """Return True if a node counts the bounces, or transparent surfaces, of a ray."""
    return node.bl_idname == _LIGHT_PATH and any(
        output.is_linked and output.name.endswith("Depth") for output in node.outputs
    )


def is_by_side(output: bpy.types.NodeSocket) -> bool:
    """Return True if the value of an output depends on the side that a ray hits."""
    return output.node.bl_idname == _GEOMETRY and output.name == "Backfacing"


def ray_value(output: bpy.types.NodeSocket, rays: RayKind) -> float | None:
    """Return the value of an output for a kind of ray; None if it does not depend on the ray."""
    if is_by_ray(output):
        return (_SHADOW if rays.shadow else _BOUNCE).get(output.name, 0.0)
    return float(rays.back) if is_by_side(output) else None
