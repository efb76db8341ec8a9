"""Validity of patches after convergence: dark back faces indicate the inside of geometry, lit ones do not."""

from __future__ import annotations

from functools import partial

import numpy as np

from ..device.buffers import upload_float4
from ..device.device_array import Values, colors_on_host, values_at
from ..device.opencl import cl
from ..direct.contact import Contacts
from ..plan.solve_job import SolveJob
from ..solve.reflected_radiance import exitant_radiance
from ..solve.solution import Solution
from ..validity.invalid import is_doubtful, is_invalid
from ..validity.lit_backs import lit_backs, lit_backs_on_host
from ..validity.push_off import find_inside
from ..validity.substitutes import substitute_patches
from .texel_sample_points import TexelGatherJob


def radiance_of(
    solved: SolveJob, source_irradiance: Values, substitute: np.ndarray | None = None
) -> cl.Buffer:
    """Return the exitant radiance of patches on the device, float4 of each, from E/pi (m, 3).

    substitute:  (m,) uint32, substitute patches, see `exitant_radiance`
    """
    if not solved.settings.has_indirect:
        return upload_float4(solved.opencl, solved.emission, first=1, last=1)
    reflectance = solved.patch_scene.surfaces.reflectance
    return exitant_radiance(solved.opencl, solved.emission, reflectance, source_irradiance, substitute)


def substitutes_of(
    texel_job: TexelGatherJob, invalid: np.ndarray, source_irradiance: Values, of_groups: np.ndarray | None
) -> np.ndarray | None:
    """Return the sender that provides the light of each sender in a final gather, (m,) uint32.

    Senders are patches or patch groups. A valid sender provides its own light; a valid neighbour
    provides that of an invalid one. None if all senders are valid.

    invalid:            (n,) bool, invalid patches, see `invalid_patches`
    source_irradiance:  (m, 3) float32, E/pi of the senders
    of_groups:          (m,) uint32, substitutes of the iterations, see `Solution.substitute`
    """
    if texel_job.solved is not texel_job.job:
        invalid = _invalid_groups(texel_job, invalid, of_groups)
    solved = texel_job.solved
    light_of = partial(values_at, source_irradiance)
    find_pairs = partial(solved.kept.find_substitutes, compute=solved.compute)
    return substitute_patches(solved.patch_scene, invalid, light_of, find_pairs)


def _invalid_groups(
    texel_job: TexelGatherJob, invalid: np.ndarray, of_groups: np.ndarray | None
) -> np.ndarray:
    """Return a mask of the invalid patch groups, (m,) bool.

    A group has the light of its representative patch. It is invalid if that patch is invalid, or if the
    iterations replaced the light of the group.

    invalid, of_groups:  see `substitutes_of`
    """
    entries = texel_job.job.patch_scene.texel_to_patch.ravel()[texel_job.solved.patch_scene.patches.key]
    invalid_groups: np.ndarray = invalid[entries.astype(np.int64) - 1]
    if of_groups is not None:
        invalid_groups |= of_groups != np.arange(len(of_groups))
    return invalid_groups


def lit_backs_of(texel_job: TexelGatherJob, radiance: cl.Buffer) -> cl.Buffer | None:
    """Return flags on the device: triangles whose back face emits or reflects light."""
    solved = texel_job.solved
    return lit_backs(solved.opencl, solved.patch_scene, radiance, len(solved.emission))


def _lit_backs(texel_job: TexelGatherJob, source_irradiance: Values) -> cl.Buffer | np.ndarray | None:
    """Return flags of triangles whose back face emits or reflects light, from E/pi (m, 3) of all patches.

    In NumPy if there is no OpenCL.
    """
    solved = texel_job.solved
    if solved.compute is not None:
        return lit_backs_of(texel_job, radiance_of(solved, source_irradiance))
    if not solved.settings.has_indirect:
        return lit_backs_on_host(solved.patch_scene, solved.emission)
    reflectance, light = (
        colors_on_host(solved.patch_scene.surfaces.reflectance),
        colors_on_host(source_irradiance),
    )
    return lit_backs_on_host(solved.patch_scene, solved.emission + reflectance * light[:, :3])


def patch_validity(
    texel_job: TexelGatherJob, atlases: int, contacts: Contacts, solution: Solution
) -> np.ndarray:
    """Return the validity of each patch, (n,) float32; 0 for patches inside geometry.

    Validity is the fraction of the hemisphere without back faces. Back faces with patches do not count, so
    probe rays detect patches among dark back faces instead and set them to 0.

    texel_job: patches and direct light
    atlases:   number of the user's lightmaps
    contacts:  contacts of the patches
    solution:  solution of all light
    """
    job, validity = texel_job.job, solution.validity
    if job.patch_scene.triangles.backs is None or texel_job.choice.method == "none":
        return validity
    lit = _lit_backs(texel_job, solution.source_irradiance)
    unsure = ~(is_invalid(validity, contacts) | contacts.backlit)
    unsure[job.patch_scene.patches.count_in(atlases) :] = False
    return np.where(_inside(texel_job, unsure, lit), np.float32(0), validity)


def invalid_patches(texel_job: TexelGatherJob, validity: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Return a mask of invalid patches, (n,) bool.

    Probe rays decide for doubtful patches, since rays from a patch inside a wall may hit the front of a
    ceiling in which the wall ends.

    validity:  (n,) float32, validity from `patch_validity`
    """
    invalid = is_invalid(validity, contacts)
    if texel_job.job.patch_scene.triangles.backs is None:
        invalid |= _inside(texel_job, is_doubtful(validity) & ~(invalid | contacts.backlit), None)
    return invalid


def _inside(texel_job: TexelGatherJob, tested: np.ndarray, lit: cl.Buffer | np.ndarray | None) -> np.ndarray:
    """Return a mask of the tested patches that lie inside geometry, (n,) bool, from their probe rays.

    tested:  (n,) bool, patches to test; it excludes patches lit by back faces, see `Contacts.backlit`
    lit:     marks of back faces that reflect or emit light; None if no back face has patches
    """
    patch_scene, all_rays, number = (
        texel_job.job.patch_scene,
        texel_job.job.rays,
        int(np.count_nonzero(tested)),
    )
    if not number:
        return tested
    # Many patches are tested together with all others, whose records are on the device already.
    all_of_them = 2 * number > texel_job.job.count
    points = all_rays if all_of_them else all_rays.of(patch_scene.subset(tested))
    inside = find_inside(points, points.count, 1.0, patch_scene.geometry.steps.geometric, lit)
    if all_of_them:
        return inside & tested
    found = np.zeros_like(tested)
    found[tested] = inside
    return found
