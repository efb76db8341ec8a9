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


def warn_buried(scene: Scene, patch_scene: PatchScene, known: np.ndarray) -> list[str]:
    """Return a warning that names the objects without a texel of valid light.

    known:  (atlases, r, r) bool, texels with valid light
    """
    entries = patch_scene.texel_to_patch[: len(known)]
    mesh = np.full(entries.shape, len(scene.meshes))
    covered = entries > 0
    mesh[covered] = patch_scene.triangles.mesh[patch_scene.patches.triangle[entries[covered] - 1]]
    has_texels, has_light = (
        np.bincount(mesh[mask], minlength=len(scene.meshes)) for mask in (covered, known)
    )
    buried = np.flatnonzero((has_texels > 0) & (has_light[: len(scene.meshes)] == 0))
    return [object_message(_SENTENCE, [scene.meshes[index].name for index in buried])] if len(buried) else []
