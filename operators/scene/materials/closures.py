"""Closures: transmittance, reflectance, diffuse transmission and emission of each shader node.

The formulas follow Cycles (scene/shader_nodes.cpp, kernel/svm/closure.h) at normal incidence and were
compared with its passes in Blender 4.3 to 5.3. Closures without a rule are black in all four quantities.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import bpy
import numpy as np

from ....engine.scene.transmission import Fresnel
from ...compat import node_input
from .gloss import GLOSSY, METALLIC, glossy_nodes, metal_nodes
from .rough_diffuse import diffuse_roughness, rough_nodes
from .socket_math import Operand, SocketMath
from .tree_nodes import used_nodes

#: The quantities of a surface that evaluations of its node tree return. "glass" is the part of "through" that
#: falls with the angle of incidence.
QUANTITIES = ("reflect", "emit", "through", "transmit", "glass")

PRINCIPLED, MIX, ADD = "ShaderNodeBsdfPrincipled", "ShaderNodeMixShader", "ShaderNodeAddShader"
GLASS, REFRACTION = "ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"

#: Smallest Fresnel reflectance of glass that reflects light. The opaque fraction of glass would otherwise be
#: too small for the engine, see `engine_materials.MAX_SHARED`.
LEAST_MIRROR = 1 / 64

#: Index of refraction where nodes determine it: Blender's default.
_DEFAULT_IOR = 1.5

#: Closures that emit light.
EMITTERS = frozenset({"ShaderNodeEmission", "ShaderNodeBackground"})

#: Closures with neither diffuse light nor straight-through transmittance.
DARK = frozenset({
    "ShaderNodeBsdfSheen", "ShaderNodeBsdfVelvet", "ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled",
    "ShaderNodeHoldout", "ShaderNodeBsdfRayPortal", "ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter",
    "ShaderNodeVolumePrincipled", "ShaderNodeVolumeCoefficients",
})  # fmt: skip

#: Closures for hair strands; on a mesh they have almost no diffuse light.
_HAIR = frozenset({"ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled"})

Rule = Callable[[SocketMath, bpy.types.Node], Operand]


def closure_rule(node: bpy.types.Node, quantity: str, glass: bool) -> Rule | None:
    """Return the formula of a quantity of a closure; None if the quantity is 0.

    glass:  True if refracting closures transmit light without refraction
    """
    if quantity == "through":
        return (_THROUGH | _GLASS if glass else _THROUGH).get(node.bl_idname)
    if quantity == "glass":
        return _FALLING.get(node.bl_idname) if glass else None
    if quantity == "reflect" and glass and _mirrors(node):
        return _MIRRORS[node.bl_idname]
    return _RULES[quantity].get(node.bl_idname)


def closure_quantities(node: bpy.types.Node, glass: bool) -> Iterable[str]:
    """Yield the quantities of a closure that can differ from 0."""
    if node.bl_idname in EMITTERS and all(_is_not_black(node.inputs[name]) for name in ("Color", "Strength")):
        yield "emit"
    for quantity in QUANTITIES:
        if closure_rule(node, quantity, glass) and (
            node.bl_idname != PRINCIPLED or _principled_has(node, quantity, glass)
        ):
            yield quantity


def is_glass(node: bpy.types.Node) -> bool:
    """Return True if a node refracts light."""
    if node.bl_idname == PRINCIPLED:
        return _is_positive(_transmission(node)) and not _is_thin(node)
    return node.bl_idname in {GLASS, REFRACTION}


def passes_glass(node: bpy.types.Node) -> bool:
    """Return True if the transmittance of a closure decreases with the angle of incidence."""
    return node.bl_idname == GLASS or (node.bl_idname == PRINCIPLED and _is_positive(_transmission(node)))


def passes_evenly(node: bpy.types.Node) -> bool:
    """Return True if a closure transmits light straight through, equally at all angles of incidence."""
    if node.bl_idname == PRINCIPLED:
        return node.inputs["Alpha"].is_linked or node.inputs["Alpha"].default_value < 1
    return node.bl_idname in {REFRACTION, "ShaderNodeBsdfTransparent"}


def refractive_index(node: bpy.types.Node) -> float | None:
    """Return the constant IOR of a closure of glass; None if nodes determine it."""
    ior = node.inputs["IOR"]
    return None if ior.is_linked else max(float(ior.default_value), 1e-5)


def crossed_faces(node: bpy.types.Node) -> float:
    """Return the number of glass faces that light crosses at a closure of glass: 2 for thin walls."""
    return 2.0 if _is_thin(node) else 1.0


def glass_fresnel(tree: bpy.types.NodeTree | None) -> Fresnel | None:
    """Return the loss of light with the angle of incidence, for the mean IOR of a tree's glass closures.

    All glass counts as thin walls if every closure of glass is one. None without glass.
    """
    nodes = [node for node in used_nodes(tree) if passes_glass(node)]
    if not nodes:
        return None
    indices = [refractive_index(node) or _DEFAULT_IOR for node in nodes]
    return Fresnel(float(np.mean(indices)), faces=min(map(crossed_faces, nodes)))


def has_refraction(tree: bpy.types.NodeTree | None) -> bool:
    """Return True if a tree has Refraction closures, whose light has no Fresnel loss in bakes."""
    return any(node.bl_idname == REFRACTION for node in used_nodes(tree))


def _mirrors(node: bpy.types.Node) -> bool:
    """Return True if a closure is glass that reflects enough light for the engine."""
    if not passes_glass(node):
        return False
    ior = refractive_index(node)
    return ior is None or ((ior - 1) / (ior + 1)) ** 2 >= LEAST_MIRROR


def may_emit(node: bpy.types.Node) -> bool:
    """Return True if a closure can emit light."""
    return "emit" in closure_quantities(node, glass=True)


def is_hair(node: bpy.types.Node) -> bool:
    """Return True if a node is a closure of strands."""
    return node.bl_idname in _HAIR


def passes_shaders(node: bpy.types.Node) -> bool:
    """Return True if a node passes shaders on: Mix Shader, Add Shader, group or reroute nodes."""
    is_group = hasattr(node, "node_tree") or node.bl_idname == "NodeGroupInput"
    return is_group or any(socket.type == "SHADER" for socket in node.inputs)


def is_unknown(node: bpy.types.Node) -> bool:
    """Return True if a node is a closure without a rule here; closures known to be black have one."""
    if passes_shaders(node) or not any(output.type == "SHADER" for output in node.outputs):
        return False
    return not any(node.bl_idname in rules for rules in (DARK, EMITTERS, _THROUGH, _GLASS, *_RULES.values()))


def _principled_has(node: bpy.types.Node, quantity: str, glass: bool) -> bool:
    if quantity == "emit":
        color = node_input(node, "Emission Color", "Emission")
        return _is_not_black(color) and _is_not_black(node.inputs["Emission Strength"])
    if quantity == "transmit":
        return _is_thin(node) and _is_positive(_subsurface(node))
    if quantity == "glass":
        return passes_glass(node)
    if quantity == "through":
        alpha = node.inputs["Alpha"]
        see_through = alpha.is_linked or alpha.default_value < 1
        return see_through or (glass and _is_positive(_transmission(node)))
    return True


def _is_not_black(socket: bpy.types.NodeSocket) -> bool:
    """Return False if an input is the constant 0 or black."""
    return socket.is_linked or bool(np.any(np.atleast_1d(socket.default_value)[:3]))


def _is_positive(socket: bpy.types.NodeSocket | None) -> bool:
    """Return True if an input exists and may be above 0."""
    return socket is not None and (socket.is_linked or socket.default_value > 0)


def _is_thin(node: bpy.types.Node) -> bool:
    return _is_positive(node_input(node, "Thin Wall"))


def _transmission(node: bpy.types.Node) -> bpy.types.NodeSocket | None:
    return node_input(node, "Transmission Weight", "Transmission")


def _subsurface(node: bpy.types.Node) -> bpy.types.NodeSocket | None:
    return node_input(node, "Subsurface Weight", "Subsurface")


def _operand(socket: bpy.types.NodeSocket | None) -> Operand:
    """Return an input as operand; 0 if this version of Blender lacks it."""
    return 0.0 if socket is None else socket


def _color(math: SocketMath, node: bpy.types.Node) -> Operand:
    return node.inputs["Color"]


def _rough(math: SocketMath, node: bpy.types.Node, name: str = "Color") -> Operand:
    """Return the albedo of a diffuse closure, whose color is the input of a name."""
    color, roughness = math.positive(node.inputs[name]), diffuse_roughness(node)
    return color if roughness is None else rough_nodes(math, color, roughness)


def _glass(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return color * (1 - F)."""
    return math.multiply(node.inputs["Color"], math.window(node.inputs["IOR"]))


def _dielectric(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the dielectric fraction of the Principled BSDF: alpha * (1 - metallic)."""
    metallic = math.clamp(node.inputs["Metallic"])
    return math.multiply(math.clamp(node.inputs["Alpha"]), math.complement(metallic))


def _diffuse(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the diffuse albedo of the Principled BSDF, reflected and transmitted together."""
    opaque = math.complement(math.clamp(_operand(_transmission(node))))
    return math.multiply(_dielectric(math, node), opaque, _rough(math, node, "Base Color"))


def _forward(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the fraction of the diffuse albedo that leaves a thin wall on the other side (Blender 5.2)."""
    anisotropy = math.add(1.0, _operand(node_input(node, "Subsurface Anisotropy")))
    weight = math.clamp(_operand(_subsurface(node)))
    return math.multiply(_operand(node_input(node, "Thin Wall")), weight, math.multiply(anisotropy, 0.5))


def _principled_reflect(math: SocketMath, node: bpy.types.Node) -> Operand:
    diffuse = _diffuse(math, node)
    if _is_thin(node):
        diffuse = math.multiply(diffuse, math.complement(_forward(math, node)))
    metallic = node.inputs["Metallic"]
    if not _is_positive(metallic):
        return diffuse
    metal = math.multiply(math.clamp(node.inputs["Alpha"]), math.clamp(metallic), metal_nodes(math, node))
    return math.add(diffuse, metal)


def _principled_mirror(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the diffuse and metallic reflectance, and the light that glass reflects at normal incidence."""
    weight = math.multiply(_dielectric(math, node), math.clamp(_operand(_transmission(node))))
    reflected = math.complement(math.window(node.inputs["IOR"]))
    return math.add(_principled_reflect(math, node), math.multiply(weight, reflected))


def _glass_mirror(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return color * F."""
    return math.multiply(node.inputs["Color"], math.complement(math.window(node.inputs["IOR"])))


def _principled_transmit(math: SocketMath, node: bpy.types.Node) -> Operand:
    return math.multiply(_diffuse(math, node), _forward(math, node))


def _principled_emit(math: SocketMath, node: bpy.types.Node) -> Operand:
    color = node_input(node, "Emission Color", "Emission")
    return math.multiply(math.clamp(node.inputs["Alpha"]), color, node.inputs["Emission Strength"])


def _principled_hole(math: SocketMath, node: bpy.types.Node) -> Operand:
    return math.complement(math.clamp(node.inputs["Alpha"]))


def _principled_through(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return 1 - alpha plus glass."""
    hole = _principled_hole(math, node)
    return math.add(hole, _principled_glass(math, node)) if passes_glass(node) else hole


def _principled_glass(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the light through glass: sqrt(base) (1 - F), or base (1 - F)^2 for a thin wall."""
    if not passes_glass(node):
        return 0.0
    window, base = math.window(node.inputs["IOR"]), math.clamp(node.inputs["Base Color"])
    glass = math.multiply(math.square_root(base), window)
    if _is_thin(node):
        thin = node_input(node, "Thin Wall")
        sheet = math.multiply(thin, base, window, window)
        glass = math.add(math.multiply(math.complement(thin), glass), sheet)
    return math.multiply(_dielectric(math, node), math.clamp(_operand(_transmission(node))), glass)


_THROUGH: dict[str, Rule] = {"ShaderNodeBsdfTransparent": _color, PRINCIPLED: _principled_hole}
_GLASS: dict[str, Rule] = {REFRACTION: _color, GLASS: _glass, PRINCIPLED: _principled_through}
_FALLING: dict[str, Rule] = {GLASS: _glass, PRINCIPLED: _principled_glass}
_MIRRORS: dict[str, Rule] = {GLASS: _glass_mirror, PRINCIPLED: _principled_mirror}
_RULES: dict[str, dict[str, Rule]] = {
    "reflect": {
        "ShaderNodeBsdfDiffuse": _rough,
        "ShaderNodeBsdfToon": _color,
        "ShaderNodeSubsurfaceScattering": _color,
        **dict.fromkeys(GLOSSY, glossy_nodes),
        METALLIC: metal_nodes,
        PRINCIPLED: _principled_reflect,
    },
    "transmit": {"ShaderNodeBsdfTranslucent": _color, PRINCIPLED: _principled_transmit},
    "emit": {PRINCIPLED: _principled_emit},
}
