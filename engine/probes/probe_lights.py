"""Direct light of probes by shadow rays, as spherical harmonics: lamps, bright surfaces and bright sky."""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.time_slicer import sliced
from ..direct.emitter_lists import EmitterLists, joined_emitters
from ..direct.emitters import POINT, SKY_MAP, SUN, TRIANGLE
from ..direct.light_tree import LIGHT_NODE, LIGHT_TREE_RECORDS, build_light_tree
from ..direct.lighting import DirectLighting
from ..direct.shadow_rays import glow_arguments, sky_arguments
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.light_groups import LightGroups
from ..settings import Settings
from ..visibility.rays.ray_tracer import RayTracer
from .probe_rows import COEFFICIENTS, ProbeRows

#: Maximum number of emitter lists of a scene whose light is stored separately; more are sampled together, or
#: together by light group, by a light tree (chosen: 3.5 MB of 32^3 probes each).
_SEPARATE = 8


class ProbeLights:
    """Sampled emitters as seen from probes; see `direct.shadow_rays.ShadowRays`."""

    def __init__(
        self,
        compute: ComputeDevice,
        rays: RayTracer,
        parts: PatchScene,
        lighting: DirectLighting,
        settings: Settings,
        groups: LightGroups | None = None,
    ) -> None:
        """Make the tables of all light and of each light group, if there are any."""
        self._compute, self._rays, self._seed = compute, rays, settings.seed
        lamps, split = lighting.emitters
        emitters = EmitterLists(lamps, parts.triangles, split.bright, split.sky)
        left_out = {
            number for number, lamp in enumerate(lamps) if settings.probes_indirect_only and not lamp.of_world
        }
        self._tables = [upload(compute, array) for array in (emitters.modulations, emitters.profiles)]
        self._glow = glow_arguments(compute, parts, split.bright)
        self._sky = sky_arguments(compute, split.sky.distribution)
        sky = split.sky.distribution
        # Shadow rays are traced again only if something that emits light to be sampled has changed.
        common = _Digests(
            _digest(repr(settings.light_samples).encode(), emitters.modulations, emitters.profiles),
            _digest(b"surfaces", *(_radiance(parts) if len(split.bright.triangles) else ())),
            _digest(repr(sky.size).encode(), sky.listed, sky.pixels),
        )
        lists_of_lights = [
            [records for number, records in enumerate(lists) if number not in left_out and len(records)]
            for lists in (emitters.lists, *(emitters.by_group(groups) if groups else ()))
        ]
        make = _separate_parts if len(lists_of_lights[0]) <= _SEPARATE else _joined_part
        self._parts = [make(lists, settings.light_samples, common) for lists in lists_of_lights]
        self._size = int(parts.triangles.mesh.size).bit_length()

    def project(self, probes: ProbeRows) -> Generator[float, None, np.ndarray]:
        """Return the direct light of probes, (n, 1 + g, 9, 3) float32: of all light and of g light groups.

        SH L2 of radiance. Yields progress 0..1.
        """
        parts = {part.digest: part for of_light in self._parts for part in of_light}
        new = [digest for digest in parts if digest not in probes.direct]
        for number, digest in enumerate(new):
            tracing = self._projected(probes, parts[digest].emitters, parts[digest].rays)
            span = number / len(new), (number + 1) / len(new)
            probes.direct[digest] = yield from run_as_fraction(*span, tracing)
        for digest in probes.direct.keys() - parts.keys():
            del probes.direct[digest]
        light = np.zeros((probes.count, len(self._parts), COEFFICIENTS, 3), np.float32)
        for number, of_light in enumerate(self._parts):
            for part in of_light:
                light[:, number] += probes.direct[part.digest] * part.factor
        return light

    def _projected(
        self, probes: ProbeRows, emitters: np.ndarray, budget: int
    ) -> Generator[float, None, np.ndarray]:
        """Return the direct light of some emitters, (n, 9, 3) float32; yield progress 0..1.

        budget:  number of shadow rays of each probe
        """
        compute, count = self._compute, probes.count
        (kernel,) = self._rays.kernels(
            (*LIGHT_TREE_RECORDS, "light_probes.cl"), "light_probes", options=("-DSPHERE",)
        )
        tree = build_light_tree(emitters)
        nodes = tree.nodes if len(tree.nodes) else LIGHT_NODE.array(1)
        coefficients = zeros(compute, 16 * COEFFICIENTS * count)
        arguments = (
            probes.probes, upload(compute, emitters), upload(compute, nodes), np.int32(tree.root),
            *self._tables, np.int32(budget), *self._glow, *self._sky, np.uint32(self._seed), coefficients,
        )  # fmt: skip

        def launch(start: int, end: int) -> None:
            self._rays.run(kernel, end - start, *arguments, np.int32(start), np.int32(end))

        size = compute.slice_size(kernel, budget, self._size)
        for end in sliced(compute.queue, 0, count, launch, size):
            yield end / count
        light: np.ndarray = download(compute, coefficients, (count, COEFFICIENTS, 4))[..., :3]
        return light


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


def _radiance(parts: PatchScene) -> tuple[np.ndarray, np.ndarray]:
    """Return the radiance of both faces of all patches."""
    return parts.surfaces.emission, parts.surfaces.emission_of_backs


def _of_surfaces(emitters: np.ndarray) -> np.ndarray:
    """Return a mask of the triangles of surfaces, (k,) bool; area lights have triangles too."""
    mask: np.ndarray = (emitters["kind"] == TRIANGLE) & (emitters["triangle"] >= 0)
    return mask


@dataclass(frozen=True)
class _Part:
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


def _joined_part(lists: Sequence[np.ndarray], light_samples: int, common: _Digests) -> list[_Part]:
    """Return lists of emitters as one part, or none without emitters."""
    joined = joined_emitters(lists, light_samples)
    return [] if joined is None else [_Part(*joined, np.ones(3, np.float32), common.of(joined[0]))]


def _separate_parts(lists: Sequence[np.ndarray], light_samples: int, common: _Digests) -> list[_Part]:
    """Return lists of emitters as one part each, so that a change of one light leaves the others."""
    units = [_unit(emitters, light_samples) for emitters in lists]
    return [_Part(*unit, common.of(unit[0])) for unit in units]


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
