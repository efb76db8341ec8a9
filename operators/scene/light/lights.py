"""Converts Blender's lights to engine lights with the units and formulas of Cycles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ....engine.object_message import object_message
from ....engine.scene.model import Light
from ...compat import light_nodes, light_power, light_temperature
from ...lookup import find
from ..materials.object_nodes import FrozenCopy, Source, dependence, object_values
from ..materials.sockets import ComplexError
from ..materials.tree_nodes import used_nodes
from ..objects.items import SceneItem, hidden_from
from ..scene_context import SceneContext
from ..scene_watch import SceneWatch
from ..slice_timer import Slices
from .light_bake import bake_lamp
from .light_node_reader import LightNodeReader, LightNodes, own_constants

#: Axes whose scale must not be 0 for a light of each type to emit light, as in Cycles (measured in 5.0.1).
_SHINING_AXES = {"POINT": (), "SUN": (2,), "SPOT": (0, 1, 2), "AREA": (0, 1, 2)}

#: Half angle of the spread of an area light with full spread, radians.
_SPREAD_OFF = np.pi / 2


#: Number of bounces after which a light adds less than 1 % in rooms of reflectance 0.8.
_MANY_BOUNCES = 20

_LINKED = "Light linking is not baked; these light and shadow everything: {}. Clear their light linking."

_BOUNDED = (
    "{}: Max Bounces of these lights is not baked, so their light bounces as often as all other light. "
    "Raise it to 1024, or set Max Bounces of the bake."
)


@dataclass(frozen=True)
class _UnreadLight:
    """A light whose nodes have not been read.

    light:   the engine's light without its nodes
    uid:     session uid of the light's data
    matrix:  (4, 4) float64, light space to world space
    values:  values of nodes that depend on the object, see `object_values`
    """

    light: Light
    uid: int
    matrix: np.ndarray
    values: dict[Source, tuple[float, ...]]

    @contextmanager
    def lamp(self) -> Iterator[bpy.types.Light]:
        """Yield the light's data; a copy with constants if its nodes depend on the object."""
        lamp = find(bpy.data.lights, self.uid)
        if not self.values:
            yield lamp
            return
        frozen = FrozenCopy(lamp, self.values)
        try:
            yield frozen.copy
        finally:
            frozen.remove()


class SceneLights:
    """Collects the lights of a scene; each instance of a light becomes a light of its own.

    notes:  sentences on what cannot be converted exactly are appended here
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes, self._reader = notes, LightNodeReader(notes)
        self._lights: list[_UnreadLight] = []
        self._portals: list[str] = []
        self._linked: list[str] = []
        self._flat: list[str] = []
        self._bounded: list[str] = []
        self._inexact = defaultdict[str, list[str]](list)

    def add(self, item: SceneItem) -> None:
        """Read one light without its nodes."""
        name, lamp = item.object.name, item.object.data
        # Blender does not always update properties of Cycles on evaluated lights.
        cycles = getattr(item.source.data, "cycles", None)
        if lamp.type == "AREA" and cycles is not None and cycles.is_portal:
            self._portals.append(name)
            return
        if hidden_from(item).from_bounces:
            return
        if (_scale(item)[list(_SHINING_AXES[lamp.type])] == 0).any():
            self._flat.append(name)
            return
        if has_light_linking(item.object):
            self._linked.append(name)
        if cycles is not None and cycles.max_bounces < _MANY_BOUNCES:
            self._bounded.append(name)
        values = object_values(dependence(light_nodes(lamp)).sources, item)
        uid = item.source.data.session_uid
        self._lights.append(_UnreadLight(_read_light(item), uid, item.matrix, values))

    def finish(self, origin: np.ndarray, watch: SceneWatch) -> Slices[tuple[Light, ...]]:
        """Read the lights' nodes; return the engine lights; add notes on lights that are approximated.

        origin:  (3,) float64 in world space; positions of the lights are relative to it
        """
        lights = []
        for each in self._lights:
            nodes = yield from self._nodes(each, watch)
            lights.append(_with_nodes(each.light, nodes))
            yield len(lights) / len(self._lights)
        if self._portals:
            sentence = "Portals give no light of their own and are not used: {}."
            self._notes.append(object_message(sentence, self._portals))
        if self._flat:
            self._notes.append(object_message("Lamps that are scaled to 0 light nothing: {}.", self._flat))
        if self._linked:
            self._notes.append(object_message(_LINKED, self._linked))
        if self._bounded:
            self._notes.append(object_message(_BOUNDED, self._bounded))
        self._notes += [object_message(sentence, names) for sentence, names in self._inexact.items()]
        return tuple(replace(light, position=light.position - origin) for light in lights)

    def _nodes(self, unread: _UnreadLight, watch: SceneWatch) -> Slices[LightNodes]:
        """Return factors of a light's nodes, exact if possible, else measured by Cycles, else constants."""
        name = unread.light.name
        nodes = self._exact_nodes(unread, watch)
        if nodes is not None:
            return nodes
        yield f"Reading light '{name}' with Cycles"
        watch.depsgraph()
        try:
            with unread.lamp() as lamp:
                return self._bake_nodes(lamp, name, unread.matrix, watch.context)
        finally:
            watch.accept()

    def _exact_nodes(self, unread: _UnreadLight, watch: SceneWatch) -> LightNodes | None:
        """Return the exact factors of a light's nodes; None if only Cycles can evaluate the nodes."""
        watch.depsgraph()
        try:
            with unread.lamp() as lamp:
                return self._read_nodes(lamp, unread.light.name)
        except ComplexError:
            return None
        finally:
            if unread.values:
                watch.accept()

    def _read_nodes(self, lamp: bpy.types.Light, name: str) -> LightNodes:
        """Return the factors of a light's nodes; raises ComplexError if only Cycles can evaluate them."""
        tree = light_nodes(lamp)
        if tree is None:
            return LightNodes()
        nodes = self._reader.read(tree, name)
        return _along_axis(nodes) if lamp.type == "SUN" else nodes

    def _bake_nodes(
        self, lamp: bpy.types.Light, name: str, matrix: np.ndarray, context: SceneContext
    ) -> LightNodes:
        """Return the factors of a light's nodes measured by Cycles; on failure the Emission's constants."""
        tree = light_nodes(lamp)
        try:
            nodes = bake_lamp(lamp, matrix, context)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[-1]
            sentence = (
                f"{{}}: Cycles could not evaluate the nodes of the light ({reason}). The colour and strength "
                "of its Emission are baked."
            )
            self._inexact[sentence].append(name)
            return own_constants(tree)
        if lamp.type == "AREA":
            self._inexact["{}: the nodes of the light are baked as their mean over its face."].append(name)
        elif any(node.bl_idname == "ShaderNodeLightFalloff" for node in used_nodes(tree)):
            self._inexact["{}: the nodes of the light are baked as they are 1 m away from it."].append(name)
        return nodes


def _with_nodes(light: Light, nodes: LightNodes) -> Light:
    """Return the light with its strength, profile and falloff multiplied by the factors of its nodes."""
    power, smooth = nodes.falloff or (0, 0.0)
    strength = (light.strength * nodes.colour).astype(np.float32)
    return replace(
        light, strength=strength, profile=nodes.profile, falloff_power=power, falloff_smooth=smooth
    )


def _along_axis(nodes: LightNodes) -> LightNodes:
    """Evaluate a sun's factors along its axis, since a sun shines in one direction."""
    if nodes.falloff is not None and nodes.falloff[0] > 0:
        raise ComplexError
    if nodes.profile is None:
        return LightNodes(nodes.colour)
    ahead = nodes.profile.factors[:, 0].mean(axis=0) if nodes.profile.polars[0] == 0 else np.zeros(3)
    return LightNodes(nodes.colour * ahead)


def has_light_linking(obj: bpy.types.Object) -> bool:
    """Return True if a light or an emissive object lights or shadows chosen objects only."""
    linking = getattr(obj, "light_linking", None)
    return linking is not None and bool(linking.receiver_collection or linking.blocker_collection)


def _scale(item: SceneItem) -> np.ndarray:
    """Return the scale of an object's matrix along its local axes, (3,) float64."""
    return np.linalg.norm(np.array(item.matrix, np.float64)[:3, :3], axis=0)


def _read_light(item: SceneItem) -> Light:
    """Return one light as engine light, without its nodes.

    Formulas: Cycles, scene/light.cpp. Units: Blender manual, Light Objects.
    """
    lamp, matrix = item.object.data, np.array(item.matrix, np.float64)
    scale = _scale(item)
    axes = (matrix[:3, :3] / np.where(scale > 0, scale, 1)).T
    power = _power(lamp)
    common = {
        "name": item.object.name,
        "position": matrix[:3, 3],
        "axes": axes,
        "casts_shadow": bool(lamp.use_shadow),
        "stretch": np.maximum(scale / max(scale.max(), 1e-30), 1e-6),
        "light_group": item.source.lightgroup,
        "visible": bool(item.source.visible_camera),
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
        half_angle=lamp.spot_size / 2, blend=float(lamp.spot_blend), **common,
    )  # fmt: skip


def _power(lamp: bpy.types.Light) -> np.ndarray:
    """Return a light's power times its colour, (3,) float64: W, or W/m^2 for a sun."""
    return light_power(lamp) * np.array(lamp.color, np.float64) * light_temperature(lamp)


def _normalized(lamp: bpy.types.Light) -> bool:
    return bool(getattr(lamp, "normalize", True))


def _sun(lamp: bpy.types.Light, power: np.ndarray) -> np.ndarray:
    """Return the irradiance of a sun, (3,) float32 W/m^2; if not normalized, its power is a radiance."""
    angle = np.pi * np.sin(lamp.angle / 2) ** 2
    return (power if _normalized(lamp) or angle == 0 else power * angle).astype(np.float32)


def _intensity(lamp: bpy.types.Light, power: np.ndarray, radius: float) -> np.ndarray:
    """Return the radiant intensity of a point or spot light, (3,) float32 W/sr.

    It is P / (4 pi). If the light is not normalized, its radiance is P / pi and its intensity P r^2.
    """
    if _normalized(lamp) or radius == 0:
        return (power / (4 * np.pi)).astype(np.float32)
    return (power * radius**2).astype(np.float32)


def _area(lamp: bpy.types.Light, power: np.ndarray, scale: np.ndarray, common: dict) -> Light:
    """Return an area light of radiance P / (pi area), or P / pi if it is not normalized."""
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
