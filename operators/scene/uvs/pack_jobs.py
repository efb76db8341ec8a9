"""The squares that new lightmap UVs are packed into: an atlas, or the tile of a mesh of several objects."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ....engine.unwrap.unwrapping import PackJob
from ..units import texels_per_unit
from .multi_user import instanced_objects, multi_user_sources
from .object_lookup import ObjectLookup
from .uv_targets import UnwrapMesh

#: Least width that the tile of a mesh is packed for, texels.
_LEAST_TILE = 64


def mip_width(properties: bpy.types.PropertyGroup) -> int:
    """Return the width of a texel of the coarsest mip level with padding, in texels of the lightmap."""
    return 1 << properties.mip_level


def squares_of(
    targets: Sequence[UnwrapMesh],
    objects: ObjectLookup,
    uv_layer: str,
    resolution: int,
    properties: bpy.types.PropertyGroup,
    one_page: bool,
) -> tuple[list[PackJob], list[str | None]]:
    """Return the squares whose meshes have to lie side by side, and the atlas of each, None for a tile.

    targets     with their areas
    resolution  width of lightmaps, texels
    properties  how charts are laid: the scene's settings
    one_page    True if no atlas is spread over several lightmaps, however dense
    """
    multi_user, instanced = multi_user_sources(uv_layer), instanced_objects()
    squares: list[PackJob] = []
    atlases: list[str | None] = []
    width = max(resolution // mip_width(properties), 1)
    padding, align = properties.padding, properties.align_charts
    pages, density = (1, 0.0) if one_page else _pages_and_density(properties)
    for atlas, members in _by_atlas(targets).items():
        tiled = [index for index in members if _is_tiled(targets[index], objects, multi_user, instanced)]
        untiled = tuple(index for index in members if index not in tiled)
        if untiled:
            squares.append(PackJob(untiled, width, padding, pages, density / mip_width(properties), align))
            atlases.append(atlas)
        area = sum(targets[index].area for index in members)
        for index in tiled:
            tile = _tile_width(targets[index].area, area, width)
            squares.append(PackJob((index,), tile, padding, align=align))
            atlases.append(None)
    return squares, atlases


def _pages_and_density(properties: bpy.types.PropertyGroup) -> tuple[int, float]:
    """Return over how many lightmaps new UVs are spread, and the texels per unit wanted, 0 for any."""
    if properties.size_mode == "DENSITY":
        return 1, texels_per_unit(properties)
    return properties.lightmap_count, 0.0


def _by_atlas(targets: Sequence[UnwrapMesh]) -> dict[str, list[int]]:
    """Return which targets, by number, belong to each atlas."""
    groups: dict[str, list[int]] = {}
    for index, target in enumerate(targets):
        groups.setdefault(target.atlas, []).append(index)
    return groups


def _is_tiled(target: UnwrapMesh, objects: ObjectLookup, multi_user: set[int], instanced: set[int]) -> bool:
    """Return whether several objects, or instances, may show a mesh, which gets a square to itself."""
    first = objects[target.uids[0]]
    if target.topology is None:
        return first.data.session_uid in multi_user
    return len(target.uids) > 1 or first.session_uid in instanced


def _tile_width(area: float, total: float, resolution: int) -> int:
    """Return about how many texels wide the tile of a mesh will be, of the total area of its atlas."""
    scale = np.sqrt(area / total) if total > 0 else 1.0
    return int(np.clip(resolution * scale, min(_LEAST_TILE, resolution), resolution))
