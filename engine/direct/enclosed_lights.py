"""Detection of lights enclosed by an object, which light only its inner side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..object_message import ObjectMessage
from ..scene.cutouts import SHADOW
from ..scene.model import Light, Scene
from ..scene.triangles import Triangles
from ..validity.thresholds import ENCLOSED
from ..visibility.rays.ray_tracer import RayTracer
from ..visibility.rays.shaders.shader_tracer import ShaderTracer

#: Number of test rays per light.
_RAYS = 256


def warn_enclosed_lights(
    rays: RayTracer | ShaderTracer, scene: Scene, triangles: Triangles, lamps: Sequence[Light]
) -> list[str]:
    """Return a warning for each light inside an object, whose rays hit almost only back faces."""
    lamps = [lamp for lamp in lamps if lamp.kind != "sun" and lamp.casts_shadow]
    if not lamps:
        return []
    directions = _directions()
    origins = np.repeat([lamp.position for lamp in lamps], _RAYS, axis=0)
    hit, front, _ = rays.cast(origins, np.tile(directions, (len(lamps), 1)), kind=SHADOW)
    warnings: list[str] = []
    for index, lamp in enumerate(lamps):
        mine = slice(index * _RAYS, (index + 1) * _RAYS)
        shines = directions @ -lamp.axes[2] > 0 if lamp.kind in ("spot", "area") else np.full(_RAYS, True)
        back = (hit[mine] >= 0) & ~front[mine] & shines
        if triangles.backs is not None:
            back &= triangles.backs[hit[mine]] < 0
        if back.sum() >= ENCLOSED * shines.sum():
            name = scene.meshes[int(np.bincount(triangles.mesh[hit[mine][back]]).argmax())].name
            sentence = f"Light '{lamp.name}' is inside object '{name}' and lights nothing. Move it."
            warnings.append(ObjectMessage(sentence, (lamp.name, name)))
    return warnings


def _directions() -> np.ndarray:
    """Return directions spread evenly over the sphere, (_RAYS, 3) float64 (Fibonacci lattice)."""
    index = np.arange(_RAYS) + 0.5
    z = 1 - 2 * index / _RAYS
    angle = np.pi * (1 + np.sqrt(5)) * index
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
