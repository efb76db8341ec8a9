"""The images of one bake, in which its lightmaps appear as they become better."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..lookup import find
from ..rollback import Rollback
from ..scene import SceneContext
from . import images
from .preserved_texels import PreservedTexels


def image_names(atlases: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Return the name of every image: the atlas, and for outputs after the first what it shows, too."""
    return [*atlases, *(images.map_name(atlas, output) for output in outputs[1:] for atlas in atlases)]


class ProgressImages:
    """Images in Blender of all lightmaps of a bake; each is made once there is something to show in it.

    atlases     of the scene
    names       of the images, see `image_names`
    resolution  width of each, texels
    kept        texels that are not baked now
    changes     takes new and changed images back
    """

    def __init__(
        self,
        context: SceneContext,
        atlases: Sequence[str],
        names: Sequence[str],
        resolution: int,
        kept: PreservedTexels,
        changes: Rollback,
    ) -> None:
        self._context, self._kept, self._changes = context, kept, changes
        self._atlases, self._names, self._resolution = atlases, names, resolution
        self.uids: list[int] = []

    def show(self, lightmaps: np.ndarray) -> np.ndarray:
        """Put lightmaps, (m, h, w, 3) float32, into the first m images, with the texels that are kept.

        Returns what they show, of the same shape. Images that are gone are made anew.
        """
        scene, merged = self._context.scene, self._kept.merge(lightmaps)
        for index, pixels in enumerate(merged):
            image = find(bpy.data.images, self.uids[index]) if index < len(self.uids) else None
            if image is None:
                image = images.lightmap_image(scene, self._names[index], self._resolution, self._changes)
            images.show(image, pixels)
            self.uids[index : index + 1] = [image.session_uid]
        return merged

    def found(self) -> list[bpy.types.Image]:
        """Return the images as they are shown; None for one that is gone."""
        return [find(bpy.data.images, uid) for uid in self.uids]

    def keep(self) -> None:
        """Write on the scene which images it has from now on; an undo step must follow."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        for index, (name, image) in enumerate(zip(self._names, self.found(), strict=False)):
            if scene is not None and image is not None:
                first = index < len(self._atlases)
                beside = "" if first else self._atlases[index % len(self._atlases)]
                images.remember(scene, name, image, beside)
