"""Finds faces that lie exactly on one another and look apart, as the walls of two rooms that share a plane.

Each hides the other: the light on them is lost.
"""

from __future__ import annotations

import numpy as np

from ..naming import Note, naming
from ..patches.subdivision import Subdivision
from ..scene.model import Scene
from ..visibility.rays.ray_scene import RayScene
from ..visibility.views.viewpoints import eye_heights
from .contact import ABOVE, BELOW, NearFaces

#: Part of the view of a hidden patch that is no back: what stands on a floor shows the floor its inside.
_OPEN = 0.5

#: Patches that are looked at, at most.
_MOST = 1 << 16


def note_back_to_back(
    scene: Scene, parts: Subdivision, points: RayScene, front: np.ndarray, near: NearFaces
) -> list[Note]:
    """Return a warning that names the objects whose faces lie on one another and look apart.

    front: (n,) float32, the fraction of each patch's view that no back takes.
    """
    lost = np.flatnonzero(near.hide & (front > _OPEN))
    if not (len(lost) and points.possible):
        return []
    lost = lost[:: -(-len(lost) // _MOST)]

    # The face that hides each patch, found as for `patches_in_contact`.
    geometry, triangles = parts.geometry.part(lost), parts.triangles
    up = eye_heights(triangles, geometry)[:, None] * geometry.geometric
    other, _, distance = points.rays.cast(geometry.center + ABOVE * up, -(ABOVE + BELOW) * up, backs=True)
    met = (other >= 0) & (distance <= 1)
    own, other = geometry.triangle[met].astype(np.int64), other[met].astype(np.int64)
    faces = _mutual(own, other, len(triangles.mesh))
    names = [scene.meshes[mesh].name for mesh in np.unique(triangles.mesh[faces])]
    sentence = (
        "{}: faces lie exactly on one another and look apart, so both are dark there. "
        "Move them a millimetre apart, or delete one side."
    )
    return [naming(sentence, names)] if names else []


def _mutual(own: np.ndarray, other: np.ndarray, count: int) -> np.ndarray:
    """Return the triangles that hide one which hides them, too; own, other: (k,) int64, less than count.

    The underside of a box on a floor looks into the open below the floor, but the floor into the box.
    """
    pairs = np.unique(own * count + other)
    mutual: np.ndarray = np.intersect1d(pairs, pairs % count * count + pairs // count) // count
    return mutual
