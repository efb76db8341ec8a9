"""Reflection sphere: a point at which a bake captures a cube map, and the boxes in which engines use it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Minimum width of a volume relative to the largest coordinate: float32 resolves no smaller ones.
_THIN = 1e-6


@dataclass(frozen=True)
class ReflectionVolume:
    """Box or ellipsoid around a reflection sphere.

    shape:   "box" for the unit cube, or "sphere" for the unit sphere
    matrix:  (4, 4) float64, from the unit cube [-1, 1]^3 to world axes, m, relative to `Scene.origin`
    """

    shape: str
    matrix: np.ndarray


@dataclass(frozen=True)
class ReflectionSphere:
    """Point from which a cube map is captured.

    name:       name for messages and files
    position:   (3,) float64, m, relative to `Scene.origin`
    influence:  volume in which surfaces use the cube map
    parallax:   volume whose surface the reflected rays hit, for box projection
    falloff:    fraction of the influence volume over which the reflection fades out
    """

    name: str
    position: np.ndarray
    influence: ReflectionVolume
    parallax: ReflectionVolume
    falloff: float = 0.0


def sphere_issue(sphere: ReflectionSphere) -> str | None:
    """Return why a sphere cannot be baked, as "problem. Remedy.", or None if it can."""
    volumes = sphere.influence, sphere.parallax
    if not all(np.isfinite(volume.matrix).all() for volume in volumes):
        return "its transform is not a number. Clear its location, rotation and scale."
    if _is_flat(sphere.influence.matrix):
        return "its influence has no size. Raise its Radius under Object Data, or scale it up along all axes."
    if _is_flat(sphere.parallax.matrix):
        return "its custom parallax has no size. Raise its Radius, or switch Custom Parallax off."
    return None


def _is_flat(matrix: np.ndarray) -> bool:
    """Return True if a volume has no extent along an axis."""
    axes = matrix[:3, :3]
    widths, reach = np.linalg.norm(axes, axis=0), float(np.abs(matrix[:3]).max(initial=0))
    if widths.min() <= _THIN * reach:
        return True
    return abs(float(np.linalg.det(axes / widths))) < _THIN
