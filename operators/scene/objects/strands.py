"""Reads strands of hair as renders show them: hair particle systems drawn as paths, and hair Curves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from .meshes import read_array

#: Radius of Curves without the radius attribute, m (Cycles, blender/curves.cpp).
_RADIUS = 0.005


@dataclass(frozen=True)
class Strands:
    """Strands of hair in object space.

    points:   (p, 3) float64; the points of a strand are consecutive
    radius:   (p,) float64, radius at each point
    starts:   (s + 1,) int64, first point of each strand, then p
    slot:     material slot of the object
    widened:  factor by which the radii were increased, because strands were left out
    """

    points: np.ndarray
    radius: np.ndarray
    starts: np.ndarray
    slot: int
    widened: float = 1.0


def has_strands(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Return True if an evaluated object has hair that its dependency graph's mode shows."""
    if obj.type == "CURVES":
        return True
    return obj.type == "MESH" and any(True for _ in _hair_systems(obj, depsgraph))


def read_strands(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> list[Strands]:
    """Return the strands of an evaluated object, one entry for each hair system."""
    if obj.type == "CURVES":
        found = [_read_curves(obj.data)]
    else:
        found = [_read_particles(obj, system, depsgraph) for system in _hair_systems(obj, depsgraph)]
    return [strands for strands in found if len(strands.points)]


def _hair_systems(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> Iterator[bpy.types.ParticleSystem]:
    """Yield the particle systems that are drawn as strands."""
    shown = "show_render" if depsgraph.mode == "RENDER" else "show_viewport"
    for modifier in obj.modifiers:
        if modifier.type == "PARTICLE_SYSTEM" and getattr(modifier, shown):
            settings = modifier.particle_system.settings
            if settings.type == "HAIR" and settings.render_type == "PATH":
                yield modifier.particle_system


def _read_particles(
    obj: bpy.types.Object, system: bpy.types.ParticleSystem, depsgraph: bpy.types.Depsgraph
) -> Strands:
    """Return the strands of a particle system; if it has children, only these, as in Cycles."""
    settings, parents = system.settings, len(system.particles)
    children = len(system.child_particles)
    step = settings.render_step if depsgraph.mode == "RENDER" else settings.display_step
    count = (1 << step) + 1
    first = parents if children and settings.child_type != "NONE" else 0
    path = system.co_hair
    world = np.array(
        [
            path(object=obj, particle_no=number, step=point)
            for number in range(first, parents + children)
            for point in range(count)
        ],
        np.float64,
    ).reshape(-1, 3)
    inverse = np.linalg.pinv(np.array(obj.matrix_world, np.float64))
    points = world @ inverse[:3, :3].T + inverse[:3, 3]
    starts = np.arange(0, len(points) + 1, count)
    radius = _particle_radius(settings, points.reshape(-1, count, 3)).reshape(-1)
    return Strands(points, radius, starts, max(settings.material - 1, 0))


def _particle_radius(settings: bpy.types.ParticleSettings, points: np.ndarray) -> np.ndarray:
    """Return the radius at points, (s, k, 3) -> (s, k) float64: Cycles' shaperadius (blender/curves.cpp).

    Root and tip of the settings are diameters.
    """
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    length = np.concatenate([np.zeros((len(points), 1)), np.cumsum(steps, axis=1)], axis=1)
    left = 1 - length / np.maximum(length[:, -1:], 1e-30)
    if settings.shape < 0:
        left = left ** (1 + settings.shape)
    elif settings.shape > 0:
        left = left ** (1 / max(1 - settings.shape, 1e-6))
    diameter = left * (settings.root_radius - settings.tip_radius) + settings.tip_radius
    if settings.use_close_tip:
        diameter[:, -1] = 0
    return diameter * settings.radius_scale / 2


def _read_curves(curves: bpy.types.Curves) -> Strands:
    """Return the strands of hair Curves."""
    if not len(curves.points):
        return Strands(np.zeros((0, 3)), np.zeros(0), np.zeros(1, np.int64), 0)
    points = read_array(curves.attributes["position"].data, "vector", 3, np.float32).astype(np.float64)
    attribute = curves.attributes.get("radius")
    if attribute is None:
        radius = np.full(len(points), _RADIUS)
    else:
        radius = read_array(attribute.data, "value", 1, np.float32)[:, 0].astype(np.float64)
    starts = read_array(curves.curve_offset_data, "value", 1, np.int32)[:, 0].astype(np.int64)
    return Strands(points, radius, starts, 0)
