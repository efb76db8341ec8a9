"""Back faces of open surfaces as triangles with patches of their own: they reflect and emit like front faces.

Back faces of opaque surfaces lie in additional atlases. Back faces of translucent surfaces mirror the atlas
of their front faces texel by texel, so that each patch has a partner on the other side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..array_ops import map_slabs
from ..scene.memo import Memo
from ..scene.model import NO_LIGHTMAP, BackSide, Material, Mesh, Scene
from ..scene.open_surfaces import OpenSurfaces
from ..scene.transmission import Transmission
from .closed_glass import with_closed_glass
from .unmapped_meshes import BACKS, place_meshes, place_unmapped, texel_size

#: Function of a scene, a mask of its triangles, (t,) bool, and the mean world size of a lightmap texel, m; 0
#: if nothing has a lightmap. It returns the mask of those with a visible back face.
FindVisible = Callable[[Scene, np.ndarray, float], np.ndarray]

#: Order of a triangle's corners seen from its back.
_FLIPPED = np.array([0, 2, 1])

#: Number of triangles below which one operation of NumPy is faster than one for each corner.
_FEW = 1 << 10


def with_places(
    scene: Scene,
    resolution: int,
    surfaces: OpenSurfaces | None = None,
    find_visible: FindVisible | None = None,
    last: Memo[Scene] | None = None,
) -> Scene:
    """Return the scene with lightmap UVs for surfaces without: occluders, and back faces of open surfaces.

    surfaces:      open surfaces of the previous scene; None without one
    find_visible:  chooses the back faces that are visible from a surface; None to use all
    last:          back faces of the previous scene; None without one
    """
    placed, is_chosen, texel = find_candidates(scene, resolution, surfaces or OpenSurfaces())
    if find_visible is not None:
        is_chosen = find_visible(placed, is_chosen, texel)
    return with_backs(placed, is_chosen, resolution, texel, last)


def find_candidates(scene: Scene, resolution: int, surfaces: OpenSurfaces) -> tuple[Scene, np.ndarray, float]:
    """Return the scene with lightmap UVs for occluders, and the arguments of `FindVisible` after the scene.

    surfaces: open surfaces of the previous scene
    """
    texel = texel_size(scene, resolution)
    placed = with_closed_glass(place_unmapped(scene, resolution, texel), surfaces)
    return placed, _is_opaque(placed) & surfaces.of(placed.meshes), texel


def with_backs(
    placed: Scene, is_chosen: np.ndarray, resolution: int, texel: float, last: Memo[Scene] | None = None
) -> Scene:
    """Return the result of `place_backs`, from the previous scene if back faces stay.

    last: back faces of the previous scene; None without one
    """
    if last is None:
        return place_backs(placed, is_chosen, resolution, texel)
    materials, numbers = _materials_of_backs(placed.materials)
    key = (placed.meshes, placed.atlases, is_chosen, _translucent(placed), numbers, resolution, texel)
    made = last.get(key, lambda: place_backs(placed, is_chosen, resolution, texel))
    if len(made.meshes) == len(placed.meshes):
        return placed
    return replace(placed, meshes=made.meshes, atlases=made.atlases, materials=materials)


def _translucent(scene: Scene) -> np.ndarray:
    """Return a mask of translucent materials, (m,) bool."""
    return np.array([material.translucent for material in scene.materials], bool)


def place_backs(scene: Scene, is_chosen: np.ndarray, resolution: int, texel: float) -> Scene:
    """Return the scene with an additional mesh for the chosen and the translucent back faces of each mesh.

    scene:      occluders must have lightmap UVs already
    is_chosen:  (t,) bool, opaque triangles of open surfaces whose back faces get patches
    texel:      mean world size of a lightmap texel, m
    """
    translucent = _translucent(scene)
    materials, numbers = _materials_of_backs(scene.materials)
    mirrors: dict[int, int] = {}
    names = list(scene.atlases)
    backs: list[Mesh] = []
    first = 0
    for mesh in scene.meshes:
        last = first + len(mesh.positions)
        coarse, mirrored = is_chosen[first:last], translucent[mesh.material]
        index = np.arange(first, last, dtype=np.int32)
        if coarse.any():
            backs.append(_flipped(_part(mesh, coarse), index[coarse], numbers, NO_LIGHTMAP))
        if mirrored.any():
            if mesh.atlas not in mirrors:
                mirrors[mesh.atlas] = len(names)
                names.append("(translucent backs)")
            backs.append(_flipped(mesh.subset(mirrored), index[mirrored], numbers, mirrors[mesh.atlas]))
        first = last
    if not backs:
        return scene
    placed = replace(scene, meshes=(*scene.meshes, *backs), materials=materials, atlases=tuple(names))
    return place_meshes(placed, resolution, "(backs)", texel, BACKS)


def _part(mesh: Mesh, chosen: np.ndarray) -> Mesh:
    """Return some triangles of a mesh by a mask, (t,) bool; the mesh itself, without copies, for all."""
    return mesh if chosen.all() else mesh.subset(chosen)


def _is_opaque(scene: Scene) -> np.ndarray:
    """Return a mask of triangles without diffuse or full straight transmission, (t,) bool."""
    opaque = [not (material.translucent or _has_clear_back(material)) for material in scene.materials]
    materials = [mesh.material for mesh in scene.meshes]
    return np.array(opaque, bool)[np.concatenate([np.zeros(0, np.int32), *materials])]


def _has_clear_back(material: Material) -> bool:
    """Return True if gathered light passes straight through all of the back of a material."""
    entry = material.transmission.bounce_back or material.transmission.bounce
    return entry.texture is None and bool((entry.offset >= 1).all())


def _materials_of_backs(materials: tuple[Material, ...]) -> tuple[tuple[Material, ...], np.ndarray]:
    """Return materials, with additional ones for back faces, and the back material of each, (m,) int32."""
    joined, numbers = list(materials), np.arange(len(materials), dtype=np.int32)
    for index, material in enumerate(materials):
        passed = material.transmission
        if material.back is None and passed.shadow_back is None and passed.bounce_back is None:
            continue
        back = material.back or BackSide(
            material.reflectance, material.emission, material.reflectance_map, material.emission_map
        )
        numbers[index] = len(joined)
        joined.append(replace(
            material, reflectance=back.reflectance, emission=back.emission,
            reflectance_map=back.reflectance_map, emission_map=back.emission_map,
            transmission=_turned(passed), back=None,
        ))  # fmt: skip
    return tuple(joined), numbers


def _turned(passed: Transmission) -> Transmission:
    """Return the transmittance of a surface seen from its other side."""
    shadow, bounce = passed.shadow_back or passed.shadow, passed.bounce_back or passed.bounce
    return Transmission(shadow, bounce, passed.shadow, passed.bounce)


def _flipped(mesh: Mesh, index: np.ndarray, materials: np.ndarray, atlas: int) -> Mesh:
    """Return the back faces of a mesh, in an atlas.

    index:      (t,) int32, indices of the mesh's triangles in the scene
    materials:  (m,) int32, material of the back face for each material
    """
    return replace(
        mesh,
        positions=_in_opposite_order(mesh.positions),
        normals=-_in_opposite_order(mesh.normals),
        uvs=_in_opposite_order(mesh.uvs),
        material=materials[mesh.material],
        texture_uvs={name: _in_opposite_order(uvs) for name, uvs in mesh.texture_uvs.items()},
        atlas=atlas,
        front=index,
    )


def _in_opposite_order(corners: np.ndarray) -> np.ndarray:
    """Return values of corners, (t, 3, c), in the opposite order."""
    if len(corners) < _FEW:
        return corners.take(_FLIPPED, axis=1)
    flipped = np.empty(corners.shape, corners.dtype)

    def flip(rows: slice) -> None:
        for corner, other in enumerate(_FLIPPED):
            flipped[rows, corner] = corners[rows, other]

    map_slabs(len(corners), 2 * flipped.nbytes // max(len(corners), 1), flip)
    return flipped
