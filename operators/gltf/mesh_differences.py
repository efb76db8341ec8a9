"""Finds objects whose exported viewport meshes do not fit the light that was baked on the render meshes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...engine.object_message import object_message
from ..scene import SceneContext
from ..scene.objects.render_differences import uses_render
from ..scene.uvs.uv_projection import UvMesh, UvProjection
from ..scene.uvs.viewport_uvs import read_pairs
from .export_items import ExportItem

_OFF = (
    "Exported with the viewport's mesh, which differs from the baked one: {}. Light is displaced by more "
    "than a texel. Use the same modifier settings for viewport and renders, and bake again."
)


def note_other_meshes(context: SceneContext, surfaces: Sequence[ExportItem], uv_layer: str) -> list[str]:
    """Return a sentence naming objects whose lightmap UVs are off by more than a texel; empty without any.

    UVs of the viewport's mesh are compared with those at the nearest points of the baked mesh.
    """
    if context.scene.hemibake.meshes == "VIEWPORT" or not uses_render(context):
        return []
    width: dict[int, float] = {}
    objects = {}
    for surface in surfaces:
        if surface.place is not None:
            uid, texels = surface.source.session_uid, surface.place.scale * surface.place.image.size[0]
            objects[uid], width[uid] = surface.source, max(width.get(uid, 0.0), texels)
    names = [
        objects[uid].name
        for uid, (baked, shown) in read_pairs(context, list(objects.values()), uv_layer).items()
        if not _is_same(baked, shown) and _error(baked, shown) * width[uid] > 1
    ]
    return [object_message(_OFF, names)] if names else []


def _is_same(baked: UvMesh, shown: UvMesh) -> bool:
    """Return True if two meshes have equal faces, positions and UVs."""
    return (
        baked.has_faces_of(shown)
        and np.array_equal(baked.positions, shown.positions)
        and baked.uvs is not None
        and shown.uvs is not None
        and np.array_equal(baked.uvs, shown.uvs)
    )


def _error(baked: UvMesh, shown: UvMesh) -> float:
    """Return the largest error of the viewport mesh's UVs, in UV units."""
    return np.inf if shown.uvs is None else UvProjection(baked).largest_error(shown)
