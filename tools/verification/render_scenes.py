"""Scenes that a render shows in another way than plain nodes or the viewport: a roof above the stage each."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy

from tools.verification.scenes import SCENES, add, lamp, material, stage, world


def _roof(surface: bpy.types.Material | None = None) -> bpy.types.Object:
    """Return a plane above the stage, which a sun and a sky light."""
    stage()
    world(strength=0.4)
    lamp("SUN", energy=3.0, angle=0.05)
    surface = surface or material("Roof", (0.7, 0.5, 0.3))
    return add("Roof", bpy.ops.mesh.primitive_plane_add, surface, size=1.6, location=(0.3, 0.2, 1.1))


def _shader(kind: str, **inputs: object) -> bpy.types.Material:
    """Return a material of one closure."""
    surface = material(kind)
    tree = surface.node_tree
    closure = tree.nodes.new(kind)
    for name, value in inputs.items():
        closure.inputs[name].default_value = value
    tree.links.new(closure.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return surface


def _tinted_pane() -> None:
    _roof(_shader("ShaderNodeBsdfTransparent", Color=(0.9, 0.5, 0.2, 1)))


def _culled_card() -> None:
    _roof().data.materials[0].use_backface_culling = True


def _curtain() -> None:
    _roof(_shader("ShaderNodeBsdfTranslucent", Color=(0.8, 0.7, 0.5, 1))).rotation_euler.x = math.pi


def _no_shadow() -> None:
    _roof().visible_shadow = False


def _hidden_in_viewport() -> None:
    _roof().hide_set(True)


def _render_only_modifier() -> None:
    modifier = _roof().modifiers.new("Slats", "ARRAY")
    modifier.count, modifier.show_viewport = 2, False
    modifier.relative_offset_displace = (-1.1, 0, 0)


def _camera_backdrop() -> None:
    """A roof that only camera rays see, and that emits to them."""
    surface = _shader("ShaderNodeBsdfTransparent")
    tree = surface.node_tree
    path, mix = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixShader")
    emission = tree.nodes.new("ShaderNodeEmission")
    clear = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfTransparent")
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(emission.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    _roof(surface).hemibake.role = "NO_LIGHTMAP"


_BUILDERS: dict[str, Callable[[], None]] = {
    "tinted_pane": _tinted_pane,
    "culled_card": _culled_card,
    "curtain": _curtain,
    "no_shadow": _no_shadow,
    "hidden_in_viewport": _hidden_in_viewport,
    "render_only_modifier": _render_only_modifier,
    "camera_backdrop": _camera_backdrop,
}

SCENES.update(_BUILDERS)
