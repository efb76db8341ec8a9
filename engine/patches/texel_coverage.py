"""Texel coverage by triangles: border texels, overlapping charts, and objects without any patch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..array_ops import any_in_rows, indices_where, taken
from ..device.device_rows import Rows, device_rows, rows_at
from ..device.gl_context import GraphicsContext
from ..errors import OverlapError
from ..object_message import counted, object_message
from ..scene.model import Scene
from ..scene.triangles import Triangles
from .border_texels import BorderTexels
from .chart_raster import OVERLAP, TOUCHED, draw_atlas, drawn_triangles
from .device_charts import DeviceCharts, listed_entries
from .geometry import PatchGeometry
from .patch_list import PatchList

#: Fraction of an object's texels that may be covered twice before its charts count as overlapping.
_OVERLAP_TOLERANCE = 0.005


def border_texels_on(charts: DeviceCharts, entries: Rows) -> BorderTexels:
    """Return the border texels as `border_texels` does, on the OpenCL device."""
    own = device_rows(charts.compute, entries)
    listed = listed_entries(charts.compute, charts.numbers, charts.atlases, charts.texels, own)
    return BorderTexels(*listed)


def border_texels(
    graphics: GraphicsContext, triangles: Triangles, texel_to_patch: np.ndarray
) -> BorderTexels:
    """Return the texels without patch in an index map, (atlases, r, r) uint32, that a triangle touches."""
    found = [
        _border_texels_in(graphics, triangles, atlas, covered) for atlas, covered in enumerate(texel_to_patch)
    ]
    texel, triangle = zip(*found, strict=True)
    return BorderTexels(np.concatenate(texel), np.concatenate(triangle))


def _border_texels_in(
    graphics: GraphicsContext, triangles: Triangles, atlas: int, covered: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the border texels of one atlas and the touching triangle nearest to each centre."""
    (number,) = draw_atlas(graphics, TOUCHED, triangles, atlas, len(covered))
    touched, own = number[:, 0], covered.ravel()
    texel = indices_where(len(touched), 8, lambda slab: (touched[slab] != 0) & (own[slab] == 0))
    return atlas * covered.size + texel, drawn_triangles(triangles, atlas, taken(touched, texel))


def warn_uncovered(scene: Scene, texels: np.ndarray) -> list[str]:
    """Return warnings that name objects without area and objects whose charts cover no texel centre.

    texels:  (objects,) int64, see `covered_texels`
    """
    filled = [mesh for mesh in scene.meshes if len(mesh.face)]
    shrunk = dict.fromkeys(
        mesh.name
        for mesh, has_area in zip(filled, _have_area([mesh.positions[0] for mesh in filled]), strict=True)
        if not (has_area or _have_area(mesh.positions).any())
    )
    small = [
        mesh.name
        for mesh, count in zip(scene.meshes, texels, strict=True)
        if not count and len(mesh.face) and mesh.name not in shrunk
    ]
    sentences = {
        "The lightmap UVs of {} are too small to cover a texel: their light is a guess. "
        "Unwrap them again or raise the resolution.": small,
        "Scale is 0, so that no light arrives: {}. Set a scale other than 0.": list(shrunk),
    }
    return [object_message(sentence, names) for sentence, names in sentences.items() if names]


def _have_area(positions: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Return a mask of triangles, (t, 3, 3), with an area, (t,) bool."""
    edges = np.diff(np.asarray(positions, np.float64).reshape(-1, 3, 3), axis=1)
    have: np.ndarray = any_in_rows(np.cross(edges[:, 0], edges[:, 1]))
    return have


def covered_texels(scene: Scene, geometry: PatchGeometry) -> np.ndarray:
    """Return the number of patches of each object, (objects,) int64."""
    mesh = geometry.triangles.mesh
    texels: np.ndarray = np.bincount(mesh, geometry.on_triangle, len(scene.meshes)).astype(np.int64)
    return texels


def cover_counts(
    graphics: GraphicsContext, triangles: Triangles, atlases: int, resolution: int
) -> list[np.ndarray]:
    """Return the number of triangles that cover each texel centre, (h, r) uint8 for each atlas.

    Rows above the first h have no charts.
    """
    drawn = (draw_atlas(graphics, OVERLAP, triangles, atlas, resolution)[0] for atlas in range(atlases))
    return [counts.reshape(-1, resolution) for counts in drawn]


def check_overlap(
    scene: Scene,
    triangles: Triangles,
    patches: PatchList,
    counts: Sequence[np.ndarray],
    texels: np.ndarray,
) -> list[str]:
    """Return a warning about all objects with a few texels covered by several triangles.

    counts:  (h, r) uint8 of each atlas, see `cover_counts`
    texels:  (objects,) int64, see `covered_texels`

    Raises OverlapError that names the objects if the charts overlap.
    """
    found = [
        atlas * patches.resolution**2 + np.flatnonzero(count > 1)
        for atlas, count in enumerate(counts)
        if count.max(initial=0) > 1
    ]
    if not found:
        return []
    entries = rows_at(patches.index.entries_in(len(scene.atlases)), np.concatenate(found)).astype(np.int64)
    twice = entries[entries > 0] - 1
    mesh = triangles.mesh[rows_at(patches.triangle_rows, twice)]

    # Rounding errors at shared chart borders make at most a few texels count twice.
    doubled = np.bincount(mesh, minlength=len(scene.meshes))
    bad = doubled > np.maximum(_OVERLAP_TOLERANCE * texels, 2)
    if bad.any():
        raise OverlapError(_overlap_message(scene, triangles, patches, twice[bad[mesh]]))
    covered = np.flatnonzero(doubled)
    sentence = (
        f"{{}}: {counted(int(doubled.sum()), 'lightmap texel')} at borders of charts covered twice. "
        "If edges look wrong there, unwrap or pack with more padding."
    )
    return [object_message(sentence, [scene.meshes[index].name for index in covered])] if len(covered) else []


def _overlap_message(scene: Scene, triangles: Triangles, patches: PatchList, doubled: np.ndarray) -> str:
    """Return an error message that names the objects that overlap in a sample of the texels."""
    sample = doubled[:: max(1, len(doubled) // 64)]
    meshes = {int(mesh) for patch in sample for mesh in _meshes_at(triangles, patches, int(patch))}
    names = [scene.meshes[mesh].name for mesh in sorted(meshes)]
    atlas = scene.atlases[int(patches.atlas[sample[0]])]
    fraction = len(doubled) / max(1, int(np.isin(triangles.mesh[patches.triangle], list(meshes)).sum()))
    sentence = (
        f"Lightmap UVs overlap in atlas '{atlas}' ({fraction:.0%} of the texels of {{}}). "
        "Unwrap or pack them without overlaps, or give the objects atlases of their own."
    )
    return object_message(sentence, names)


def _meshes_at(triangles: Triangles, patches: PatchList, patch: int) -> np.ndarray:
    """Return the meshes of all triangles that cover the centre of a patch's texel."""
    resolution = patches.resolution
    texel = int(patches.texel[patch])
    center = (np.array([texel % resolution, texel // resolution]) + 0.5) / resolution
    uvs = triangles.uvs[triangles.atlas == patches.atlas[patch]].astype(np.float64)
    from_center = uvs - center
    to_next = np.roll(uvs, -1, axis=1) - uvs
    side = from_center[..., 0] * to_next[..., 1] - from_center[..., 1] * to_next[..., 0]
    inside = (side >= 0).all(axis=1) | (side <= 0).all(axis=1)
    return np.unique(triangles.mesh[triangles.atlas == patches.atlas[patch]][inside])
