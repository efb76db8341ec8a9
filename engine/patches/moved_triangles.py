"""Change detection between two versions of a scene: the triangles for which cached ray hits are stale."""

from __future__ import annotations

import numpy as np

from ..scene.digests import same_values
from ..scene.triangles import Triangles
from .patch_scene import PatchScene

#: Maximum fraction of moved triangles; above it, computing all visibility again is as fast.
_MOST = 0.5

#: Rounding error of the ball's radius, relative to the sum of the radius and the largest coordinate.
_ROUNDING = 1e-5


def moved_triangles(before: PatchScene, after: PatchScene) -> np.ndarray | None:
    """Return the old and new corners of moved triangles, (k, 3, 3) float32, m.

    Positions are relative to `Triangles.origin`. A ray with unchanged ends that misses all of them hits the
    same patch as before. Returns None if the patches or the transmittance differ, or if most triangles have
    moved.
    """
    if not (_same_patches(before, after) and _same_cutouts(before, after)):
        return None
    ranges = _ranges_of_meshes(before.triangles), _ranges_of_meshes(after.triangles)
    if len(ranges[0]) != len(ranges[1]):
        return None
    stays = _unmoved(before.triangles, after.triangles, *ranges)
    shown = before.texel_to_patch, after.texel_to_patch
    changed = None if shown[0] is shown[1] else shown[0] != shown[1]
    found = []
    for patch_scene, still in zip((before, after), stays, strict=True):
        triangles = patch_scene.triangles
        moved = ~still
        if changed is not None and changed.any():
            moved |= _touching(triangles, changed)
        if moved.sum() > _MOST * len(moved):
            return None
        found.append(triangles.positions[moved])
    return np.concatenate(found)


def ball_around(triangles: np.ndarray) -> np.ndarray:
    """Return centre and radius of a ball around triangles, (4,) float64, m, slightly larger than their box.

    triangles:  (k, 3, 3), m, at least one
    """
    corners = triangles.reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    half = np.linalg.norm(high - low) / 2
    return np.array([*(low + high) / 2, half + _ROUNDING * (half + np.abs(corners).max())])


def _same_patches(before: PatchScene, after: PatchScene) -> bool:
    """Return True if both versions of a scene have the same patches on the same texels."""
    one, other = before.patches, after.patches
    return (
        one.resolution == other.resolution
        and before.texel_to_patch.shape == after.texel_to_patch.shape
        and same_values(one.texel, other.texel)
        and same_values(one.atlas, other.atlas)
    )


def _same_cutouts(before: PatchScene, after: PatchScene) -> bool:
    """Return True if the same parts of the same triangles transmit light."""
    if not (before.cutouts.needed or after.cutouts.needed):
        return True
    materials = before.triangles.material, after.triangles.material
    return np.array_equal(*materials) and same_values(before.cutouts, after.cutouts)


def _ranges_of_meshes(triangles: Triangles) -> np.ndarray:
    """Return the first triangle of each mesh, and the total number, (meshes + 1,) int64."""
    meshes = int(triangles.mesh[-1]) + 1 if len(triangles.mesh) else 0
    return np.searchsorted(triangles.mesh, np.arange(meshes + 1))


def _unmoved(
    before: Triangles, after: Triangles, first: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return masks, before and after, (t,) bool each, of triangles at the same place in world and UV space.

    first, other:  (meshes + 1,) int64, first triangle of each mesh before and after. If a mesh's triangle
                   count changed, all of its triangles have moved
    """
    still = np.zeros(len(before.mesh), bool), np.zeros(len(after.mesh), bool)
    for mesh in range(len(first) - 1):
        here, there = slice(*first[mesh : mesh + 2]), slice(*other[mesh : mesh + 2])
        if here.stop - here.start != there.stop - there.start:
            continue
        same = before.atlas[here] == after.atlas[there]
        for name in ("positions", "uvs"):
            same &= (getattr(before, name)[here] == getattr(after, name)[there]).all(axis=(1, 2))
        still[0][here] = still[1][there] = same
    return still


def _touching(triangles: Triangles, changed: np.ndarray) -> np.ndarray:
    """Return a mask, (t,) bool, of triangles whose bilinear lookups may read a marked texel.

    changed:  (atlases, r, r) bool, marked texels

    Tests the bounding box of each triangle on the lightmap with a summed-area table (Crow 1984).
    """
    atlases, resolution = changed.shape[:2]
    sums = np.zeros((atlases, resolution + 1, resolution + 1), np.int64)
    np.cumsum(np.cumsum(changed, axis=1), axis=2, out=sums[:, 1:, 1:])
    texels = np.nan_to_num(triangles.uvs.astype(np.float64) * resolution)
    low = np.clip(np.floor(texels.min(axis=1)) - 1, 0, resolution - 1).astype(np.int64)
    high = np.clip(np.floor(texels.max(axis=1)) + 2, 1, resolution).astype(np.int64)
    (left, bottom), (right, top), atlas = low.T, high.T, triangles.atlas
    inside = sums[atlas, top, right] - sums[atlas, bottom, right]
    inside += sums[atlas, bottom, left] - sums[atlas, top, left]
    touching: np.ndarray = inside > 0
    return touching
