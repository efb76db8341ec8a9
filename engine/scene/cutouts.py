"""See-through surfaces as shaders and kernels read them: transmittance by material, side and kind of ray."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import SceneError
from .model import Material, Scene
from .texture import Texture
from .transmission import Transmission, Transmittance

#: Codes of `Cutouts.maps`, column 3: how a map goes on beyond [0, 1].
EXTENSIONS = ("repeat", "mirror", "extend", "clip")

#: What stands for 1: images of 8 and of 16 bits are kept exactly, others to half a step.
_ONE = 65535
_HALF_STEP = 0.5 / _ONE

#: Values of all maps together: shaders and kernels count them in int32.
MOST_PIXELS = 2**31 - 2

#: Largest coordinate on a texture, widths of the image.
FARTHEST = 1e9

#: Records of a material: front for shadow rays, front for gathered light, the same two of the back.
SETS = 4
SHADOW, BOUNCE, BACK = 0, 1, 2


@dataclass(frozen=True)
class Cutouts:
    """Transmittance of all materials. Record `SETS * material + (0 or BACK) + (SHADOW or BOUNCE)`.

    Opacity of a channel, 1 - transmittance, is base + factor * map.

    pixels      (k,) uint16, 65535 for 1, the values of all maps, one image after another, row by row
    maps        (r, 4) int32 of each record: first value, width (0 without a map), height, index into
                EXTENSIONS plus 4 if the nearest pixel is taken
    channels    (r,) int32, values of a pixel of the map: 1 or 3
    layer       (r,) int32, index into `uvs`
    base        (r, 3) float32
    factor      (r, 3) float32
    threshold   (r,) float32, opacity from which on all light is stopped, or -1. It is lower by half a step of
                `pixels`, so that no rounding takes a pixel below it
    uvs         (layers, t, 3, 2) float32, each corner of each triangle on the maps of a layer
    """

    pixels: np.ndarray
    maps: np.ndarray
    channels: np.ndarray
    layer: np.ndarray
    base: np.ndarray
    factor: np.ndarray
    threshold: np.ndarray
    uvs: np.ndarray

    @cached_property
    def needed(self) -> bool:
        """True if any surface is see-through anywhere."""
        return bool((self.maps[:, 1] > 0).any() or (self.base < 1).any())

    @cached_property
    def tinted(self) -> bool:
        """True if the transmittance of any surface differs between the channels."""
        grey = (self.channels == 1) & _are_equal(self.base) & _are_equal(self.factor)
        return not bool(grey.all())

    def uvs_of(self, materials: np.ndarray, record: int) -> np.ndarray:
        """Return the corners of triangles, (t, 3, 2) float32, on the maps of one record of their materials.

        materials: (t,) int32, of each triangle; record: (0 or BACK) + (SHADOW or BOUNCE)
        """
        uvs: np.ndarray = self.uvs[self.layer[SETS * materials + record], np.arange(len(materials))]
        return uvs

    @cached_property
    def clear_backs(self) -> np.ndarray:
        """True where the back of a material stops no gathered light at all, (m,) bool."""
        clear: np.ndarray = self.stopped(BACK + BOUNCE) == 0
        return clear

    def stopped(self, record: int) -> np.ndarray:
        """Return the part of rays that each material stops, (m,) float32; 1 where a map varies it.

        record: (0 or BACK) + (SHADOW or BOUNCE)
        """
        chosen = slice(record, None, SETS)
        opacity, threshold = self.base[chosen].min(axis=1).clip(0, 1), self.threshold[chosen]
        opacity = np.where(threshold < 0, opacity, (opacity >= threshold).astype(np.float32))
        stopped: np.ndarray = np.where(self.maps[chosen, 1] > 0, np.float32(1), opacity)
        return stopped

    @cached_property
    def varies(self) -> np.ndarray:
        """True where a map varies what a material stops of gathered light, (m,) bool."""
        mapped = self.maps[:, 1].reshape(-1, SETS) > 0
        varies: np.ndarray = mapped[:, BOUNCE] | mapped[:, BACK + BOUNCE]
        return varies


def _are_equal(rows: np.ndarray) -> np.ndarray:
    """Return which rows, (r, 3), hold three equal numbers, (r,) bool."""
    equal: np.ndarray = (rows[:, 1] == rows[:, 0]) & (rows[:, 2] == rows[:, 0])
    return equal


def transmittances(transmission: Transmission) -> tuple[Transmittance, ...]:
    """Return the transmittance of each record of a material."""
    front = transmission.shadow, transmission.bounce
    back = transmission.shadow_back, transmission.bounce_back
    return *front, *(own or other for own, other in zip(back, front, strict=True))


def transmission_maps(material: Material) -> list[Texture]:
    """Return the textures of a material's transmittance."""
    maps = (entry.texture for entry in transmittances(material.transmission))
    return [texture for texture in maps if texture is not None]


def has_cutouts(scene: Scene) -> bool:
    """Return whether light passes through any surface anywhere, as `Cutouts.needed`."""
    return any(_is_see_through(entry) for entry in _all_records(scene))


def is_tinted(scene: Scene) -> bool:
    """Return whether light that passes through any surface changes its color, as `Cutouts.tinted`."""
    return any(is_tinted_material(material) for material in scene.materials)


def is_tinted_material(material: Material) -> bool:
    """Return whether light that passes through a material changes its color."""
    return any(
        len(set(entry.offset.tolist())) > 1
        or (entry.texture is not None and (len(set(entry.scale.tolist())) > 1 or _is_coloured(entry.texture)))
        for entry in transmittances(material.transmission)
    )


def _all_records(scene: Scene) -> list[Transmittance]:
    """Return the transmittance of each record of all materials."""
    return [entry for material in scene.materials for entry in transmittances(material.transmission)]


def _is_see_through(entry: Transmittance) -> bool:
    return entry.texture is not None or bool((1 - entry.offset < 1).any())


def _is_coloured(texture: Texture) -> bool:
    """Return whether the channels of a texture differ anywhere."""
    pixels = texture.pixels
    return pixels.shape[2] == 3 and bool((pixels[..., 1:] != pixels[..., :1]).any())


def read_cutouts(scene: Scene) -> Cutouts:
    """Read the transmittance of all materials, and each triangle's UVs on its maps."""
    entries, images, layers = _all_records(scene), _Images(), _Layers(scene)
    maps = np.zeros((len(entries), 4), np.int32)
    channels, layer = np.ones(len(entries), np.int32), np.zeros(len(entries), np.int32)
    for index, entry in enumerate(entries):
        if entry.texture is not None:
            first, channels[index] = images.first_value(entry.texture)
            maps[index] = _map_entry(entry.texture, first)
            layer[index] = layers.index(index // SETS, entry.texture)
    mapped = maps[:, 1] > 0
    opacity = [_opacity(entry) for entry in entries]
    return Cutouts(
        pixels=images.pixels(),
        maps=maps,
        channels=channels,
        layer=layer,
        base=np.array([base for base, _ in opacity], np.float32).reshape(-1, 3),
        factor=np.where(
            mapped[:, None], np.array([factor for _, factor in opacity], np.float32).reshape(-1, 3), 0
        ).astype(np.float32),
        threshold=np.array([_threshold(entry) for entry in entries], np.float32),
        uvs=layers.uvs(),
    )


def _opacity(entry: Transmittance) -> tuple[np.ndarray, np.ndarray]:
    """Return base and factor of the opacity."""
    one = np.float32(1)
    return one - entry.offset.astype(np.float32), -entry.scale.astype(np.float32)


def _threshold(entry: Transmittance) -> float:
    return -1.0 if entry.threshold is None else max(entry.threshold - _HALF_STEP, 0.0)


class _Images:
    """The values of maps, each image once."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._count = 0
        self._of_array: dict[int, tuple[int, int]] = {}
        self._first_of_content: dict[bytes, int] = {}

    def first_value(self, texture: Texture) -> tuple[int, int]:
        """Return first value and channels of a texture; raises SceneError if there are too many in all.

        Images whose channels are equal everywhere are kept as grey.
        """
        array = id(texture.pixels)
        if array not in self._of_array:
            pixels = texture.pixels if _is_coloured(texture) else texture.pixels[..., :1]
            self._of_array[array] = self._store(texture.name, pixels), pixels.shape[2]
        return self._of_array[array]

    def _store(self, name: str, pixels: np.ndarray) -> int:
        """Return the first value of an image that may equal one of another array."""
        steps = pixels.ravel() * np.float32(_ONE)
        values = np.rint(steps, out=steps).astype(np.uint16)
        first = self._first_of_content.setdefault(hashlib.blake2b(values).digest(), self._count)
        if first == self._count:
            self._parts.append(values)
            self._count += len(values)
        if self._count > MOST_PIXELS:
            raise SceneError(
                f"The transparency maps up to '{name}' hold {self._count:,} pixels; at most {MOST_PIXELS:,} "
                "can be baked at once. Use smaller images, or the same one for several materials."
            )
        return first

    def pixels(self) -> np.ndarray:
        """Return (k,) uint16, one image after another; never empty."""
        return np.concatenate([*self._parts, np.full(1, _ONE, np.uint16)])


class _Layers:
    """UVs of all triangles on the maps: a material has a layer for each mapping of its own."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._mappings: dict[int, list[Texture]] = {}

    def index(self, material: int, texture: Texture) -> int:
        """Return the layer in which a material's texture has its UVs."""
        known = self._mappings.setdefault(material, [])
        for layer, other in enumerate(known):
            if other.uv_map == texture.uv_map and np.array_equal(other.transform, texture.transform):
                return layer
        known.append(texture)
        return len(known) - 1

    def uvs(self) -> np.ndarray:
        """Return (layers, t, 3, 2) float32, 0 where a material has no map; one layer at least."""
        meshes = self._scene.meshes
        layers = max((len(textures) for textures in self._mappings.values()), default=1)
        parts = [np.zeros((layers, len(mesh.positions), 3, 2), np.float32) for mesh in meshes]
        for uvs, mesh in zip(parts, meshes, strict=True):
            for material in np.flatnonzero(np.bincount(mesh.material)):
                for layer, texture in enumerate(self._mappings.get(material, ())):
                    chosen = mesh.material == material
                    uvs[layer, chosen] = map_uvs(texture, mesh.texture_uvs[texture.uv_map][chosen])
        return np.concatenate([np.zeros((layers, 0, 3, 2), np.float32), *parts], axis=1)


def _map_entry(texture: Texture, first: int) -> tuple[int, int, int, int]:
    height, width = texture.pixels.shape[:2]
    return first, width, height, EXTENSIONS.index(texture.extension) + (0 if texture.smooth else 4)


def map_uvs(texture: Texture, uvs: np.ndarray) -> np.ndarray:
    """Return UVs, (..., 2), of a UV map as UVs of a texture, (..., 2) float32.

    Beyond FARTHEST float32 tells no pixels apart: they end there, and those that are NaN are 0.
    """
    matrix = texture.transform.astype(np.float64)
    with np.errstate(invalid="ignore"):
        mapped = uvs.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
    clipped: np.ndarray = np.nan_to_num(mapped).clip(-FARTHEST, FARTHEST).astype(np.float32)
    return clipped
