"""Reads Blender's Light Probe Sphere objects as reflection spheres of the engine."""

from __future__ import annotations

import bpy
import numpy as np

from ...engine.scene.reflection_sphere import ReflectionSphere, ReflectionVolume, sphere_issue
from .light_probes import matrix_from, visible_light_probes
from .scene_context import SceneContext


def read_reflection_spheres(
    context: SceneContext, origin: np.ndarray, notes: list[str]
) -> tuple[ReflectionSphere, ...]:
    """Return the spheres that renders show, if the scene's bake includes reflection cubes.

    Spheres that cannot be baked are left out; a note names each with the remedy.

    origin:  (3,) float64, world space: the point to which positions are relative
    """
    if not context.scene.hemibake.reflection_cubes:
        return ()
    spheres = [_sphere(obj, origin) for obj in visible_light_probes(context, "SPHERE")]
    if not spheres:
        notes.append(
            "Reflection Cubes: the scene has no Light Probe Sphere. Add one with Add > Light Probe > Sphere."
        )
    issues = [sphere_issue(sphere) for sphere in spheres]
    pairs = list(zip(spheres, issues, strict=True))
    notes += [f"Light Probe Sphere '{sphere.name}': {issue}" for sphere, issue in pairs if issue]
    return tuple(sphere for sphere, issue in pairs if issue is None)


def count_spheres(context: SceneContext) -> int:
    """Return the number of reflection cubes of a bake of the scene."""
    return len(read_reflection_spheres(context, np.zeros(3), []))


def _sphere(obj: bpy.types.Object, origin: np.ndarray) -> ReflectionSphere:
    """Return the engine's sphere of an object."""
    data, matrix = obj.data, matrix_from(obj, origin)
    influence = _volume(matrix, data.influence_type, data.influence_distance)
    parallax = influence
    if data.use_custom_parallax:
        parallax = _volume(matrix, data.parallax_type, data.parallax_distance)
    return ReflectionSphere(obj.name, matrix[:3, 3].copy(), influence, parallax, float(data.falloff))


def _volume(matrix: np.ndarray, shape: str, distance: float) -> ReflectionVolume:
    """Return a volume of a sphere object, which Blender scales with the object.

    Both shapes are symmetric, so that a mirrored object has the same volume as one without mirror.
    """
    scaled = matrix.copy()
    scaled[:3, :3] *= distance
    if np.linalg.det(scaled[:3, :3]) < 0:
        scaled[:3, 0] *= -1
    return ReflectionVolume("box" if shape == "BOX" else "sphere", scaled)
