"""Images of one bake, which show its lightmaps while they improve."""

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
    """Return the name of each image: the atlas, followed by the output for outputs after the first."""
    return [*atlases, *(images.map_name(atlas, output) for output in outputs[1:] for atlas in atlases)]


class ProgressImages:
    """Blender images of all lightmaps of a bake, created when there is something to show.

    atlases:     atlases of the scene
    names:       names of the images, see `image_names`
    resolution:  width of each, texels
    kept:        texels outside of the current bake
    changes:     undoes new and changed images
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
        """Show lightmaps, (m, h, w, 3) float32, in the first m images, with preserved texels.

        Returns the shown pixels, same shape. Missing images are created again.
        """
        scene, merged = self._context.scene, self._kept.merge(lightmaps)
        for index, pixels in enumerate(merged):
            image = find(bpy.data.images, self.uids[index]) if index < len(self.uids) else None
            if image is None:
                image = images.lightmap_image(scene, self._names[index], self._resolution, self._changes)
            images.show(image, pixels)
            self.uids[index : index + 1] = [image.session_uid]
        return merged

    def limit_to(self, numbers: Sequence[int]) -> None:
        """Drop all other images, of which none has been shown. The first image must stay."""
        self._names = [self._names[number] for number in numbers]

    def found(self) -> list[bpy.types.Image]:
        """Return the images; None for missing ones."""
        return [find(bpy.data.images, uid) for uid in self.uids]

    def keep(self) -> None:
        """Store the images on the scene; an undo step must follow."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        for index, (name, image) in enumerate(zip(self._names, self.found(), strict=False)):
            if scene is not None and image is not None:
                first = index < len(self._atlases)
                beside = "" if first else self._atlases[index % len(self._atlases)]
                images.remember(scene, name, image, beside)
