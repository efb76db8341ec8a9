"""Blender's Light Probe objects that renders show, and their transforms."""

from __future__ import annotations

import bpy
import numpy as np

from .objects.visible import visible_objects
from .scene_context import SceneContext


def visible_light_probes(context: SceneContext, kind: str) -> list[bpy.types.Object]:
    """Return the light probes of a kind, such as "VOLUME" or "SPHERE", that renders show."""
    return [obj for obj in visible_objects(context) if is_light_probe(obj, kind)]


def is_light_probe(obj: bpy.types.Object, kind: str) -> bool:
    """Return True for a light probe of a kind."""
    return obj.type == "LIGHT_PROBE" and obj.data.type == kind


def matrix_from(obj: bpy.types.Object, origin: np.ndarray) -> np.ndarray:
    """Return an object's matrix to world axes, (4, 4) float64, relative to an origin, (3,) float64."""
    matrix = np.array(obj.matrix_world, np.float64)
    matrix[:3, 3] -= origin
    return matrix
