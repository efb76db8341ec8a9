"""Which parts of triangles light passes through: alpha maps, constant alpha and culled backs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from ..errors import SceneError
from .model import Material, Scene
from .texture import Texture

#: Codes of `Cutouts.maps`, column 3: how an alpha map goes on beyond [0, 1].
EXTENSIONS = ("repeat", "mirror", "extend", "clip")

#: What stands for alpha 1: images of 8 and of 16 bits are kept exactly, others to half a step.
_ONE = 65535
_HALF_STEP = 0.5 / _ONE

#: Pixels of all alpha maps together: shaders and kernels count them in int32.
MOST_PIXELS = 2**31 - 2

#: Largest coordinate on a texture, widths of the image.
FARTHEST = 1e9


@dataclass(frozen=True)
class Cutouts:
    """What shaders and kernels need to know about see-through surfaces.

    alpha      (k,) uint16, 65535 for 1, the pixels of all alpha maps, one image after another, row by row
    maps       (m, 4) int32 of each material: first pixel, width (0 without a map), height, index into
               EXTENSIONS plus 4 if the nearest pixel is taken
    constants  (m, 2) float32 of each material: alpha (a factor of the map), and the threshold or -1. The
               threshold is lower by half a step of `alpha`, so that no rounding takes a pixel below it
    culled     (m,) bool of each material: the back is see-through
    uvs        (t, 3, 2) float32, where each corner of each triangle is on its alpha map
    """

    alpha: np.ndarray
    maps: np.ndarray
    constants: np.ndarray
    culled: np.ndarray
    uvs: np.ndarray

    @property
    def needed(self) -> bool:
        """True if any surface is see-through anywhere."""
        return bool((self.maps[:, 1] > 0).any() or (self.constants[:, 0] < 1).any() or self.culled.any())


def has_cutouts(scene: Scene) -> bool:
    """Return whether light passes through any surface anywhere, as `Cutouts.needed`."""
    return any(
        material.alpha_map is not None or material.alpha < 1 or material.culled
        for material in scene.materials
    )


def read_cutouts(scene: Scene) -> Cutouts:
    """Read the alpha of all materials, and each triangle's UVs on its alpha map."""
    images, maps = _Images(), np.zeros((len(scene.materials), 4), np.int32)
    for index, material in enumerate(scene.materials):
        if material.alpha_map is not None:
            maps[index] = _map_entry(material.alpha_map, images.first_pixel(material.alpha_map))
    return Cutouts(
        alpha=images.pixels(),
        maps=maps,
        constants=np.array([_constants(material) for material in scene.materials], np.float32),
        culled=np.array([material.culled for material in scene.materials], bool),
        uvs=_alpha_uvs(scene),
    )


class _Images:
    """The pixels of alpha maps, each image once."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._count = 0
        self._first_of_array: dict[int, int] = {}
        self._first_of_content: dict[bytes, int] = {}

    def first_pixel(self, texture: Texture) -> int:
        """Return the first pixel of a texture; raises SceneError if there are too many in all."""
        array = id(texture.pixels)
        if array not in self._first_of_array:
            self._first_of_array[array] = self._store(texture)
        return self._first_of_array[array]

    def _store(self, texture: Texture) -> int:
        """Return the first pixel of an image that may equal one of another array."""
        steps = texture.pixels.ravel() * np.float32(_ONE)
        alpha = np.rint(steps, out=steps).astype(np.uint16)
        first = self._first_of_content.setdefault(hashlib.blake2b(alpha).digest(), self._count)
        if first == self._count:
            self._parts.append(alpha)
            self._count += len(alpha)
        if self._count > MOST_PIXELS:
            raise SceneError(
                f"The alpha maps up to '{texture.name}' hold {self._count:,} pixels; at most {MOST_PIXELS:,} "
                "can be baked at once. Use smaller images, or the same one for several materials."
            )
        return first

    def pixels(self) -> np.ndarray:
        """Return (k,) uint16, one image after another; never empty."""
        return np.concatenate([*self._parts, np.full(1, _ONE, np.uint16)])


def _map_entry(texture: Texture, first: int) -> tuple[int, int, int, int]:
    height, width = texture.pixels.shape[:2]
    return first, width, height, EXTENSIONS.index(texture.extension) + (0 if texture.smooth else 4)


def _constants(material: Material) -> tuple[float, float]:
    threshold = material.alpha_threshold
    return material.alpha, -1.0 if threshold is None else max(threshold - _HALF_STEP, 0.0)


def _alpha_uvs(scene: Scene) -> np.ndarray:
    """Return (t, 3, 2) float32: each corner on the alpha map of its material, 0 without one."""
    parts = [np.zeros((len(mesh.positions), 3, 2), np.float32) for mesh in scene.meshes]
    for uvs, mesh in zip(parts, scene.meshes, strict=True):
        for index in np.flatnonzero(np.bincount(mesh.material)):
            texture = scene.materials[index].alpha_map
            if texture is not None:
                chosen = mesh.material == index
                uvs[chosen] = map_uvs(texture, mesh.texture_uvs[texture.uv_map][chosen])
    return np.concatenate(parts)


def map_uvs(texture: Texture, uvs: np.ndarray) -> np.ndarray:
    """Return UVs, (..., 2), of a UV map as UVs of a texture, (..., 2) float32.

    Beyond FARTHEST float32 tells no pixels apart: they end there, and those that are NaN are 0.
    """
    matrix = texture.transform.astype(np.float64)
    with np.errstate(invalid="ignore"):
        mapped = uvs.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
    clipped: np.ndarray = np.nan_to_num(mapped).clip(-FARTHEST, FARTHEST).astype(np.float32)
    return clipped
