"""Turns objects whose lightmap UVs overlap other objects' UVs into occluders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...engine.scene.model import NO_LIGHTMAP, Mesh, Scene
from .messages import OVERLAPPING, Issues
from .read import ReadScene
from .uvs.uv_faults import covered_texels

#: Number of texels that may be covered twice by rounding errors; or, if it is more, this fraction of the
#: object's texels.
_ALLOWED = 2
_ALLOWED_FRACTION = 0.005


def without_overlaps(read: ReadScene, resolution: int) -> ReadScene:
    """Return the scene without overlapping charts: of overlapping objects all but the first are occluders."""
    overlapping = set(_overlapping(read.scene, resolution))
    issues = Issues()
    for index in overlapping:
        issues.add(OVERLAPPING, read.scene.meshes[index].name)
    meshes = tuple(
        replace(mesh, atlas=NO_LIGHTMAP) if index in overlapping else mesh
        for index, mesh in enumerate(read.scene.meshes)
    )
    gone = {read.entries[index] for index in overlapping}
    objects = {entry.uid for entry in gone if entry is not None}
    return replace(
        read,
        scene=replace(read.scene, meshes=meshes),
        entries=tuple(None if entry in gone else entry for entry in read.entries),
        notes=(*read.notes, *issues.messages()),
        fingerprints={uid: digest for uid, digest in read.fingerprints.items() if uid not in objects},
    )


def _overlapping(scene: Scene, resolution: int) -> list[int]:
    """Return the indices of meshes whose charts overlap themselves or charts of earlier meshes."""
    taken = np.zeros((len(scene.atlases), resolution * (resolution + 1)), bool)
    return [
        index
        for index, mesh in enumerate(scene.meshes)
        if mesh.atlas != NO_LIGHTMAP and _clashing(mesh, taken[mesh.atlas], resolution)
    ]


def _clashing(mesh: Mesh, taken: np.ndarray, resolution: int) -> bool:
    """Return True if charts of a mesh overlap taken texels or each other.

    Otherwise mark their texels as taken.
    """
    texels, count = covered_texels(mesh.uvs, resolution)
    clashing = (count > 1) | taken[texels]
    if clashing.sum() > max(_ALLOWED_FRACTION * len(texels), _ALLOWED):
        return True
    taken[texels] = True
    return False
