"""Glossy light, which bakes spread evenly: the albedo of metals and Glossy BSDFs.

The albedo is the energy that Cycles' microfacet closures reflect under uniform light. Sources: Turquin 2019,
*Practical multiple scattering compensation for microfacet models* (Cycles, closure/bsdf_microfacet.h) for
multiple scattering; Schlick 1994 for the Fresnel term, whose hemispherical mean is F0 + (1 - F0) / 21.
"""

from __future__ import annotations

import bpy
import numpy as np

from .socket_math import Operand, SocketMath

#: Closures that reflect their color glossily, without a Fresnel term.
GLOSSY = frozenset({"ShaderNodeBsdfGlossy", "ShaderNodeBsdfAnisotropic"})
METALLIC = "ShaderNodeBsdfMetallic"

#: Coefficients of R^3 and R^4 in the energy that GGX without multiple scattering loses at roughness R; a fit
#: to its hemispherical mean, with an error of 0.01.
_LOSS = (1.4135, -0.8159)

_FRESNEL_MEAN = 1 / 21


def metal_albedo(color: np.ndarray, roughness: float, keeps_energy: bool) -> np.ndarray:
    """Return the albedo of a metal, (3,) float64, from its color at normal incidence, (3,)."""
    return glossy_albedo(color + (1 - color) * _FRESNEL_MEAN, roughness, keeps_energy)


def glossy_albedo(color: np.ndarray, roughness: float, keeps_energy: bool) -> np.ndarray:
    """Return the albedo of a glossy closure, (3,) float64: F E / (1 - F (1 - E)), or F E.

    color:         (3,) float64, F
    keeps_energy:  True with multiple scattering
    """
    loss = roughness**3 * (_LOSS[0] + _LOSS[1] * roughness)
    single = color * (1 - loss)
    return single / (1 - color * loss) if keeps_energy else single


def keeps_energy(node: bpy.types.Node) -> bool:
    """Return True if a closure scatters light several times between microfacets."""
    return node.distribution == "MULTI_GGX"


def glossy_nodes(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return `glossy_albedo` of a Glossy BSDF."""
    return _albedo(math, node, math.clamp(node.inputs["Color"]))


def metal_nodes(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return `metal_albedo` of a Principled or Metallic BSDF."""
    color = _metal_color(math, node)
    mean = math.multiply(math.complement(color), _FRESNEL_MEAN)
    return _albedo(math, node, math.add(color, mean))


def conductor_color(ior: np.ndarray, extinction: np.ndarray) -> np.ndarray:
    """Return the reflectance of a conductor at normal incidence: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2)."""
    return ((ior - 1) ** 2 + extinction**2) / ((ior + 1) ** 2 + extinction**2)


def _metal_color(math: SocketMath, node: bpy.types.Node) -> Operand:
    """Return the color of a metal at normal incidence."""
    if not is_conductor(node):
        return math.clamp(node.inputs["Base Color"])
    ior, extinction = node.inputs["IOR"], node.inputs["Extinction"]
    squares = [_square(math, math.add(ior, sign)) for sign in (-1.0, 1.0)]
    lower, upper = (math.add(square, _square(math, extinction)) for square in squares)
    return math.divide(lower, upper)


def _square(math: SocketMath, value: Operand) -> Operand:
    return math.multiply(value, value)


def is_conductor(node: bpy.types.Node) -> bool:
    """Return True if the color of a metal follows from its refractive index."""
    return getattr(node, "fresnel_type", "") == "PHYSICAL_CONDUCTOR"


def _albedo(math: SocketMath, node: bpy.types.Node, color: Operand) -> Operand:
    roughness = math.clamp(node.inputs["Roughness"])
    slope = math.add(_LOSS[0], math.multiply(_LOSS[1], roughness))
    loss = math.multiply(_square(math, roughness), roughness, slope)
    single = math.multiply(color, math.complement(loss))
    if not keeps_energy(node):
        return single
    return math.divide(single, math.complement(math.multiply(color, loss)))
