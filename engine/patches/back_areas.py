"""Exact areas of the patches of back faces, whose coarse texels are cut or shared by triangles."""

from __future__ import annotations

import numpy as np

from ..array_ops import all_in_rows, taken
from ..scene.triangles import Triangles
from .geometry import PatchGeometry
from .patch_list import PatchList
from .unmapped_meshes import BACKS


def back_areas(
    triangles: Triangles, backs: np.ndarray, patches: PatchList, geometry: PatchGeometry
) -> tuple[np.ndarray, np.ndarray]:
    """Return the patches in blocks of back faces, (k,) int64, and the area of each, (k,) float32, m^2.

    The diagonal of a block cuts texels, and all small triangles of a cluster share one texel; see
    `unmapped_meshes`.

    backs:  (s,) int32, as `Triangles.backs`
    """
    blocks = _blocks_of(triangles, backs)
    corners = triangles.uvs[blocks] * np.float32(patches.resolution)
    low = np.floor(corners[:, 0]).astype(np.int64)
    width = corners[:, 1, 0] - corners[:, 0, 0]
    is_small = width < 1
    whole, areas = geometry.steps.whole, np.zeros(len(patches))

    # Triangles that show one texel.
    small = blocks[is_small]
    key = triangles.atlas[small].astype(np.int64) * patches.resolution**2
    key += low[is_small, 1] * patches.resolution + low[is_small, 0]
    place = np.searchsorted(patches.key, key).clip(max=len(patches) - 1)
    is_shown = patches.key[place] == key
    np.add.at(areas, place[is_shown], whole[small[is_shown]].astype(np.float64))

    # Texels of the others.
    number = np.full(len(triangles.mesh), -1, np.int32)
    number[blocks] = np.arange(len(blocks), dtype=np.int32)
    first = patches.count_in(int(triangles.atlas[blocks].min())) if len(blocks) else len(patches)
    block = number[patches.triangle[first:]]
    on_block = first + np.flatnonzero(block >= 0)
    block = block[on_block - first]
    larger, mine = on_block[~is_small[block]], block[~is_small[block]]
    row, column = np.divmod(patches.texel[larger], patches.resolution)
    span = np.rint(width[mine] + BACKS.low + BACKS.high)
    share = _share(column - low[mine, 0], row - low[mine, 1], span)
    total = np.bincount(mine, share, len(blocks))[mine]
    areas[larger] = whole[patches.triangle[larger]].astype(np.float64) * share / total
    return on_block, areas[on_block].astype(np.float32)


def _blocks_of(triangles: Triangles, backs: np.ndarray) -> np.ndarray:
    """Return the back faces that lie in blocks of texels, (b,) int64; see `unmapped_meshes`.

    All others mirror the chart of their front face. A triangle that shares one texel with others has all
    corners at the texel's centre and counts as a block, although its front may have the same UVs.
    """
    front = np.flatnonzero(backs >= 0)
    back = backs[front]
    own, flipped = taken(triangles.uvs, back), taken(triangles.uvs, front)[:, [0, 2, 1]]
    is_mirrored = all_in_rows((own == flipped).reshape(-1, 6))
    is_point = all_in_rows((own == own[:, :1]).reshape(-1, 6))
    blocks: np.ndarray = back[~is_mirrored | is_point].astype(np.int64)
    return blocks


def _share(x: np.ndarray, y: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the area of each texel that the triangle of its block covers, (n,) float64, texels.

    x, y: (n,) int, column and row in the block; width: (n,) of the block, texels
    """
    left, low = np.maximum(x, BACKS.low), np.maximum(y, BACKS.low)
    end = width - BACKS.high + BACKS.low

    def beyond(column: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Return the covered area above and to the right of a point of the block, (n,) float64, texels."""
        area: np.ndarray = np.maximum(end - column - row, 0) ** 2 / 2
        return area

    return beyond(left, low) - beyond(x + 1, low) - beyond(left, y + 1) + beyond(x + 1, y + 1)
