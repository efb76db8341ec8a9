"""Objects that lie inside other geometry as a whole, so that no light of the scene reaches them."""

from __future__ import annotations

import numpy as np

from ..object_message import object_message
from ..patches.patch_scene import PatchScene
from ..scene.model import Scene

_SENTENCE = (
    "{}: inside other geometry or under a touching face, so the lightmap shows the light around it. If it "
    "stands in a room, recalculate the normals of the room. Otherwise set its role to No Lightmap."
)

#: One row of this many is examined first, since most scenes have light on all objects (chosen).
_ROWS = 16


def warn_buried(scene: Scene, patch_scene: PatchScene, known: np.ndarray) -> list[str]:
    """Return a warning that names the objects without a texel of valid light.

    known:  (atlases, r, r) bool, texels with valid light
    """
    if _all_lit(scene, patch_scene, known):
        return []
    meshes = len(scene.meshes)
    of_entry = np.append(meshes, patch_scene.triangles.mesh[patch_scene.patches.triangle])
    has_texel, has_light = np.zeros((2, len(of_entry)), bool)
    for entries, valid in zip(patch_scene.texel_to_patch, known, strict=False):
        has_texel[entries] = True
        has_light[entries[valid]] = True
    shown, lit = (
        np.bincount(of_entry[mask], minlength=meshes)[:meshes] > 0 for mask in (has_texel, has_light)
    )
    buried = np.flatnonzero(shown & ~lit)
    return [object_message(_SENTENCE, [scene.meshes[index].name for index in buried])] if len(buried) else []


def _all_lit(scene: Scene, patch_scene: PatchScene, known: np.ndarray) -> bool:
    """Return True if some texels, one row of `_ROWS`, show that each object with a lightmap has light."""
    lit = np.zeros(len(scene.meshes), bool)
    for entries, valid in zip(patch_scene.texel_to_patch, known, strict=False):
        some = entries[::_ROWS][valid[::_ROWS]]
        patches = some[some > 0] - 1
        lit[patch_scene.triangles.mesh[patch_scene.patches.triangle[patches]]] = True
    return all(lit[number] for number, mesh in enumerate(scene.meshes) if mesh.atlas < len(known))
