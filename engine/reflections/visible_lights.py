"""Lights that reflection cubes show: lights with Camera visibility, and the suns of the sky."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..array_ops import to_float4
from ..device.buffers import download, upload
from ..device.opencl import cl
from ..direct.emitters import EMITTER_RECORDS, lamp_records
from ..direct.modulation import pack_modulations
from ..scene.model import Light
from ..visibility.rays.ray_tracer import RayTracer
from .cube_faces import texel_solid_angles, texels_of

#: Points on a light, at first; points for each texel that it covers; and maximum number of points (chosen).
_POINTS, _OF_TEXEL, _MOST_POINTS = 1 << 15, 16, 1 << 20


class VisibleLights:
    """Lights that cube maps show, by shadow rays to points on them, since few rays would hit small ones.

    rays:    ray tracer of the scene
    lights:  all lights, with positions relative to `Triangles.origin`
    """

    def __init__(self, rays: RayTracer, lights: Sequence[Light]) -> None:
        self._rays, self._compute = rays, rays.compute
        shown = [light for light in lights if _is_visible(light)]
        modulations, profiles, numbers = pack_modulations(shown)
        self._tables = [upload(self._compute, table) for table in (modulations, profiles)] if shown else []
        self._lights = [lamp_records(light, number) for light, number in zip(shown, numbers, strict=True)]

    def add(self, faces: np.ndarray, point: np.ndarray) -> None:
        """Add the light that arrives at a point to faces, (6, s, s, 3) float32.

        point:  (3,) float64, m, relative to `Triangles.origin`
        """
        size = faces.shape[1]
        angles = np.tile(texel_solid_angles(size).ravel(), 6)
        for records in self._lights:
            texels, light = self._samples(records, point, size, _POINTS)
            wanted = min(_OF_TEXEL * len(np.unique(texels)), _MOST_POINTS)
            if wanted > _POINTS:
                texels, light = self._samples(records, point, size, wanted)
            radiance = (light / angles[texels, None]).astype(np.float32)
            np.add.at(faces.reshape(-1, 3), texels, radiance)

    def _samples(
        self, records: np.ndarray, point: np.ndarray, size: int, points: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the texel of each point of a light, (k,) int64, and its irradiance, (k, 3) float32."""
        compute, samples = self._compute, -(-points // len(records))
        count = samples * len(records)
        (kernel,) = self._rays.kernels(
            (*EMITTER_RECORDS, "sample_lights.cl"), "sample_lights", options=("-DSPHERE",)
        )
        outputs = [cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 16 * count) for _ in range(2)]
        self._rays.run(
            kernel, count, upload(compute, records), *self._tables, to_float4(point[None])[0],
            np.int32(samples), *outputs, np.int32(count),
        )  # fmt: skip
        ways, light = (download(compute, output, (count, 4))[:, :3] for output in outputs)
        lit = light.any(axis=1)
        return texels_of(ways[lit], size), light[lit]


def _is_visible(light: Light) -> bool:
    """Return True if cameras see a light; lights without a size are invisible, as in Cycles."""
    sizes = {"area": light.size.min(), "sun": light.half_angle}
    has_size = sizes.get(light.kind, light.radius) > 0
    return bool(light.strength.any() and (light.of_world or (light.visible and has_size)))
