"""Reflection cubes of a scene from the solved patches: rays, textures, sky, and prefiltered levels."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence

import numpy as np

from ..bake_result import ReflectionCube
from ..device.device_array import colors_on_host
from ..direct.contact import Contacts
from ..progress import run_as_fraction
from ..scene.color import luminance
from ..scene.reflection_sphere import ReflectionSphere
from ..solve.solution import Solution
from ..texel_gather.texel_sample_points import TexelGatherJob
from ..validity.invalid import is_invalid
from ..validity.thresholds import DARK_BACK, MAX_BACKS_PROBE
from .prefilter import prefiltered
from .trace_cubes import CubeTracer, PatchLight

#: Maximum number of texels of all cube maps of a bake, without levels: 85 of 6 x 256 x 256 (chosen; they take
#: 540 MB).
MAX_TEXELS = 1 << 25

#: Share of tracing in the time of a cube map (measured on a CPU).
_TRACING = 0.6

#: Weight of an invalid patch in interpolation: it counts only without valid ones.
_INVALID_WEIGHT = 1e-3

#: Luminance below which a back face is dark in a scene without light.
_BLACK = 1e-30


def gather_reflections(
    texel_job: TexelGatherJob,
    solution: Solution,
    validity: np.ndarray,
    contacts: Contacts,
    images: Mapping[str, np.ndarray],
) -> Generator[float, None, tuple[tuple[ReflectionCube, ...], tuple[str, ...]]]:
    """Return the reflection cubes of a scene, and warnings; yield the fraction done.

    texel_job: patches and direct light
    solution:  solution of all light
    validity:  (n,) float32, validity of the patches, see `patch_validity`
    contacts:  contacts of the patches
    images:    final lightmaps, (atlases, r, r, 3) float32, by output; "combined" is shown where it exists
    """
    job = texel_job.job
    size = job.settings.reflection_size
    spheres, warnings = _fitting(texel_job.scene.reflection_spheres, size)
    light = _patch_light(texel_job, solution, is_invalid(validity, contacts), images.get("combined"))
    tracer = CubeTracer(job.opencl, job.rays.rays, texel_job.scene, job.patch_scene, light)
    made = list[ReflectionCube]()
    for number, sphere in enumerate(spheres):
        begin, width = number / len(spheres), 1 / len(spheres)
        tracing = tracer.faces(sphere.position, size)
        faces, outside = yield from run_as_fraction(begin, begin + _TRACING * width, tracing)
        filtering = prefiltered(job.opencl, faces)
        levels = yield from run_as_fraction(begin + _TRACING * width, begin + width, filtering)
        made.append(ReflectionCube(number, tuple(levels)))
        if outside < 1 - MAX_BACKS_PROBE:
            warnings.append(
                f"Light Probe Sphere '{sphere.name}': it is inside geometry, so its reflection is dark. Move "
                "it into the open."
            )
    return tuple(made), tuple(warnings)


def _fitting(spheres: Sequence[ReflectionSphere], size: int) -> tuple[Sequence[ReflectionSphere], list[str]]:
    """Return the spheres whose cube maps fit into `MAX_TEXELS`, the first ones, and a warning if not all."""
    most = max(1, MAX_TEXELS // (6 * size * size))
    if len(spheres) <= most:
        return spheres, []
    return spheres[:most], [
        f"Light Probe Spheres: {len(spheres)} cubes of {size} x {size} exceed {most}, so those after "
        f"'{spheres[most - 1].name}' have none. Lower Cube Resolution, or disable some in renders."
    ]


def _patch_light(
    texel_job: TexelGatherJob, solution: Solution, invalid: np.ndarray, combined: np.ndarray | None
) -> PatchLight:
    """Return the light of the patches: of the final lightmaps where there are any, else of the solution.

    invalid:   (n,) bool, invalid patches
    combined:  (atlases, r, r, 3) float32, E/pi; None if it is no output
    """
    patches = texel_job.job.patch_scene.patches
    light = np.empty((len(patches), 4), np.float32)
    light[:, :3] = colors_on_host(solution.light)
    light[:, 3] = np.where(invalid, _INVALID_WEIGHT, 1)
    if combined is not None:
        mapped = slice(patches.count_in(len(combined)))
        light[mapped, :3] = combined.reshape(-1, 3)[patches.key[mapped]]
        light[mapped, 3] = 1
    mean = float(luminance(light[:, :3]).mean()) if len(light) else 0.0
    return PatchLight(light, max(DARK_BACK * mean, _BLACK))


def reflection_warnings(texel_job: TexelGatherJob) -> tuple[str, ...]:
    """Return the warning that cubes cannot be baked, or that bounced light is missing; else nothing."""
    if texel_job.job.compute is None:
        return (
            "Light Probe Spheres: no OpenCL device. Install an OpenCL driver, or switch Reflection Cubes "
            "off.",
        )
    if not texel_job.job.settings.has_indirect:
        return (
            "Light Probe Spheres: no output has bounced light, so reflections have none. Switch Combined on.",
        )
    return ()
