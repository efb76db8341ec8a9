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
    lit = _meshes_at(scene, patch_scene, known, slice(None, None, _ROWS))
    if all(lit[number] for number, mesh in enumerate(scene.meshes) if mesh.atlas < len(known)):
        return []
    shown, lit = (
        _meshes_at(scene, patch_scene, mask, slice(None)) for mask in (np.ones_like(known[:, :1]), known)
    )
    buried = np.flatnonzero(shown & ~lit)
    return [object_message(_SENTENCE, [scene.meshes[index].name for index in buried])] if len(buried) else []


def _meshes_at(scene: Scene, patch_scene: PatchScene, wanted: np.ndarray, rows: slice) -> np.ndarray:
    """Return a mask of the meshes with patches at wanted texels of some rows, (m,) bool.

    wanted:  (atlases, r, r) bool, or one row for all
    """
    found = np.zeros(len(scene.meshes), bool)
    for entries, mask in zip(patch_scene.texel_to_patch, wanted, strict=False):
        masks = np.broadcast_to(mask, entries.shape)[rows]
        for some, chosen in zip(entries[rows], masks, strict=True):
            patches = some[chosen & (some > 0)] - 1
            found[patch_scene.triangles.mesh[patch_scene.patches.triangle[patches]]] = True
    return found
