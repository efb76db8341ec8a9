"""Lists the squares that new charts are packed into: an atlas, or the tile of a mesh with several users."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ....engine.unwrap.unwrapping import PackJob
from ..units import texels_per_unit
from .multi_user import instanced_objects, multi_user_sources
from .object_lookup import ObjectLookup
from .uv_targets import UnwrapMesh

#: Smallest width for which the tile of a shared mesh is packed, texels.
_LEAST_TILE = 64


def mip_width(properties: bpy.types.PropertyGroup) -> int:
    """Return the width of one texel of the coarsest padded mip level, in texels of the lightmap."""
    return 1 << properties.mip_level


def squares_of(
    targets: Sequence[UnwrapMesh],
    objects: ObjectLookup,
    uv_layer: str,
    resolution: int,
    properties: bpy.types.PropertyGroup,
    one_page: bool,
) -> tuple[list[PackJob], list[str | None]]:
    """Return the packing jobs, and the atlas of each job, None for the tile of a shared mesh.

    targets:     meshes to pack, with measured areas
    resolution:  width of lightmaps, texels
    properties:  the scene's settings of packing: padding, mip level, alignment, number of lightmaps, density
    one_page:    True if no atlas may be spread over several lightmaps, whatever density is wanted
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
    """Return the number of lightmaps to spread UVs over, and the wanted texels per unit, 0 for no target."""
    if properties.size_mode == "DENSITY":
        return 1, texels_per_unit(properties)
    return properties.lightmap_count, 0.0


def _by_atlas(targets: Sequence[UnwrapMesh]) -> dict[str, list[int]]:
    """Return the indices of the targets of each atlas, by the name of the atlas."""
    groups: dict[str, list[int]] = {}
    for index, target in enumerate(targets):
        groups.setdefault(target.atlas, []).append(index)
    return groups


def _is_tiled(target: UnwrapMesh, objects: ObjectLookup, multi_user: set[int], instanced: set[int]) -> bool:
    """Return True if several objects or instances may use the mesh, which then gets a tile of its own."""
    first = objects[target.uids[0]]
    if target.topology is None:
        return first.data.session_uid in multi_user
    return len(target.uids) > 1 or first.session_uid in instanced


def _tile_width(area: float, total: float, resolution: int) -> int:
    """Return the estimated width of a mesh's tile, texels: square root of its share of the atlas's area."""
    scale = np.sqrt(area / total) if total > 0 else 1.0
    return int(np.clip(resolution * scale, min(_LEAST_TILE, resolution), resolution))
