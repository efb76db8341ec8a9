"""Light objects -> engine lights, in the units and with the rules of Cycles."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ...engine.naming import naming
from ...engine.scene import Light
from ..compat import light_nodes, light_power, light_temperature
from .items import SceneItem
from .materials import ShaderReader
from .sockets import ComplexError, feeder

#: Axes along which a lamp of a type must not be scaled to 0 to shine, as in Cycles (measured in 5.0.1).
_SHINING_AXES = {"POINT": (), "SUN": (2,), "SPOT": (0, 1, 2), "AREA": (0, 1, 2)}

#: Half the spread of an area light that has none, rad.
_SPREAD_OFF = np.pi / 2


class Lamps:
    """Collects the lamps of a scene; instances of a lamp are lamps of their own.

    notes  sentences about what could not be taken over are appended here
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._lights: list[Light] = []
        self._portals: list[str] = []
        self._linked: list[str] = []
        self._flat: list[str] = []

    def add(self, item: SceneItem) -> None:
        """Read one lamp."""
        name, lamp = item.object.name, item.object.data
        if lamp.type == "AREA" and getattr(lamp, "cycles", None) and lamp.cycles.is_portal:
            self._portals.append(name)
            return
        if (_scale(item)[list(_SHINING_AXES[lamp.type])] == 0).any():
            self._flat.append(name)
            return
        if _is_linked(item.object):
            self._linked.append(name)
        self._lights.append(_read_light(item, self._notes))

    def finish(self, origin: np.ndarray) -> tuple[Light, ...]:
        """Return the lamps read, and say what is special about some.

        origin: (3,) float64, world space: positions are relative to it.
        """
        if self._portals:
            sentence = "Portals give no light of their own and are not used: {}."
            self._notes.append(naming(sentence, self._portals))
        if self._flat:
            self._notes.append(naming("Lamps that are scaled to 0 light nothing: {}.", self._flat))
        if self._linked:
            sentence = "Light linking is not baked; these light and shadow everything: {}."
            self._notes.append(naming(sentence, self._linked))
        return tuple(replace(light, position=light.position - origin) for light in self._lights)


def _is_linked(obj: bpy.types.Object) -> bool:
    linking = getattr(obj, "light_linking", None)
    return linking is not None and bool(linking.receiver_collection or linking.blocker_collection)


def _scale(item: SceneItem) -> np.ndarray:
    """Return an item's scale along its axes, (3,) float64."""
    return np.linalg.norm(np.array(item.matrix, np.float64)[:3, :3], axis=0)


def _read_light(item: SceneItem, notes: list[str]) -> Light:
    """Return one lamp (formulas: Cycles, scene/light.cpp; units: Blender manual, Light Objects)."""
    lamp, matrix = item.object.data, np.array(item.matrix, np.float64)
    scale = _scale(item)
    axes = (matrix[:3, :3] / np.where(scale > 0, scale, 1)).T
    power = _power(lamp, item.object.name, notes)
    common = {
        "name": item.object.name,
        "position": matrix[:3, 3],
        "axes": axes,
        "casts_shadow": bool(lamp.use_shadow),
    }
    if lamp.type == "SUN":
        return Light(kind="sun", strength=_sun(lamp, power), half_angle=lamp.angle / 2, **common)
    if lamp.type == "AREA":
        return _area(lamp, power, scale, common)
    radius = float(lamp.shadow_soft_size)
    soft = bool(getattr(lamp, "use_soft_falloff", True))
    strength = _intensity(lamp, power, radius)
    if lamp.type == "POINT":
        return Light(kind="point", strength=strength, radius=radius, soft=soft, **common)
    return Light(
        kind="spot", strength=strength, radius=radius, soft=soft,
        half_angle=lamp.spot_size / 2, blend=float(lamp.spot_blend),
        stretch=np.maximum(scale / max(scale.max(), 1e-30), 1e-6), **common,
    )  # fmt: skip


def _power(lamp: bpy.types.Light, name: str, notes: list[str]) -> np.ndarray:
    """Return power times colour, (3,) float64: W, of a sun W/m^2."""
    power = light_power(lamp) * np.array(lamp.color, np.float64) * light_temperature(lamp)
    tree = light_nodes(lamp)
    if tree is None:
        return power
    output = next((node for node in tree.nodes if node.bl_idname == "ShaderNodeOutputLight"), None)
    if output is None:
        return power * 0
    owner = f"Light '{name}'"
    try:
        return power * ShaderReader(owner, notes).surface(output.inputs["Surface"]).emission.constant
    except ComplexError:
        notes.append(
            f"{owner} has nodes that are not evaluated: the Emission's own colour and strength are baked."
        )
        return power * _own_emission(output.inputs["Surface"])


def _own_emission(socket: bpy.types.NodeSocket) -> np.ndarray:
    """Return the unlinked colour times strength of the Emission that feeds a socket, white of any other."""
    node = feeder(socket).node
    if node.bl_idname != "ShaderNodeEmission":
        return np.ones(3)
    colour = np.array(node.inputs["Color"].default_value, np.float64)[:3]
    return colour * node.inputs["Strength"].default_value


def _normalized(lamp: bpy.types.Light) -> bool:
    return bool(getattr(lamp, "normalize", True))


def _sun(lamp: bpy.types.Light, power: np.ndarray) -> np.ndarray:
    """Return the irradiance of a sun; not normalized, its power is a radiance."""
    angle = np.pi * np.sin(lamp.angle / 2) ** 2
    return (power if _normalized(lamp) or angle == 0 else power * angle).astype(np.float32)


def _intensity(lamp: bpy.types.Light, power: np.ndarray, radius: float) -> np.ndarray:
    """Return the radiant intensity of a point or spot: P / (4 pi); P r^2 if its radiance is P / pi."""
    if _normalized(lamp) or radius == 0:
        return (power / (4 * np.pi)).astype(np.float32)
    return (power * radius**2).astype(np.float32)


def _area(lamp: bpy.types.Light, power: np.ndarray, scale: np.ndarray, common: dict) -> Light:
    """Return an area light: radiance P / (pi area), or P / pi if it is not normalized."""
    across = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
    size = np.array([lamp.size, across]) * scale[:2]
    ellipse = lamp.shape in {"DISK", "ELLIPSE"}
    area = float(size[0] * size[1]) * (np.pi / 4 if ellipse else 1.0)
    divisor = area if _normalized(lamp) else 1.0
    strength = power / (np.pi * divisor) if divisor > 0 else power * 0
    return Light(
        kind="area", strength=strength.astype(np.float32), size=size, ellipse=ellipse,
        half_angle=min(lamp.spread / 2, _SPREAD_OFF), **common,
    )  # fmt: skip
