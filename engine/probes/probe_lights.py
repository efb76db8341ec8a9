"""Direct light of probes by shadow rays, as spherical harmonics: lamps, bright surfaces and bright sky."""

from __future__ import annotations

import hashlib
from collections.abc import Generator

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.time_slicer import sliced
from ..direct.emitter_lists import EmitterLists, joined_emitters
from ..direct.light_tree import LIGHT_NODE, LIGHT_TREE_RECORDS, build_light_tree
from ..direct.lighting import DirectLighting
from ..direct.shadow_rays import glow_arguments, sky_arguments
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.light_groups import LightGroups
from ..settings import Settings
from ..visibility.rays.ray_tracer import RayTracer
from .probe_rows import COEFFICIENTS, ProbeRows


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
        self._joined = [
            joined_emitters(
                [records for number, records in enumerate(lists) if number not in left_out],
                settings.light_samples,
            )
            for lists in (emitters.lists, *(emitters.by_group(groups) if groups else ()))
        ]
        self._tables = [upload(compute, array) for array in (emitters.modulations, emitters.profiles)]
        self._glow = glow_arguments(compute, parts, split.bright)
        self._sky = sky_arguments(compute, split.sky.distribution)
        # Shadow rays are traced again only if something that emits light to be sampled has changed.
        radiance = parts.surfaces.emission, parts.surfaces.emission_of_backs
        sources = [
            emitters.modulations,
            emitters.profiles,
            *(radiance if len(split.bright.triangles) else ()),
            split.sky.distribution.pixels,
        ]
        common = hashlib.blake2b(repr(settings.light_samples).encode())
        for array in sources:
            common.update(array.tobytes())
        self._digests = [_digest(common, joined) for joined in self._joined]
        self._size = int(parts.triangles.mesh.size).bit_length()

    def project(self, probes: ProbeRows) -> Generator[float, None, np.ndarray]:
        """Return the direct light of probes, (n, 1 + g, 9, 3) float32: of all light and of g light groups.

        SH L2 of radiance. Yields progress 0..1.
        """
        light = np.zeros((probes.count, len(self._joined), COEFFICIENTS, 3), np.float32)
        for number, joined in enumerate(self._joined):
            known, digest = probes.direct.get(number), self._digests[number]
            if known is not None and known[0] == digest:
                light[:, number] = known[1]
            elif joined is not None:
                span = number / len(self._joined), (number + 1) / len(self._joined)
                light[:, number] = yield from run_as_fraction(*span, self._projected(probes, *joined))
                probes.direct[number] = digest, light[:, number].copy()
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


def _digest(common: hashlib.blake2b, joined: tuple[np.ndarray, int] | None) -> bytes:
    """Return a digest of all that determines the direct light of some emitters.

    common:  digest of the tables of all emitters
    """
    digest = common.copy()
    if joined is not None:
        digest.update(joined[0].tobytes())
    return digest.digest()
