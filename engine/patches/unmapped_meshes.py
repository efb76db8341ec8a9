"""Places for surfaces without a lightmap: they reflect and emit, so they need patches, at low density.

They lie in atlases of the engine's own, mostly one. A triangle larger than a texel's world size gets a square
block of texels; smaller ones of like position, direction and material have a single texel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..scene.model import NO_LIGHTMAP, Mesh, Scene

#: World size of a texel of an occluder, in texels of the lightmaps.
_COARSENESS = 4.0

#: Growth of that size while the places do not fit into the atlases.
_STEP = 1.25

#: Texels of the atlases for each cluster that remains however large a texel is: the rest is left to detail.
_LEAST_TEXELS = 2

#: Corners of a triangle in its block of k texels: first, and k minus second. They cover the centres of
#: all texels below the diagonal and touch no texel of another block.
_LOW, _HIGH = 0.1, 0.05


@dataclass(frozen=True)
class _Places:
    """Where triangles go, (t,) each.

    block   number of each triangle's block; triangles of one cluster have one block of one texel
    chosen  True for the triangle that the block's patches lie on
    level   the side of its block is 2 ** level texels
    texels  size of all blocks
    """

    block: np.ndarray
    chosen: np.ndarray
    level: np.ndarray
    texels: int


def place_unmapped(scene: Scene, resolution: int) -> Scene:
    """Return the scene with lightmap UVs for its occluders in further atlases, if it has any.

    An occluder that lies in several of these becomes a mesh in each.
    """
    return place_meshes(scene, resolution, "(occluders)", texel_size(scene, resolution))


def place_meshes(scene: Scene, resolution: int, name: str, texel: float) -> Scene:
    """Return the scene with lightmap UVs for its meshes of atlas NO_LIGHTMAP in further atlases of a name.

    texel: mean world size of a lightmap texel, m; 0 if nothing has a lightmap
    """
    meshes = [mesh for mesh in scene.meshes if mesh.atlas == NO_LIGHTMAP and len(mesh.positions)]
    if not meshes:
        return scene
    side = 1 << (resolution.bit_length() - 1)
    atlas, texels = _pack(_fitting_places(meshes, resolution, side * side, texel), side)
    atlas += len(scene.atlases)
    ends = np.cumsum([len(mesh.positions) for mesh in meshes])[:-1]
    parts = zip(np.split(atlas, ends), np.split(texels / np.float32(resolution), ends), strict=True)
    placed: list[Mesh] = []
    for mesh in scene.meshes:
        if mesh.atlas == NO_LIGHTMAP and len(mesh.positions):
            placed += _in_atlases(mesh, *next(parts))
        else:
            placed.append(replace(mesh, atlas=max(mesh.atlas, 0)))
    names = [name] * (int(atlas.max()) + 1 - len(scene.atlases))
    return replace(scene, meshes=tuple(placed), atlases=(*scene.atlases, *names))


def _in_atlases(mesh: Mesh, atlas: np.ndarray, uvs: np.ndarray) -> list[Mesh]:
    """Return a mesh with its triangles' atlases, (t,), and UVs, (t, 3, 2): one part for each atlas."""
    mesh = replace(mesh, uvs=uvs)
    return [replace(mesh.part(atlas == index), atlas=int(index)) for index in np.unique(atlas)]


def _fitting_places(meshes: list[Mesh], resolution: int, capacity: int, texel: float) -> _Places:
    """Return places for all triangles of occluders, coarser and coarser until they fit.

    They fit into as few atlases, of `capacity` texels each, as hold _LEAST_TEXELS for every cluster that
    remains however coarse they are.
    """
    positions = np.concatenate([mesh.positions for mesh in meshes]).astype(np.float64)
    kinds = np.stack(
        [
            np.repeat(np.arange(len(meshes)), [len(mesh.positions) for mesh in meshes]),
            np.concatenate([mesh.material for mesh in meshes]),
            _dominant_axis(positions),
        ],
        axis=1,
    )
    least = _LEAST_TEXELS * (int(_unique_rows(kinds).max()) + 1)
    texels = -(-least // capacity) * capacity
    size = _COARSENESS * texel
    size = size if size > 0 else float(np.ptp(positions.reshape(-1, 3), axis=0).max()) / resolution + 1e-12
    longest = np.linalg.norm(positions - np.roll(positions, 1, axis=1), axis=2).max(axis=1)
    area = _areas(positions)
    while True:
        places = _places_at(positions.mean(axis=1), longest, area, kinds, size)
        if places.texels <= texels and 4 ** int(places.level.max()) <= capacity:
            return places
        size *= _STEP


def texel_size(scene: Scene, resolution: int) -> float:
    """Return the mean world size of a lightmap texel, m; 0 if nothing has a lightmap."""
    world = charts = 0.0
    for mesh in scene.meshes:
        if mesh.atlas != NO_LIGHTMAP:
            first, second = np.moveaxis(mesh.positions[:, 1:] - mesh.positions[:, :1], 1, 0)
            world += float(np.linalg.norm(np.cross(first, second), axis=1).sum(dtype=np.float64))
            u, v = np.moveaxis(mesh.uvs[:, 1:] - mesh.uvs[:, :1], 1, 0)
            charts += float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum(dtype=np.float64))
    return float(np.sqrt(world / charts)) / resolution if charts > 0 else 0.0


def _areas(positions: np.ndarray) -> np.ndarray:
    """Return twice the area of each triangle, (t,) float64."""
    first, second = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    doubled: np.ndarray = np.linalg.norm(np.cross(first, second), axis=1)
    return doubled


def _dominant_axis(positions: np.ndarray) -> np.ndarray:
    """Return which of the six directions along the axes each triangle faces most, (t,) int."""
    normal = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    axis = np.abs(normal).argmax(axis=1)
    facing: np.ndarray = 2 * axis + (normal[np.arange(len(normal)), axis] < 0)
    return facing


def _places_at(
    centers: np.ndarray, longest: np.ndarray, area: np.ndarray, kinds: np.ndarray, size: float
) -> _Places:
    """Return the places of triangles if a texel is `size` metres wide."""
    level = np.ceil(np.log2(np.maximum(longest / size, 1.0))).astype(np.int64)
    level = np.minimum(level, 13)

    # Small triangles are one cluster where kind and cell of a grid are the same.
    cells = np.floor((centers - centers.min(axis=0)) / size).astype(np.int64)
    keys = np.column_stack([np.where(level > 0, np.arange(len(level)) + 1, 0), kinds, cells])
    keys[level > 0, 1:] = 0
    block = _unique_rows(keys)

    # One triangle represents its cluster, drawn with a probability in proportion to its area (Efraimidis and
    # Spirakis, 2006). The largest triangles would be a biased choice: hair was 14 % too bright.
    draw = np.random.default_rng(len(level)).exponential(size=len(level))
    order = np.lexsort((draw / np.maximum(area, 1e-300), block))
    first = np.r_[True, np.diff(block[order]) > 0]
    chosen = np.zeros(len(block), bool)
    chosen[order[first]] = True
    return _Places(block, chosen, level, int((4 ** level[chosen]).sum()))


def _unique_rows(keys: np.ndarray) -> np.ndarray:
    """Return the number of the distinct row that each row equals, (t,) int."""
    order = np.lexsort(keys.T)
    ordered = keys[order]
    new = np.r_[False, (ordered[1:] != ordered[:-1]).any(axis=1)]
    number = np.empty(len(keys), np.int64)
    number[order] = np.cumsum(new)
    return number


def _pack(places: _Places, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Return each triangle's atlas, (t,) int64 from 0 on, and its corners' texels there, (t, 3, 2) float32.

    Blocks whose sides are powers of two, the largest first along a Z-order curve, leave no gaps
    (Morton 1966), and none lies across the end of an atlas.
    """
    chosen = np.flatnonzero(places.chosen)
    chosen = chosen[np.argsort(-places.level[chosen], kind="stable")]
    sizes = 4 ** places.level[chosen]
    start = np.zeros(int(places.block.max()) + 1, np.int64)
    start[places.block[chosen]] = np.cumsum(sizes) - sizes
    atlas, code = np.divmod(start[places.block], side * side)
    origin = np.stack([_even_bits(code), _even_bits(code >> 1)], axis=1).astype(np.float32)

    # Chosen triangles span their block; the others of a cluster meet in the centre of its texel.
    high = (2.0**places.level - _HIGH).astype(np.float32)
    corners = np.full((len(code), 3, 2), _LOW, np.float32)
    corners[:, 1, 0] = corners[:, 2, 1] = high
    corners[~places.chosen] = 0.5
    return atlas, origin[:, None] + corners


def _even_bits(code: np.ndarray) -> np.ndarray:
    """Return the number made of the even bits of a code."""
    bits = code & 0x5555555555555555
    for shift, mask in (
        (1, 0x3333333333333333),
        (2, 0x0F0F0F0F0F0F0F0F),
        (4, 0x00FF00FF00FF00FF),
        (8, 0x0000FFFF0000FFFF),
        (16, 0x00000000FFFFFFFF),
    ):
        bits = (bits | (bits >> shift)) & mask
    return bits
