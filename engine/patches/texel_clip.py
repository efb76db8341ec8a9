"""Clips triangles at the texels that they touch, in lightmap UV space."""

from __future__ import annotations

import numpy as np


def clipped_centroids(corners: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Return the centroid of what each triangle covers of a texel, as barycentrics (m, 3) float64.

    corners  (m, 3, 2) float64, in texels; may have no area
    texels   (m, 2) int, column and row; each triangle reaches into its texel

    Without an area it is a point between the corners of what is left.
    """
    polygons = clip_at_texels(corners, texels)
    return _centroids(polygons[:, :, :2], polygons[:, :, 2:])


def clip_at_texels(corners: np.ndarray, texels: np.ndarray) -> np.ndarray:
    """Return what each triangle covers of a texel, (m, 7, 5) float64: position in it, and barycentrics.

    corners  (m, 3, 2) float64, in texels
    texels   (m, 2) int, column and row

    Each triangle is clipped at the four sides of the texel (Sutherland and Hodgman 1974), and carries
    its barycentrics along. Unused corners of a polygon repeat the first one.
    """
    local = corners - texels[:, None]
    weights = np.broadcast_to(np.eye(3), (len(corners), 3, 3))
    polygons = np.concatenate([local, weights], axis=2)
    for axis in (0, 1):
        polygons = _clip(polygons, polygons[:, :, axis])
        polygons = _clip(polygons, 1 - polygons[:, :, axis])
    return polygons


def polygon_areas(points: np.ndarray) -> np.ndarray:
    """Return the areas, (m,), of convex polygons with corners (m, k, 2)."""
    areas: np.ndarray = fan_areas(points).sum(axis=1)
    return areas


def fan_areas(points: np.ndarray) -> np.ndarray:
    """Return the areas, (m, k - 2), of the triangles between the first corner and each side of a polygon."""
    first, second = points[:, 1:-1] - points[:, :1], points[:, 2:] - points[:, :1]
    areas: np.ndarray = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / 2
    return areas


def _clip(polygons: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return what convex polygons, (m, k, c), have on the positive side of a line, (m, k + 1, c).

    distance: of each corner from the line, (m, k). Unused corners at the end repeat the first one.
    """
    count = polygons.shape[1]
    after, distance_after = np.roll(polygons, -1, axis=1), np.roll(distance, -1, axis=1)
    inside = distance >= 0
    crosses = inside != np.roll(inside, -1, axis=1)
    step = np.divide(distance, distance - distance_after, out=np.zeros_like(distance), where=crosses)
    crossing = polygons + step[:, :, None] * (after - polygons)

    # Corner, crossing, corner, crossing, …: those that are there first, in their order.
    both = np.stack([polygons, crossing], axis=2).reshape(len(polygons), 2 * count, polygons.shape[2])
    there = np.stack([inside, crosses], axis=2).reshape(len(polygons), 2 * count)
    order = np.argsort(~there, axis=1, kind="stable")[:, : count + 1]
    kept = np.take_along_axis(both, order[:, :, None], axis=1)
    used = np.take_along_axis(there, order, axis=1)
    return np.where(used[:, :, None], kept, kept[:, :1])


def _centroids(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the mean of the weights, (m, k, 3), over convex polygons with corners (m, k, 2)."""
    area = fan_areas(points)
    middle = (weights[:, :1] + weights[:, 1:-1] + weights[:, 2:]) / 3
    total = area.sum(axis=1)
    flat = total < 5e-10
    area[flat] = 1
    total[flat] = area.shape[1]
    centroid = (area[..., None] * middle).sum(axis=1) / total[:, None]
    return centroid / centroid.sum(axis=1, keepdims=True)
