"""What has moved between two subdivisions of a scene: the triangles that rays may meet otherwise."""

from __future__ import annotations

import numpy as np

from ..scene.digests import same_values
from ..scene.triangles import Triangles
from .patch_scene import PatchScene

#: If more than this part of the triangles has moved, looking anew takes as long.
_MOST = 0.5

#: What rounding may take from a radius, as a part of it and of the largest coordinate.
_ROUNDING = 1e-5


def moved_triangles(before: PatchScene, after: PatchScene) -> np.ndarray | None:
    """Return the triangles that have moved, as they were and as they are, (k, 3, 3) float32.

    Metres from `Triangles.origin`. A ray that starts and ends where it did and meets none of them meets what
    it met before, patch number included. None if patches are others, if light passes through other parts of
    surfaces, or if most triangles have moved.
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
    for parts, still in zip((before, after), stays, strict=True):
        triangles = parts.triangles
        moved = ~still
        if changed is not None and changed.any():
            moved |= _touching(triangles, changed)
        if moved.sum() > _MOST * len(moved):
            return None
        found.append(triangles.positions[moved])
    return np.concatenate(found)


def ball_around(triangles: np.ndarray) -> np.ndarray:
    """Return centre and radius of a ball around triangles, (4,) float64, a little larger than their box.

    triangles: (k, 3, 3), metres; there is one at least
    """
    corners = triangles.reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    half = np.linalg.norm(high - low) / 2
    return np.array([*(low + high) / 2, half + _ROUNDING * (half + np.abs(corners).max())])


def _same_patches(before: PatchScene, after: PatchScene) -> bool:
    """Return whether the same texels are patches."""
    one, other = before.patches, after.patches
    return (
        one.resolution == other.resolution
        and before.texel_to_patch.shape == after.texel_to_patch.shape
        and same_values(one.texel, other.texel)
        and same_values(one.atlas, other.atlas)
    )


def _same_cutouts(before: PatchScene, after: PatchScene) -> bool:
    """Return whether light passes through the same parts of the same triangles."""
    if not (before.cutouts.needed or after.cutouts.needed):
        return True
    materials = before.triangles.material, after.triangles.material
    return np.array_equal(*materials) and same_values(before.cutouts, after.cutouts)


def _ranges_of_meshes(triangles: Triangles) -> np.ndarray:
    """Return where the triangles of each mesh begin, and all end, (meshes + 1,) int64."""
    meshes = int(triangles.mesh[-1]) + 1 if len(triangles.mesh) else 0
    return np.searchsorted(triangles.mesh, np.arange(meshes + 1))


def _unmoved(
    before: Triangles, after: Triangles, first: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which triangles, (t,) bool of each, are where they were, in the world and on their lightmap.

    first, other: where their meshes begin; of a mesh with another number of triangles all have moved
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
    """Return which triangles, (t,) bool, may look up a texel of a mask, (atlases, r, r) bool.

    That is those whose box on the lightmap has such a texel: sums over boxes are differences of sums over
    rows and columns (Crow 1984).
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
