"""Texels of lightmaps that belong to objects outside of the current bake and stay unchanged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.object_message import object_message
from ...engine.settings import Settings
from ..levels import LevelFinder
from ..lookup import find_all
from ..scene import ReadScene, SceneContext
from ..scene.bake_records import Record, bake_record
from ..scene.objects.evaluation import Evaluation, evaluate
from ..scene.uvs.lightmap_layer import layer_triangles
from ..scene.uvs.uv_faults import covered_texels, is_finite, is_inside
from ..scene.uvs.uv_targets import evaluated_mesh
from ..working_space import to_rec709
from .pictures import holds_colours

#: Owner of a texel.
_NOBODY, _BAKED, _KEPT = range(3)


class PreservedTexels:
    """Texels in a bake's images of objects that were baked before and are not baked now."""

    def __init__(
        self, context: SceneContext, read: ReadScene, names: Sequence[str], settings: Settings, partial: bool
    ) -> None:
        """Read the texels from the images; raise SceneError if the images have another size.

        names:    names of the images, all atlases of each output in turn
        partial:  False if all objects are baked, so that nothing is preserved
        """
        self._context, self._read, self._settings = context, read, settings
        self._masks: dict[int, np.ndarray] = {}
        self._pixels: dict[int, np.ndarray] = {}
        self._objects: dict[str, list[int]] = {}
        for atlas, name in enumerate(read.scene.atlases if partial else ()):
            others = self._others(name)
            if others:
                self._objects[name] = [obj.session_uid for obj in others]
                self._masks[atlas] = self._kept(atlas, others)
        for index, name in enumerate(names):
            if index % len(read.scene.atlases) in self._masks:
                self._pixels[index] = _image_pixels(self._image(name), settings.resolution)

    def merge(self, lightmaps: np.ndarray) -> np.ndarray:
        """Return the lightmaps of the first m images, (m, h, w, 3), with the preserved texels."""
        merged = lightmaps.copy() if self._pixels else lightmaps
        for index, pixels in self._pixels.items():
            mask = self._masks[index % len(self._read.scene.atlases)]
            if index < len(merged):
                merged[index][mask] = pixels[mask]
        return merged

    def objects(self) -> Iterator[tuple[str, bpy.types.Object]]:
        """Yield the objects with preserved texels, each with its atlas."""
        for atlas, uids in self._objects.items():
            for obj in find_all(bpy.data.objects, uids):
                yield atlas, obj

    def _image(self, name: str) -> bpy.types.Image | None:
        entry = self._context.scene.hemibake.lightmaps.get(name)
        return entry and entry.image

    def _others(self, atlas: str) -> list[bpy.types.Object]:
        """Return the objects that use an atlas's image but are not baked now.

        Raises SceneError if there are any and the image has another resolution than this bake.
        Levels of detail of objects that are baked now are left out: the bake writes their UVs again.
        """
        image, baked = self._image(atlas), {entry.uid for entry in self._read.objects}
        if image is None:
            return []
        scene, levels = self._context.scene, LevelFinder()
        others = [
            obj
            for obj in scene.objects
            if obj.type == "MESH"
            and bake_record(obj, scene).image == image
            and (levels.first_level(obj) or obj).session_uid not in baked
        ]
        if others and tuple(image.size) != (self._settings.resolution,) * 2:
            sentence = (
                f"The lightmap '{atlas}' is {image.size[0]} texels wide and holds objects that are not baked "
                "now: {}. Choose that resolution, bake all, or assign these to another lightmap."
            )
            raise SceneError(object_message(sentence, [obj.name for obj in others]))
        return others

    def _kept(self, atlas: int, others: Sequence[bpy.types.Object]) -> np.ndarray:
        """Return the texels of an atlas to preserve, (h, w) bool: texels of other objects, with margins."""
        resolution = self._settings.resolution
        owner = np.full((resolution, resolution), _NOBODY, np.uint8)
        for mesh in self._read.scene.meshes:
            if mesh.atlas == atlas:
                _claim(owner, mesh.uvs, _BAKED)
        records = [(obj, bake_record(obj, self._context.scene)) for obj in others]

        def read(evaluation: Evaluation) -> list[np.ndarray | None]:
            return [_lightmap_uvs(obj, record, evaluation) for obj, record in records]

        for uvs in evaluate(self._context, read, others):
            if uvs is not None:
                _claim(owner, uvs, _KEPT)

        # Texels that a chart touches without covering their centre are neighbours of covered ones.
        for _ in range(self._settings.margin + 1):
            _grow(owner)
        return owner == _KEPT


def _lightmap_uvs(obj: bpy.types.Object, known: Record, evaluation: Evaluation) -> np.ndarray | None:
    """Return the UVs of an object's triangles in its lightmap, (t, 3, 2); None if unusable."""
    with evaluated_mesh(obj, evaluation) as mesh:
        shown = mesh if mesh is not None else obj.data
        if known.uv_layer not in shown.uv_layers:
            return None
        uvs = layer_triangles(shown, known.uv_layer) * known.uv_scale + np.array(known.uv_offset)
    return uvs if is_finite(uvs) and is_inside(uvs) else None


def _claim(owner: np.ndarray, uvs: np.ndarray, whose: int) -> None:
    """Mark the free texels that triangles cover as owned by an object."""
    resolution = len(owner)
    texels, _ = covered_texels(uvs, resolution)
    row, column = np.divmod(texels, resolution + 1)
    free = owner[row, column] == _NOBODY
    owner[row[free], column[free]] = whose


def _grow(owner: np.ndarray) -> None:
    """Extend each owner by one texel in all eight directions, into free texels."""
    padded = np.pad(owner, 1)
    height, width = owner.shape
    for y, x in ((0, 1), (1, 0), (1, 2), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2)):
        neighbour = padded[y : y + height, x : x + width]
        np.copyto(owner, neighbour, where=(owner == _NOBODY) & (neighbour != _NOBODY))


def _image_pixels(image: bpy.types.Image | None, resolution: int) -> np.ndarray:
    """Return the pixels of an image, (h, w, 3) float32; black if there is none of this size."""
    pixels = np.zeros((resolution, resolution, 4), np.float32)
    if image is not None and tuple(image.size) == (resolution, resolution):
        image.pixels.foreach_get(pixels.reshape(-1))
        if holds_colours(image):
            return to_rec709(pixels[..., :3])
    return pixels[..., :3]
