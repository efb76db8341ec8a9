"""Which texels triangles touch: to find overlapping charts, and surfaces that cover no texel's centre."""

from __future__ import annotations

import numpy as np

from ..device.graphics import Graphics
from ..errors import OverlapError
from ..naming import naming
from ..scene.model import Scene
from ..scene.triangles import Triangles
from .chart_raster import OVERLAP, TOUCHED, draw_charts
from .patch_list import PatchList

#: Charts overlap if more than this fraction of an object's texels is covered twice.
_OVERLAP_TOLERANCE = 0.005


def touched_triangles(graphics: Graphics, triangles: Triangles, atlases: int, resolution: int) -> np.ndarray:
    """Return the triangle that touches each texel, nearest to its centre, or -1.

    Returns (atlases, resolution, resolution) int32, index into `Triangles`.
    """
    touched = np.full((atlases, resolution, resolution), -1, np.int32)
    for atlas in range(atlases):
        chosen = np.flatnonzero(triangles.atlas == atlas)
        (number,) = draw_charts(graphics, TOUCHED, triangles.uvs[chosen], resolution)
        touched[atlas] = np.concatenate([[-1], chosen]).astype(np.int32)[number].reshape(touched[atlas].shape)
    return touched


def note_uncovered(scene: Scene, triangles: Triangles, patches: PatchList) -> list[str]:
    """Return a warning that names the objects whose UVs cover no texel's centre."""
    texels = np.bincount(triangles.mesh[patches.triangle], minlength=len(scene.meshes))
    names = [
        mesh.name for mesh, count in zip(scene.meshes, texels, strict=True) if not count and len(mesh.face)
    ]
    if not names:
        return []
    sentence = (
        "The lightmap UVs of {} are too small to cover a texel: their light is a guess. "
        "Unwrap them again or raise the resolution."
    )
    return [naming(sentence, names)]


def check_overlap(graphics: Graphics, scene: Scene, triangles: Triangles, patches: PatchList) -> list[str]:
    """Return a warning for each object a few of whose texels are covered by several triangles.

    Raises OverlapError, naming the objects, if charts truly overlap.
    """
    counts = []
    for atlas in range(len(scene.atlases)):
        uvs = triangles.uvs[triangles.atlas == atlas]
        (count,) = draw_charts(graphics, OVERLAP, uvs, patches.resolution)
        counts.append(count[patches.texel[patches.atlas == atlas], 0])
    twice, mesh = np.concatenate(counts) > 1.5, triangles.mesh[patches.triangle]

    # Fractions of each object's texels; rounding at common chart borders doubles a few texels at most.
    total = np.bincount(mesh, minlength=len(scene.meshes))
    doubled = np.bincount(mesh[twice], minlength=len(scene.meshes))
    bad = doubled > np.maximum(_OVERLAP_TOLERANCE * total, 2)
    if bad.any():
        raise OverlapError(_overlap_message(scene, triangles, patches, np.flatnonzero(twice & bad[mesh])))
    return [
        naming(
            f"Object {{}}: {doubled[index]} lightmap texels are covered twice.", [scene.meshes[index].name]
        )
        for index in np.flatnonzero(doubled)
    ]


def _overlap_message(scene: Scene, triangles: Triangles, patches: PatchList, doubled: np.ndarray) -> str:
    """Name the objects that meet in a sample of the doubled texels."""
    sample = doubled[:: max(1, len(doubled) // 64)]
    meshes = {int(mesh) for patch in sample for mesh in _meshes_at(triangles, patches, int(patch))}
    names = [scene.meshes[mesh].name for mesh in sorted(meshes)]
    atlas = scene.atlases[int(patches.atlas[sample[0]])]
    fraction = len(doubled) / max(1, int(np.isin(triangles.mesh[patches.triangle], list(meshes)).sum()))
    sentence = (
        f"Lightmap UVs overlap in atlas '{atlas}' ({fraction:.0%} of the texels of {{}}). "
        "Unwrap or pack them without overlaps, or give the objects atlases of their own."
    )
    return naming(sentence, names)


def _meshes_at(triangles: Triangles, patches: PatchList, patch: int) -> np.ndarray:
    """Return the meshes of all triangles that cover a patch's texel centre."""
    resolution = patches.resolution
    texel = int(patches.texel[patch])
    center = (np.array([texel % resolution, texel // resolution]) + 0.5) / resolution
    uvs = triangles.uvs[triangles.atlas == patches.atlas[patch]].astype(np.float64)
    from_center = uvs - center
    to_next = np.roll(uvs, -1, axis=1) - uvs
    side = from_center[..., 0] * to_next[..., 1] - from_center[..., 1] * to_next[..., 0]
    inside = (side >= 0).all(axis=1) | (side <= 0).all(axis=1)
    return np.unique(triangles.mesh[triangles.atlas == patches.atlas[patch]][inside])
