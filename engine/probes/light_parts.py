"""Sampled emitters of probes, in parts whose direct light is stored separately."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..direct.emitter_lists import EmitterLists, joined_emitters
from ..direct.emitters import POINT, SKY_MAP, SUN, TRIANGLE
from ..direct.lighting import DirectLighting
from ..patches.patch_scene import PatchScene
from ..scene.light_groups import LightGroups
from ..settings import Settings

#: Maximum number of emitter lists of a scene whose light is stored separately; more are sampled together, or
#: together by light group, by a light tree (chosen: 3.5 MB of 32^3 probes each).
_SEPARATE = 8


@dataclass(frozen=True)
class LightPart:
    """Emitters whose light is stored together.

    emitters:  (k,) EMITTER, of a light with strength 1
    rays:      shadow rays of each probe
    factor:    (3,) float32, by which their light is multiplied
    digest:    of all that determines their light without the factor
    """

    emitters: np.ndarray
    rays: int
    factor: np.ndarray
    digest: bytes

    @property
    def key(self) -> tuple[bytes, np.ndarray]:
        """Everything that determines their light."""
        return self.digest, self.factor


def emitters_of(patch_scene: PatchScene, lighting: DirectLighting) -> EmitterLists:
    """Return all sampled emitters of a scene."""
    lamps, split = lighting.emitters
    return EmitterLists(lamps, patch_scene.triangles, split.bright, split.sky)


def light_parts(
    emitters: EmitterLists,
    patch_scene: PatchScene,
    lighting: DirectLighting,
    settings: Settings,
    groups: LightGroups | None,
) -> list[list[LightPart]]:
    """Return the parts of all light, then of each light group, if there are any.

    emitters:  as from `emitters_of`
    """
    lamps, split = lighting.emitters
    left_out = {
        number for number, lamp in enumerate(lamps) if settings.probes_indirect_only and not lamp.of_world
    }
    sky = split.sky.distribution
    # Shadow rays are traced again only if something that emits light to be sampled has changed.
    common = _Digests(
        _digest(repr(settings.light_samples).encode(), emitters.modulations, emitters.profiles),
        _digest(b"surfaces", *(_radiance(patch_scene) if len(split.bright.triangles) else ())),
        _digest(repr(sky.size).encode(), sky.listed, sky.pixels),
    )
    lists_of_lights = [
        [records for number, records in enumerate(lists) if number not in left_out and len(records)]
        for lists in (emitters.lists, *(emitters.by_group(groups) if groups else ()))
    ]
    make = _separate_parts if len(lists_of_lights[0]) <= _SEPARATE else _joined_part
    return [make(lists, settings.light_samples, common) for lists in lists_of_lights]


@dataclass(frozen=True)
class _Digests:
    """Digests of what emitters refer to: tables of lights, radiance of surfaces, and pixels of the sky."""

    lights: bytes
    surfaces: bytes
    sky: bytes

    def of(self, emitters: np.ndarray) -> bytes:
        """Return the digest of emitters and of all that they refer to."""
        surfaces, sky = _of_surfaces(emitters).any(), (emitters["kind"] == SKY_MAP).any()
        others = self.lights, self.surfaces if surfaces else b"", self.sky if sky else b""
        return _digest(b"".join(others), emitters)


def _digest(start: bytes, *arrays: np.ndarray) -> bytes:
    """Return the digest of bytes and arrays."""
    digest = hashlib.blake2b(start)
    for array in arrays:
        digest.update(array.tobytes())
    return digest.digest()


def _radiance(patch_scene: PatchScene) -> tuple[np.ndarray, np.ndarray]:
    """Return the radiance of both faces of all patches."""
    return patch_scene.surfaces.emission, patch_scene.surfaces.emission_of_backs


def _of_surfaces(emitters: np.ndarray) -> np.ndarray:
    """Return a mask of the triangles of surfaces, (k,) bool; area lights have triangles too."""
    mask: np.ndarray = (emitters["kind"] == TRIANGLE) & (emitters["triangle"] >= 0)
    return mask


def _joined_part(lists: Sequence[np.ndarray], light_samples: int, common: _Digests) -> list[LightPart]:
    """Return lists of emitters as one part, or none without emitters."""
    joined = joined_emitters(lists, light_samples)
    return [] if joined is None else [LightPart(*joined, np.ones(3, np.float32), common.of(joined[0]))]


def _separate_parts(lists: Sequence[np.ndarray], light_samples: int, common: _Digests) -> list[LightPart]:
    """Return lists of emitters as one part each, so that a change of one light leaves the others."""
    units = [_unit(emitters, light_samples) for emitters in lists]
    return [LightPart(*unit, common.of(unit[0])) for unit in units]


def _unit(emitters: np.ndarray, light_samples: int) -> tuple[np.ndarray, int, np.ndarray]:
    """Return the emitters of a list, of a light with strength 1; the rays of each probe; and the factor.

    All rays of a probe to a light without a size are equal, so one is enough.
    """
    strength = emitters["strength"][0].astype(np.float32)
    if _of_surfaces(emitters).any() or not strength.any():
        return emitters, light_samples, np.ones(3, np.float32)
    unit = emitters.copy()
    unit["strength"] = unit["luminance"] = 1
    has_no_size = len(unit) == 1 and unit["kind"][0] in (POINT, SUN) and unit["radius"][0] == 0
    return unit, 1 if has_no_size else light_samples, strength
