"""Finds patches in contact as `contact` does, on the host: for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..patches.patch_scene import PatchScene
from ..scene.cutouts import BACK, BOUNCE, SETS, Cutouts, transmittances
from ..scene.model import Scene
from ..scene.textures import sample
from ..visibility.morton import morton_codes
from ..visibility.views.viewpoints import eye_heights
from .contact import ABOVE, BELOW

#: Patches that look for triangles together, and pairs that are tested at once.
_GROUP, _PAIRS = 64, 1 << 20

#: How much wider triangles are than they are, in barycentrics, and the opacity from which on a surface
#: hides another one: both as for rays (kernels/rays/bvh_traversal.cl).
_RIM, _STOPS = 1e-6, 0.5


def in_contact_on_host(scene: Scene, parts: PatchScene) -> np.ndarray:
    """Return what `find_contacts` does, found without OpenCL."""
    geometry, triangles = parts.geometry, parts.triangles
    up = eye_heights(triangles, geometry)[:, None] * geometry.geometric
    start = geometry.center + ABOVE * up
    step = -(ABOVE + BELOW) * up
    corners = triangles.positions[: triangles.solid].astype(np.float64)
    in_contact = np.zeros(len(start), bool)
    for patch, triangle in _neighbours(start, step, corners):
        met, weights = _backs_met(start[patch], step[patch], corners[triangle])
        triangle = triangle[met]
        stops = _stops(scene, parts.cutouts, triangle, triangles.material[triangle], weights[met])
        in_contact[patch[met][stops]] = True
    return in_contact


def _neighbours(
    start: np.ndarray, step: np.ndarray, corners: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield pairs of a patch and a triangle, (k,) and (k,), whose boxes meet; patches lie on a Morton curve.

    start, step: (n, 3) float64, what a patch looks along; corners: (t, 3, 3) float64.
    """
    order = np.argsort(morton_codes(start.astype(np.float32)), kind="stable")
    low, high = np.minimum(start, start + step)[order], np.maximum(start, start + step)[order]
    first = np.arange(0, len(order), _GROUP)
    group_low, group_high = np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)
    box_low, box_high = corners.min(axis=1), corners.max(axis=1)
    at_once = max(1, _PAIRS // len(corners))
    for block in range(0, len(first), at_once):
        some = slice(block, block + at_once)
        meets = (group_low[some, None] <= box_high) & (group_high[some, None] >= box_low)
        group, triangle = np.nonzero(meets.all(axis=2))
        for part in range(0, len(group), _PAIRS // _GROUP):
            chosen = slice(part, part + _PAIRS // _GROUP)
            member = (block + group[chosen, None]) * _GROUP + np.arange(_GROUP)
            pair, column = np.nonzero(member < len(order))
            member, other = member[pair, column], triangle[chosen][pair]
            near = ((low[member] <= box_high[other]) & (high[member] >= box_low[other])).all(axis=1)
            yield order[member[near]], other[near]


def _backs_met(start: np.ndarray, step: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which segments, (k, 3) each, meet the back of their triangle, (k,) bool, and where.

    Where is (k, 3) float64, barycentrics (Moeller and Trumbore 1997).
    """
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across, offset = np.cross(step, edge2), start - corners[:, 0]
    determinant = (edge1 * across).sum(axis=1)
    inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=determinant < 0)
    around = np.cross(offset, edge1)
    u, v = (offset * across).sum(axis=1) * inverse, (step * around).sum(axis=1) * inverse
    distance = (edge2 * around).sum(axis=1) * inverse
    met = (u >= -_RIM) & (v >= -_RIM) & (u + v <= 1 + _RIM) & (distance > 0) & (distance <= 1)
    return met & (determinant < 0), np.stack([1 - u - v, u, v], axis=1)


def _stops(
    scene: Scene, cutouts: Cutouts, triangle: np.ndarray, material: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Return whether the backs of triangles (k,) stop light at barycentrics (k, 3), (k,) bool.

    Of a tinted surface the channel counts that passes most.
    """
    record = SETS * material + BACK + BOUNCE
    opacity, threshold = cutouts.base[record], cutouts.threshold[record]
    uvs = np.einsum("nk,nkd->nd", weights, cutouts.uvs[cutouts.layer[record], triangle])
    for number in np.unique(material):
        texture = transmittances(scene.materials[number].transmission)[BACK + BOUNCE].texture
        if texture is not None:
            mine = material == number
            opacity[mine] += cutouts.factor[record[mine]] * sample(texture.pixels, uvs[mine], texture)
    stops: np.ndarray = opacity.min(axis=1) >= np.where(threshold < 0, _STOPS, threshold)
    return stops
