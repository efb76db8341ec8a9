"""Polygon clipping of triangles against the texels that they touch, in lightmap UV space (NumPy)."""

from __future__ import annotations

import numpy as np


def clipped_centroids(corners: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Return the centroid of the part of each triangle inside a texel, (m, 3) float64 barycentrics.

    A part without area gives a point between its corners.

    corners:  (m, 3, 2) float64, texels; may have no area
    texels:   (m, 2) int, column and row of one texel for each triangle, which touches it
    """
    polygons = clip_at_texels(corners, texels)
    return _centroids(polygons[:, :, :2], polygons[:, :, 2:])


def clip_at_texels(corners: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Return the part of each triangle inside a texel as a polygon, (m, 7, 5) float64.

    Each vertex holds its position relative to the texel and its barycentrics. The triangle is clipped at the
    four sides of the texel (Sutherland and Hodgman 1974). Unused vertices repeat the first one.

    corners:  (m, 3, 2) float64, texels
    texels:   (m, 2) int, column and row
    """
    local = corners - texels[:, None]
    weights = np.broadcast_to(np.eye(3), (len(corners), 3, 3))
    polygons = np.concatenate([local, weights], axis=2)
    for axis in (0, 1):
        polygons = _clip(polygons, polygons[:, :, axis])
        polygons = _clip(polygons, 1 - polygons[:, :, axis])
    return polygons


def fan_areas(points: np.ndarray) -> np.ndarray:
    """Return the areas, (m, k - 2), of the triangle fan of polygons with vertices (m, k, 2)."""
    first, second = points[:, 1:-1] - points[:, :1], points[:, 2:] - points[:, :1]
    areas: np.ndarray = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / 2
    return areas


def _clip(polygons: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return convex polygons, (m, k, c), clipped to the positive side of a line, (m, k + 1, c).

    distance:  (m, k), signed distance of each vertex from the line. Unused vertices at the end repeat the
               first one.
    """
    count = polygons.shape[1]
    after, distance_after = np.roll(polygons, -1, axis=1), np.roll(distance, -1, axis=1)
    inside = distance >= 0
    crosses = inside != np.roll(inside, -1, axis=1)
    step = np.divide(distance, distance - distance_after, out=np.zeros_like(distance), where=crosses)
    crossing = polygons + step[:, :, None] * (after - polygons)

    # Interleave vertices and crossings, then move the existing ones to the front in their order.
    both = np.stack([polygons, crossing], axis=2).reshape(len(polygons), 2 * count, polygons.shape[2])
    there = np.stack([inside, crosses], axis=2).reshape(len(polygons), 2 * count)
    order = np.argsort(~there, axis=1, kind="stable")[:, : count + 1]
    kept = np.take_along_axis(both, order[:, :, None], axis=1)
    used = np.take_along_axis(there, order, axis=1)
    return np.where(used[:, :, None], kept, kept[:, :1])


def _centroids(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean of vertex weights, (m, k, 3), over convex polygons with vertices (m, k, 2)."""
    area = fan_areas(points)
    middle = (weights[:, :1] + weights[:, 1:-1] + weights[:, 2:]) / 3
    total = area.sum(axis=1)
    flat = total < 5e-10
    area[flat] = 1
    total[flat] = area.shape[1]
    centroid = (area[..., None] * middle).sum(axis=1) / total[:, None]
    return centroid / centroid.sum(axis=1, keepdims=True)
