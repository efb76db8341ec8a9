"""Direct light of probes by shadow rays, as spherical harmonics: lamps, bright surfaces and bright sky."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.buffers import download, upload
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.time_slicer import sliced
from ..direct.light_tree import LIGHT_NODE, LIGHT_TREE_RECORDS, build_light_tree
from ..direct.lighting import DirectLighting
from ..direct.shadow_rays import glow_arguments, sky_arguments
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.light_groups import LightGroups
from ..settings import Settings
from ..visibility.rays.ray_tracer import RayTracer
from .light_parts import emitters_of, light_parts
from .probe_rows import COEFFICIENTS, VALUES, ProbeRows


class ProbeLights:
    """Sampled emitters as seen from probes; see `direct.shadow_rays.ShadowRays`."""

    def __init__(
        self,
        compute: ComputeDevice,
        rays: RayTracer,
        patch_scene: PatchScene,
        lighting: DirectLighting,
        settings: Settings,
        groups: LightGroups | None = None,
    ) -> None:
        """Make the tables of all light and of each light group, if there are any."""
        self._compute, self._rays, self._seed = compute, rays, settings.seed
        _, split = lighting.emitters
        emitters = emitters_of(patch_scene, lighting)
        self._tables = [upload(compute, array) for array in (emitters.modulations, emitters.profiles)]
        self._glow = glow_arguments(compute, patch_scene, split.bright)
        self._sky = sky_arguments(compute, split.sky.distribution)
        self._parts = light_parts(emitters, patch_scene, lighting, settings, groups)
        self._size = int(patch_scene.triangles.mesh.size).bit_length()

    def add(self, probes: ProbeRows, light: np.ndarray) -> Generator[float, None, None]:
        """Add the direct light of probes to their light; yield progress 0..1.

        light:  (n, 1 + g, 9, 3) float32, C-contiguous, SH L2 of radiance: of all light and of g light groups
        """
        parts = {part.digest: part for of_light in self._parts for part in of_light}
        new = [digest for digest in parts if digest not in probes.direct]
        for number, digest in enumerate(new):
            tracing = self._projected(probes, parts[digest].emitters, parts[digest].rays)
            span = number / len(new), (number + 1) / len(new)
            probes.direct[digest] = yield from run_as_fraction(*span, tracing)
        for digest in probes.direct.keys() - parts.keys():
            del probes.direct[digest]
        # NumPy is many times faster in rows of 27 numbers than in rows of 3.
        rows = light.reshape(probes.count, len(self._parts), VALUES)
        for number, of_light in enumerate(self._parts):
            for part in of_light:
                direct = probes.direct[part.digest]
                if not (part.factor == 1).all():
                    direct = direct * np.tile(part.factor, COEFFICIENTS)
                rows[:, number] += direct

    def _projected(
        self, probes: ProbeRows, emitters: np.ndarray, budget: int
    ) -> Generator[float, None, np.ndarray]:
        """Return the direct light of some emitters, (n, 27) float32; yield progress 0..1.

        budget:  number of shadow rays of each probe
        """
        compute, count = self._compute, probes.count
        (kernel,) = self._rays.kernels(
            (*LIGHT_TREE_RECORDS, "light_probes.cl"), "light_probes", options=("-DSPHERE",)
        )
        tree = build_light_tree(emitters)
        nodes = tree.nodes if len(tree.nodes) else LIGHT_NODE.array(1)
        coefficients = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * VALUES * count)
        arguments = (
            probes.probes, upload(compute, emitters), upload(compute, nodes), np.int32(tree.root),
            *self._tables, np.int32(budget), *self._glow, *self._sky, np.uint32(self._seed), coefficients,
        )  # fmt: skip

        def launch(start: int, end: int) -> None:
            self._rays.run(kernel, end - start, *arguments, np.int32(start), np.int32(end))

        size = compute.slice_size(kernel, budget, self._size)
        for end in sliced(compute.queue, 0, count, launch, size):
            yield end / count
        return download(compute, coefficients, (count, VALUES))
