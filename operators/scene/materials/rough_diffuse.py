"""Rough diffuse light (Oren-Nayar): the albedo of Diffuse and Principled BSDFs with diffuse roughness.

Sources: the improved Oren-Nayar model of Fujii 2012 with coefficients A = 1 / (pi + r (pi/2 - 2/3)) and
B = r A, and since Blender 4.3 the compensation of lost energy of OpenPBR's EON model (Cycles,
closure/bsdf_oren_nayar.h). Bakes under an even sky agree in Blender 4.2, 5.0 and 5.2: Cycles multiplies the
compensation by the squared albedo.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...compat import node_input
from .socket_math import Operand, SocketMath
from .sockets import number_of

#: Hemispherical mean albedo of a white surface without compensation: (1 + _GAIN r) / (1 + _LOSS r).
_GAIN, _LOSS = (2 - 5.6 / np.pi) / 3, (np.pi / 2 - 2 / 3) / np.pi

#: Roughness above which the report names a closure (chosen). There, the albedo at normal incidence is 1.8 %
#: below its hemispherical mean without compensation, and 0.9 % with it at color 0.5 (computed).
_RELEVANT = 0.25


def diffuse_roughness(node: bpy.types.Node) -> bpy.types.NodeSocket | None:
    """Return the input of diffuse roughness; None if the closure has none or if it is 0."""
    is_diffuse = node.bl_idname == "ShaderNodeBsdfDiffuse"
    socket = node_input(node, "Roughness" if is_diffuse else "Diffuse Roughness")
    if socket is None:
        return None
    return socket if number_of(socket, linked=1.0) > 0 else None


def is_rough(node: bpy.types.Node) -> bool:
    """Return True if the reflection of a closure depends visibly on the direction."""
    socket = diffuse_roughness(node)
    return socket is not None and number_of(socket, linked=1.0) > _RELEVANT


def rough_albedo(color: np.ndarray, roughness: float) -> np.ndarray:
    """Return the hemispherical mean albedo of a rough diffuse closure, (3,) float64.

    color:      (3,) float64, linear
    roughness:  0..1
    """
    white = (1 + _GAIN * roughness) / (1 + _LOSS * roughness)
    if not _keeps_energy():
        return color * white
    lost = 1 - white
    return color * white * (1 + color * color * lost / (1 - color * lost))


def rough_nodes(math: SocketMath, color: Operand, roughness: Operand) -> Operand:
    """Return `rough_albedo` as nodes."""
    rough = math.clamp(roughness)
    white = math.divide(
        math.add(1.0, math.multiply(rough, _GAIN)), math.add(1.0, math.multiply(rough, _LOSS))
    )
    single = math.multiply(color, white)
    if not _keeps_energy():
        return single
    lost = math.multiply(color, math.complement(white))
    again = math.divide(math.multiply(color, lost), math.complement(lost))
    return math.multiply(single, math.add(1.0, again))


def _keeps_energy() -> bool:
    """Return True if this version of Cycles compensates for the energy that Oren-Nayar loses."""
    return bpy.app.version >= (4, 3)
