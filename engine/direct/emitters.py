"""Emitter records: lights and emissive triangles that shadow rays sample, packed for the device."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import any_in_rows, largest_in_rows, segment_sums
from ..device.device_struct import DeviceStruct
from ..nonzero import note_rows
from ..patches.geometry import PatchGeometry
from ..patches.patch_scene import PatchScene
from ..scene.color import luminance
from ..scene.cutouts import BACK, BOUNCE
from ..scene.model import Light
from ..scene.triangles import Triangles
from ..visibility.rays.receiver_records import RECEIVER
from .modulation import MODULATION, is_modulated

#: Minimum radiance of a sampled triangle, as a multiple of the mean radiance of emissive surfaces.
_BRIGHT = 10.0

#: Number of triangles whose centroids are looked up at once, so that intermediate arrays stay small.
_BLOCK = 1 << 18

#: Number of sides of the polygon that replaces an ellipse; the polygon has the ellipse's area.
_SIDES = 24

#: Half angle of an area light's spread in radians; lights with a larger spread count as Lambertian.
_WIDEST = 1.57

#: Minimum of that angle, half a degree (chosen). Below it, float32 cannot hold the difference of tangent and
#: angle by which radiance is normalized, and hardly any sample lies in the cone.
_NARROWEST = np.pi / 360

#: Kinds of emitters, as in kernels/direct/emitters.cl.
POINT, SUN, TRIANGLE, SKY_MAP = range(4)

#: Record of a sampled emitter: a point or spot light, a sun, a triangle of a surface or area light, or the
#: bright sky. World space, positions relative to `Triangles.origin`. Fields of other kinds are 0.
EMITTER = DeviceStruct(
    "Emitter",
    ("float[3]", "position", "m: centre of a point, first corner of a triangle"),
    ("float", "radius", "m, of a point; sine of half the angle of a sun's disk"),
    ("float[3]", "direction", "unit: along which a sun or spot shines"),
    ("float", "cos_half_angle", "of a spot's cone, NO_CONE for a point"),
    ("float[3]", "strength", "E/pi of a point at 1 m, and of a sun; radiance of a triangle, W/(m^2 sr)"),
    ("float", "luminance", "by which samples are spread: of E/pi at 1 m, of a triangle's radiance over pi"),
    ("float[3]", "cone_x", "axes of the space in which a spot's cone is round"),
    ("float", "blend", "fraction of a spot's cone in which it fades"),
    ("float[3]", "cone_y", ""),
    ("float", "cone_z", "times the direction: the third axis"),
    ("float[3]", "edge1", "m, of a triangle: from its first corner to the second"),
    ("float", "spread", "rad, of an area light: half the angle in which it shines, pi/2 for everywhere"),
    ("float[3]", "edge2", "m, of a triangle: from its first corner to the third"),
    ("int", "triangle", "number of a surface's triangle, -1 for a part of an area light"),
    ("int", "kind", "POINT (also of a spot), SUN, TRIANGLE or SKY_MAP"),
    ("int", "casts_shadow", "1, or 0 for a lamp that lights through surfaces"),
    ("int", "modulation", "number of a lamp's Modulation, 0 for none"),
    ("int", "falloff_power", "strength is multiplied by the distance, m, to this power"),
    ("int", "uniform", "1 for a triangle of uniform radiance: its light is computed, its shadow sampled"),
    ("int", "one_sided", "1 for a surface's triangle whose back does not shine"),
    ("int", "atlas", "of a surface's triangle"),
    ("int", "soft", "of a point: 1 for a disk that faces the receiver, 0 for a sphere"),
    ("float[3]", "back_strength", "radiance of the back of a surface's triangle, W/(m^2 sr)"),
)

#: Device structs that kernels/direct/emitters.cl needs.
EMITTER_RECORDS: tuple[DeviceStruct, ...] = (RECEIVER, MODULATION, EMITTER)

#: Value of `cos_half_angle` for lights that emit in all directions.
NO_CONE = -2.0

#: Relative tolerance at which emission counts as uniform.
_EVEN = 1e-4


@dataclass(frozen=True)
class SampledTriangles:
    """Emissive triangles that are sampled by shadow rays.

    triangles:          (k,) int, indices into `Triangles`
    radiance:           (k, 3) float32, mean radiance of the front times opacity, W/(m^2 sr)
    back_radiance:      (k, 3) float32, the same of the back
    uniform:            (k,) bool, True if both are constant over the triangle
    gathered_emission:  (n, 3) float32, radiance of each patch's front that is left to the gather
    back_left:          (n, 3) float32, the same of the back
    shining:            (t,) bool, True for triangles with a patch whose back emits
    """

    triangles: np.ndarray
    radiance: np.ndarray
    back_radiance: np.ndarray
    uniform: np.ndarray
    gathered_emission: np.ndarray
    back_left: np.ndarray
    shining: np.ndarray


def choose_sampled_triangles(patch_scene: PatchScene) -> SampledTriangles:
    """Choose triangles that shadow rays sample: those much brighter than the mean of all emissive ones."""
    geometry, surfaces, cutouts = patch_scene.geometry, patch_scene.surfaces, patch_scene.cutouts
    glowing = surfaces.shining
    sources = _emissive_triangles(patch_scene, glowing)
    material, area = patch_scene.triangles.material[sources.number], geometry.steps.whole
    sides = [surfaces.emission]
    if surfaces.back_emission is not None:
        sides.append(surfaces.back_emission)
    means = [_mean_radiance(sources, geometry, side, side[glowing]) for side in sides]

    # Only the opaque fraction of a surface emits.
    front, back = (
        mean * cutouts.stopped(record)[material][:, None] if cutouts.needed else mean
        for mean, record in ((means[0], BOUNCE), (means[-1], BACK + BOUNCE))
    )

    # One-sided triangles do not emit from the back: their back faces are separate triangles.
    back = np.where(patch_scene.triangles.one_sided[sources.number, None], 0, back)
    brightness = np.maximum(luminance(front), luminance(back))
    light = np.zeros(len(area))
    light[sources.number] = brightness * area[sources.number]
    mean = float(light.sum() / max(area.sum(dtype=np.float64), 1e-30))
    is_bright = (brightness > 0) & (brightness >= _BRIGHT * mean)

    # The gather handles the emission of the other triangles.
    rest, index = glowing[~is_bright[sources.of_patch]], np.flatnonzero(is_bright)
    left = [_only(side, rest) for side in sides]
    uniform = np.all(
        [_is_uniform(sources.of_patch, side[glowing], mean) for side, mean in zip(sides, means, strict=True)],
        axis=0,
    )
    if cutouts.needed:
        uniform &= ~cutouts.varies[material]
    radiance = front[index].astype(np.float32), back[index].astype(np.float32)
    return SampledTriangles(
        sources.number[index], *radiance, uniform[index], left[0], left[-1], _shining(patch_scene)
    )


@dataclass(frozen=True)
class _Sources:
    """Emissive triangles.

    number:    (k,) int64, indices of triangles, ascending
    of_patch:  (m,) int64, index into `number` of the triangle of each emissive patch
    nearest:   (k,) int64, patch whose texel contains the centroid of a triangle without patches; else -1
    """

    number: np.ndarray
    of_patch: np.ndarray
    nearest: np.ndarray


def _emissive_triangles(patch_scene: PatchScene, glowing: np.ndarray) -> _Sources:
    """Return the triangles that show emissive patches; glowing: (m,) int64, these patches."""
    nearest = np.full(len(patch_scene.triangles.mesh), -1)
    if len(glowing):
        is_glowing = np.zeros(len(patch_scene.surfaces.emission) + 1, bool)
        is_glowing[glowing + 1] = True
        alone = np.flatnonzero(patch_scene.geometry.on_triangle == 0)
        for first in range(0, len(alone), _BLOCK):
            some = alone[first : first + _BLOCK]
            entry = _entries_at_centroids(patch_scene, some)
            nearest[some] = np.where(is_glowing[entry], entry - 1, -1)
    triangle = patch_scene.geometry.triangle[glowing]
    is_source = nearest >= 0
    is_source[triangle] = True
    number = np.flatnonzero(is_source)
    return _Sources(number, np.searchsorted(number, triangle), nearest[number])


def _entries_at_centroids(patch_scene: PatchScene, triangles: np.ndarray) -> np.ndarray:
    """Return the entry of the index map at the centroid of triangles, (k,) int64: patch + 1, or 0."""
    resolution = patch_scene.texel_to_patch.shape[-1]
    first, second, third = patch_scene.triangles.uvs[triangles].transpose(1, 2, 0)
    x, y = ((first + second + third) / 3 * resolution).astype(int).clip(0, resolution - 1)
    entries: np.ndarray = patch_scene.texel_to_patch[patch_scene.triangles.atlas[triangles], y, x].astype(
        np.int64
    )
    return entries


def _only(emission: np.ndarray, patches: np.ndarray) -> np.ndarray:
    """Return the radiance of some patches in an array of all patches, (n, 3) float32; others are black."""
    left = np.zeros(emission.shape, np.float32)
    left[patches] = emission[patches]
    note_rows(left, patches)
    return left


def no_bright_triangles(patch_scene: PatchScene) -> SampledTriangles:
    """Choose no triangle for shadow rays, so that the gather handles the emission of all surfaces."""
    none, surfaces = np.zeros((0, 3), np.float32), patch_scene.surfaces
    chosen = np.zeros(0, int), none, none, np.zeros(0, bool)
    return SampledTriangles(*chosen, surfaces.emission, surfaces.emission_of_backs, _shining(patch_scene))


def _shining(patch_scene: PatchScene) -> np.ndarray:
    """Return a mask of triangles on which at least one patch emits from its back, (t,) bool."""
    shining = np.zeros(len(patch_scene.triangles.mesh), bool)
    shining[patch_scene.geometry.triangle[patch_scene.surfaces.shining_backs]] = True
    return shining


def _is_uniform(triangle: np.ndarray, emission: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """Return a mask of triangles with uniform emission, (t,) bool.

    triangle, emission:  triangle and radiance of each emissive patch
    mean:                mean radiance of each triangle
    """
    bound = _EVEN * largest_in_rows(mean)[:, None]
    differs = any_in_rows(np.abs(emission - mean[triangle]) > bound[triangle])
    return np.bincount(triangle[differs], minlength=len(mean)) == 0


def _mean_radiance(
    sources: _Sources, geometry: PatchGeometry, emission: np.ndarray, shining: np.ndarray
) -> np.ndarray:
    """Return the mean emitted radiance of emissive triangles, (k, 3) float64, W/(m^2 sr).

    A triangle without patches takes the radiance of the patch whose texel contains its centroid.

    shining:  (m, 3), radiance of the emissive patches
    """
    patches = geometry.on_triangle[sources.number]
    total = segment_sums(shining, sources.of_patch, len(patches))
    mean: np.ndarray = total / np.maximum(patches, 1)[:, None]
    alone = sources.nearest >= 0
    mean[alone] = emission[sources.nearest[alone]]
    return mean


def lamp_records(light: Light, modulation: int = 0) -> np.ndarray:
    """Return the records of one light, (k,) EMITTER; area lights consist of triangles.

    light:       the light, with its position relative to `Triangles.origin`
    modulation:  index of its record, see modulation.pack_modulations; 0 for none
    """
    makers = {"area": _area_records, "sun": _sun_record}
    records = makers.get(light.kind, _point_record)(light)
    if is_modulated(light):
        records["modulation"], records["falloff_power"] = modulation, light.falloff_power
    if light.profile is not None:
        records["luminance"] *= luminance(light.profile.mean)
    return records


def _point_record(light: Light) -> np.ndarray:
    """Return the record of a point or spot light."""
    strength = _over_pi(light)
    return EMITTER.array(
        1,
        kind=POINT,
        luminance=luminance(strength),
        casts_shadow=light.casts_shadow,
        position=light.position,
        strength=strength,
        direction=-light.axes[2],
        radius=light.radius,
        soft=light.soft,
        cos_half_angle=np.cos(light.half_angle) if light.kind == "spot" else NO_CONE,
        blend=light.blend,
        cone_x=light.axes[0] / light.stretch[0],
        cone_y=light.axes[1] / light.stretch[1],
        cone_z=1 / light.stretch[2],
    )


def _sun_record(light: Light) -> np.ndarray:
    """Return the record of a sun."""
    strength = _over_pi(light)
    return EMITTER.array(
        1,
        kind=SUN,
        luminance=luminance(strength),
        casts_shadow=light.casts_shadow,
        strength=strength,
        direction=-light.axes[2],
        radius=np.sin(light.half_angle),
    )


def _over_pi(light: Light) -> np.ndarray:
    """Return a light's strength divided by pi, (3,) float64, because irradiance is stored as E/pi."""
    strength: np.ndarray = light.strength.astype(np.float64) / np.pi
    return strength


def _area_records(light: Light) -> np.ndarray:
    """Return the triangles of an area light: two for a rectangle, a fan for an ellipse."""
    if light.ellipse:
        angle = np.linspace(0, 2 * np.pi, _SIDES + 1)
        radius = 0.5 * np.sqrt(2 * np.pi / (_SIDES * np.sin(2 * np.pi / _SIDES)))
        rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        outline = np.stack([np.zeros_like(rim[1:]), rim[:-1], rim[1:]], axis=1)
    else:
        outline = np.array([[(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5)], [(-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]])
    corners = light.position + (outline * light.size) @ light.axes[:2]

    # Reverse the winding, so that the side along -z is the front.
    corners = corners[:, [0, 2, 1]]
    if np.linalg.det(light.axes) < 0:
        corners = corners[:, [0, 2, 1]]
    records = _triangle_records(corners, np.tile(light.strength, (len(corners), 1)))
    records["casts_shadow"] = light.casts_shadow
    records["uniform"] = light.half_angle >= _WIDEST and not is_modulated(light)
    records["spread"], records["triangle"] = max(light.half_angle, _NARROWEST), -1
    return records


def surface_records(triangles: Triangles, bright: SampledTriangles) -> np.ndarray:
    """Return the records of emissive triangles, (k,) EMITTER."""
    front, back = bright.radiance, bright.back_radiance
    records = _triangle_records(triangles.positions[bright.triangles], front)
    records["luminance"] = np.maximum(luminance(front), luminance(back)) / np.pi
    records["casts_shadow"], records["uniform"] = 1, bright.uniform
    records["triangle"], records["atlas"] = bright.triangles, triangles.atlas[bright.triangles]
    records["back_strength"], records["one_sided"] = back, ~any_in_rows(back)
    return records


def sky_record() -> np.ndarray:
    """Return the record of the bright sky, (1,) EMITTER."""
    return EMITTER.array(1, kind=SKY_MAP, casts_shadow=1)


def _triangle_records(corners: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """Return records of triangles. corners: (k, 3, 3), metres; radiance: (k, 3)."""
    return EMITTER.array(
        len(corners),
        kind=TRIANGLE,
        luminance=luminance(radiance) / np.pi,
        position=corners[:, 0],
        strength=radiance,
        edge1=corners[:, 1] - corners[:, 0],
        edge2=corners[:, 2] - corners[:, 0],
    )
