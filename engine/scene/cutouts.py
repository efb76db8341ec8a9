"""Transmittance tables for shaders and kernels, by material, side and kind of ray."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import SceneError
from .model import Material, Scene
from .texture import Texture
from .transmission import Fresnel, Transmission, Transmittance, body_transmittance, mean_angular_factor

#: Texture extension codes of `Cutouts.maps`, column 3.
EXTENSIONS = ("repeat", "mirror", "extend", "clip")

#: Integer that represents a transmittance of 1. Images of 8 and 16 bits are stored exactly, others to half a
#: step.
_ONE = 65535
_HALF_STEP = 0.5 / _ONE

#: Maximum number of values in all maps, since shaders and kernels index them with int32.
MOST_PIXELS = 2**31 - 2

#: Maximum texture coordinate, in image widths.
FARTHEST = 1e9

#: Records of a material: front SHADOW, front BOUNCE, back SHADOW, back BOUNCE.
SETS = 4
SHADOW, BOUNCE, BACK = 0, 1, 2


@dataclass(frozen=True)
class Cutouts:
    """Transmittance of all materials, one record for each material, side and kind of ray.

    The record index is `SETS * material + (0 or BACK) + (SHADOW or BOUNCE)`. The opacity of a channel at
    normal incidence, 1 - transmittance, is base + factor * map.

    pixels:     (k,) uint16, 65535 for 1, the values of all maps, one image after another, row by row
    maps:       (r, 4) int32, for each record: offset of the first value, width (0 without a map), height,
                index into EXTENSIONS plus 4 for nearest-pixel lookups
    channels:   (r,) int32, channels of the map: 1 or 3
    layer:      (r,) int32, index into `uvs`
    base:       (r, 3) float32
    factor:     (r, 3) float32
    threshold:  (r,) float32, opacity at or above which the surface is opaque, below clear; -1 for none. It is
                lower by half a step of `pixels`, so that rounding moves no pixel below it
    fresnel:    (r, 4) float32, ior, share, faces and body of `Fresnel`; share 0 for equal transmittance at
                all angles
    uvs:        (layers, t, 3, 2) float32, UVs of each triangle corner on the maps of a layer
    """

    pixels: np.ndarray
    maps: np.ndarray
    channels: np.ndarray
    layer: np.ndarray
    base: np.ndarray
    factor: np.ndarray
    threshold: np.ndarray
    fresnel: np.ndarray
    uvs: np.ndarray

    @cached_property
    def needed(self) -> bool:
        """True if any surface transmits light anywhere."""
        return bool((self.maps[:, 1] > 0).any() or (self.base < 1).any())

    @cached_property
    def tinted(self) -> bool:
        """True if the transmittance of any surface differs between the channels."""
        grey = (self.channels == 1) & _are_equal(self.base) & _are_equal(self.factor)
        return not bool(grey.all())

    @cached_property
    def angular(self) -> bool:
        """True if the transmittance of any surface depends on the angle of incidence."""
        return bool(self.fresnel[:, 1].any())

    def uvs_of(self, materials: np.ndarray, record: int) -> np.ndarray:
        """Return the corner UVs of triangles, (t, 3, 2) float32, on the maps of one record.

        materials:  (t,) int32, material of each triangle
        record:     (0 or BACK) + (SHADOW or BOUNCE)
        """
        uvs: np.ndarray = self.uvs[self.layer[SETS * materials + record], np.arange(len(materials))]
        return uvs

    @cached_property
    def clear_backs(self) -> np.ndarray:
        """Mask of the materials whose back face is fully clear for gathered light, (m,) bool."""
        clear: np.ndarray = self.stopped(BACK + BOUNCE) == 0
        return clear

    def stopped(self, record: int) -> np.ndarray:
        """Return the fraction of rays that each material blocks, (m,) float32; 1 if a map varies it.

        Where it depends on the angle of incidence, it is the mean under uniform light.

        record:  (0 or BACK) + (SHADOW or BOUNCE)
        """
        chosen = slice(record, None, SETS)
        opacity, threshold = self.base[chosen].min(axis=1).clip(0, 1), self.threshold[chosen]
        opacity = np.where(threshold < 0, opacity, (opacity >= threshold).astype(np.float32))
        for index in np.flatnonzero(self.fresnel[chosen, 1]):
            ior, share, faces, body = self.fresnel[chosen][index].tolist()
            passed = mean_angular_factor(Fresnel(ior, share, faces)) * (1 - opacity[index])
            opacity[index] = 1 - body_transmittance(passed, int(body))
        stopped: np.ndarray = np.where(self.maps[chosen, 1] > 0, np.float32(1), opacity)
        return stopped

    @cached_property
    def varies(self) -> np.ndarray:
        """Mask of the materials whose opacity for gathered light depends on a map or the angle, (m,) bool."""
        mapped = ((self.maps[:, 1] > 0) | (self.fresnel[:, 1] > 0)).reshape(-1, SETS)
        varies: np.ndarray = mapped[:, BOUNCE] | mapped[:, BACK + BOUNCE]
        return varies


def _are_equal(rows: np.ndarray) -> np.ndarray:
    """Return a mask of rows, (r, 3), with three equal values, (r,) bool."""
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
    """Return True if any surface transmits light anywhere, as `Cutouts.needed`."""
    entries = (entry for material in scene.materials for entry in distinct_transmittances(material))
    return any(map(_is_see_through, entries))


def is_angular(scene: Scene) -> bool:
    """Return True if the transmittance of any surface depends on the angle, as `Cutouts.angular`."""
    entries = (entry for material in scene.materials for entry in distinct_transmittances(material))
    return any(_fresnel(entry)[1] for entry in entries)


def is_tinted(scene: Scene) -> bool:
    """Return True if any surface tints transmitted light, as `Cutouts.tinted`."""
    return any(is_tinted_material(material) for material in scene.materials)


def is_tinted_material(material: Material) -> bool:
    """Return True if a material tints transmitted light."""
    return any(
        len(set(entry.offset.tolist())) > 1
        or (entry.texture is not None and (len(set(entry.scale.tolist())) > 1 or _is_coloured(entry.texture)))
        for entry in distinct_transmittances(material)
    )


def distinct_transmittances(material: Material) -> tuple[Transmittance, ...]:
    """Return the transmittances of a material; most materials have the same on both sides."""
    entries = transmittances(material.transmission)
    return tuple({id(entry): entry for entry in entries}.values())


def _all_records(scene: Scene) -> list[Transmittance]:
    """Return the transmittance of each record of all materials."""
    return [entry for material in scene.materials for entry in transmittances(material.transmission)]


def _is_see_through(entry: Transmittance) -> bool:
    if entry.texture is not None:
        return True
    # Most surfaces are opaque. The list is faster than arithmetic on a short array.
    return any(entry.offset.tolist()) and bool((1 - entry.offset < 1).any())


def _is_coloured(texture: Texture) -> bool:
    """Return True if the channels of a texture differ anywhere."""
    pixels = texture.pixels
    return pixels.shape[2] == 3 and bool((pixels[..., 1:] != pixels[..., :1]).any())


def read_cutouts(scene: Scene) -> Cutouts:
    """Return the transmittance tables of all materials, with each triangle's UVs on its maps."""
    entries, images, layers = _all_records(scene), _Images(), _Layers(scene)
    maps = np.zeros((len(entries), 4), np.int32)
    channels, layer = np.ones(len(entries), np.int32), np.zeros(len(entries), np.int32)
    for index, entry in enumerate(entries):
        if entry.texture is not None:
            first, channels[index] = images.first_value(entry.texture)
            maps[index] = _map_entry(entry.texture, first)
            layer[index] = layers.index(index // SETS, entry.texture)
    offset, scale = (
        np.array([getattr(entry, name) for entry in entries], np.float32).reshape(-1, 3)
        for name in ("offset", "scale")
    )
    return Cutouts(
        pixels=images.pixels(),
        maps=maps,
        channels=channels,
        layer=layer,
        base=np.float32(1) - offset,
        factor=np.where(maps[:, 1:2] > 0, -scale, np.float32(0)),
        threshold=np.array([_threshold(entry) for entry in entries], np.float32),
        fresnel=np.array([_fresnel(entry) for entry in entries], np.float32).reshape(-1, 4),
        uvs=layers.uvs(),
    )


def _threshold(entry: Transmittance) -> float:
    return -1.0 if entry.threshold is None else max(entry.threshold - _HALF_STEP, 0.0)


def _fresnel(entry: Transmittance) -> tuple[float, float, float, float]:
    fresnel = entry.fresnel
    if fresnel is None or entry.threshold is not None:
        return 1.0, 0.0, 1.0, 0.0
    return fresnel.ior, fresnel.share, fresnel.faces, float(fresnel.body)


class _Images:
    """Pool of map values that stores each image once."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._count = 0
        self._of_array: dict[int, tuple[int, int]] = {}
        self._first_of_content: dict[bytes, int] = {}

    def first_value(self, texture: Texture) -> tuple[int, int]:
        """Return the offset and the number of channels of a texture; raise SceneError above the limit.

        Images with equal channels are stored as grey.
        """
        array = id(texture.pixels)
        if array not in self._of_array:
            pixels = texture.pixels if _is_coloured(texture) else texture.pixels[..., :1]
            self._of_array[array] = self._store(texture.name, pixels), pixels.shape[2]
        return self._of_array[array]

    def _store(self, name: str, pixels: np.ndarray) -> int:
        """Return the offset of an image, shared with an identical one."""
        steps = pixels.ravel() * np.float32(_ONE)
        values = np.rint(steps, out=steps).astype(np.uint16)
        first = self._first_of_content.setdefault(hashlib.blake2b(values).digest(), self._count)
        if first == self._count:
            self._parts.append(values)
            self._count += len(values)
        if self._count > MOST_PIXELS:
            raise SceneError(
                f"All transparency maps exceed {MOST_PIXELS:,} pixels at '{name}' ({self._count:,}). "
                "Use smaller images, or the same one for several materials."
            )
        return first

    def pixels(self) -> np.ndarray:
        """Return the values of all images, (k,) uint16; never empty."""
        return np.concatenate([*self._parts, np.full(1, _ONE, np.uint16)])


class _Layers:
    """UVs of all triangles on the maps; each mapping of a material has its own layer."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._mappings: dict[int, list[Texture]] = {}

    def index(self, material: int, texture: Texture) -> int:
        """Return the layer with the UVs of a material's texture."""
        known = self._mappings.setdefault(material, [])
        for layer, other in enumerate(known):
            if other.uv_map == texture.uv_map and np.array_equal(other.transform, texture.transform):
                return layer
        known.append(texture)
        return len(known) - 1

    def uvs(self) -> np.ndarray:
        """Return the UVs, (layers, t, 3, 2) float32, 0 where a material has no map; at least one layer."""
        meshes = self._scene.meshes
        layers = max((len(textures) for textures in self._mappings.values()), default=1)
        count = sum(len(mesh.positions) for mesh in meshes)
        if not self._mappings:
            return np.broadcast_to(np.float32(0), (layers, count, 3, 2))
        joined = np.zeros((layers, count, 3, 2), np.float32)
        first = 0
        for mesh in meshes:
            uvs = joined[:, first : first + len(mesh.positions)]
            first += len(mesh.positions)
            for material in np.flatnonzero(np.bincount(mesh.material)):
                for layer, texture in enumerate(self._mappings.get(material, ())):
                    chosen = mesh.material == material
                    uvs[layer, chosen] = map_uvs(texture, mesh.texture_uvs[texture.uv_map][chosen])
        return joined


def _map_entry(texture: Texture, first: int) -> tuple[int, int, int, int]:
    height, width = texture.pixels.shape[:2]
    return first, width, height, EXTENSIONS.index(texture.extension) + (0 if texture.smooth else 4)


def map_uvs(texture: Texture, uvs: np.ndarray) -> np.ndarray:
    """Return UVs, (..., 2), of a UV map transformed to UVs of a texture, (..., 2) float32.

    Clamped to FARTHEST, beyond which float32 cannot separate pixels; NaN becomes 0.
    """
    matrix = texture.transform.astype(np.float64)
    with np.errstate(invalid="ignore"):
        mapped = uvs.astype(np.float64) @ matrix[:, :2].T + matrix[:, 2]
    clipped: np.ndarray = np.nan_to_num(mapped).clip(-FARTHEST, FARTHEST).astype(np.float32)
    return clipped
