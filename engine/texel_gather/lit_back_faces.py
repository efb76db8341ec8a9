"""Open surfaces whose back faces are lit while their front faces, which lightmaps show, are dark.

The light of back faces is estimated on the host, with a few rays from a few points, and only for objects that
are dark.
"""

from __future__ import annotations

import numpy as np

from ..array_ops import any_in_rows, taken
from ..device.device_array import Values, colors_on_host, values_at
from ..object_message import object_message
from ..patches.unmapped_meshes import triangle_areas
from ..plan.solve_job import SolveJob
from ..scene.color import luminance
from ..scene.cutouts import SHADOW
from ..scene.model import Light, Scene, shining_lights
from ..scene.open_surfaces import closed_meshes
from ..scene.transmission import Transmission
from ..visibility.views.directions import r2_sequence

#: Maximum light of dark front faces as a fraction of the scene's light and of the light of the back faces
#: (chosen).
_DARK = 0.02

#: Number of evenly spaced patches that show which objects are surely not dark, the multiple of the limit that
#: the mean of an object's sampled patches must exceed, and the minimum number of these patches. From _ENOUGH
#: sampled patches on, their mean stands for that of all patches of the object (chosen).
_SAMPLED, _SURELY, _FEWEST, _ENOUGH = 1 << 16, 4.0, 16, 1 << 12

#: Minimum light of lit back faces as a fraction of the scene's light (chosen).
_LIT = 0.1

#: Numbers of points of an object and of gather rays of a point.
_POINTS, _RAYS = 32, 32

#: Maximum number of dark objects that are examined, so that the time is bounded.
_OBJECTS = 64

#: Maximum number of lamps whose shadows are traced for an object: the brightest ones without shadows.
_LAMPS = 8

#: Height of ray origins above the surface as a fraction of the scene's diagonal.
_HEIGHT = 1e-4

_SENTENCE = (
    "{}: the back faces are lit and the front faces are dark, and lightmaps store the light of front faces. "
    "Flip the normals, or give the mesh thickness."
)


def warn_lit_back_faces(scene: Scene, job: SolveJob, irradiance: Values, atlases: int) -> list[str]:
    """Return a warning that names the objects whose lightmap is dark only because of their normals.

    Surfaces that emit or transmit light are left out: a lamp lights the wall behind it, and the lightmap of a
    translucent surface contains the light of both sides.

    irradiance:  (n, 3) float32, E/pi of all patches
    atlases:     number of the user's lightmaps
    """
    triangles, patches = job.patch_scene.triangles, job.patch_scene.geometry.triangle
    if not len(patches):
        return []
    meshes = len(scene.meshes)
    emits = np.bincount(triangles.mesh[patches[_emitters(job)]], minlength=meshes) > 0
    mapped = np.array([mesh.atlas < atlases for mesh in scene.meshes], bool)
    examined = mapped & ~emits & ~_passes_light(scene)

    # Few patches show that most objects are not dark.
    some = np.arange(0, len(patches), max(1, len(patches) // _SAMPLED))
    light = luminance(values_at(irradiance, some))
    level = max(float(light.mean(dtype=np.float64)), _open_light(scene))
    count, total = _light_of_meshes(triangles.mesh[patches[some]], light, meshes)
    examined &= _may_be_dark(count, total, level)
    if not examined.any():
        return []
    unsure = examined & (count < _ENOUGH)
    if unsure.any():
        chosen = np.flatnonzero(taken(unsure[triangles.mesh], patches))
        of_chosen = triangles.mesh[taken(patches, chosen)]
        light = luminance(values_at(irradiance, chosen))
        all_count, all_total = _light_of_meshes(of_chosen, light, meshes)
        count, total = np.where(unsure, all_count, count), np.where(unsure, all_total, total)
    dark = _open_meshes(scene, np.flatnonzero(examined & (count > 0) & (total <= _DARK * level * count)))
    if not dark:
        return []
    lit = _BackLight(scene, job, colors_on_host(irradiance))
    names = [
        scene.meshes[index].name
        for index in dark
        if (back := lit.mean_of(index)) > _LIT * level and total[index] < _DARK * back * count[index]
    ]
    return [object_message(_SENTENCE, list(dict.fromkeys(names)))] if names else []


def _may_be_dark(count: np.ndarray, total: np.ndarray, level: float) -> np.ndarray:
    """Return a mask of the meshes that may be dark, (m,) bool: sampled patches are few or not clearly lit.

    count:  (m,) int64, sampled patches
    total:  (m,) float64, sum of their light
    level:  mean light of the scene
    """
    may: np.ndarray = (count < _FEWEST) | (total <= _SURELY * _DARK * level * count)
    return may


def _light_of_meshes(mesh: np.ndarray, light: np.ndarray, meshes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of patches of each mesh, (m,) int64, and the sum of their light, (m,) float64.

    mesh:   (k,) int32, mesh of each patch
    light:  (k,) float32
    """
    return np.bincount(mesh, minlength=meshes), np.bincount(mesh, light, meshes)


def _emitters(job: SolveJob) -> np.ndarray:
    """Return the patches whose front face emits light, (k,) int64."""
    surfaces = job.patch_scene.surfaces
    return surfaces.shining[any_in_rows(surfaces.emission[surfaces.shining])]


def _open_light(scene: Scene) -> float:
    """Return the luminance of E/pi without any shadow: the larger of the mean sky and the brightest sun."""
    sky = float(luminance(scene.world.reshape(-1, 3)).mean(dtype=np.float64))
    suns = [float(luminance(lamp.strength[None])[0]) / np.pi for lamp in scene.lights if lamp.kind == "sun"]
    return max(sky, *suns, 0.0)


def _open_meshes(scene: Scene, chosen: np.ndarray) -> list[int]:
    """Return the open ones of chosen meshes, at most the `_OBJECTS` largest."""
    areas = [float(triangle_areas(scene.meshes[index].positions).sum()) for index in chosen]
    largest = np.sort(chosen[np.argsort(areas)[::-1]][:_OBJECTS])
    closed = closed_meshes([scene.meshes[index].positions for index in largest])
    return [int(index) for index, is_closed in zip(largest, closed, strict=True) if not is_closed]


def _passes_light(scene: Scene) -> np.ndarray:
    """Return a mask of the meshes with a material that transmits light, (m,) bool."""
    passes = np.array([each.translucent or _passes(each.transmission) for each in scene.materials], bool)
    if not passes.any():
        return np.zeros(len(scene.meshes), bool)
    return np.array([passes[mesh.material].any() for mesh in scene.meshes], bool)


def _passes(transmission: Transmission) -> bool:
    """Return True if light can pass straight through a material at some point and in some direction."""
    sides = (transmission.shadow, transmission.bounce, transmission.shadow_back, transmission.bounce_back)
    return any(
        bool(side.offset.any() or side.scale.any() or side.texture is not None)
        for side in sides
        if side is not None
    )


def _unit_square(count: int) -> np.ndarray:
    """Return points of the unit square, (count, 2) float64."""
    points: np.ndarray = r2_sequence(count) / 2.0**32
    return points


class _BackLight:
    """Estimate of the light of back faces, from the solved patches."""

    def __init__(self, scene: Scene, job: SolveJob, irradiance: np.ndarray) -> None:
        self._triangles, self._tracer = job.patch_scene.triangles, job.rays.caster
        self._lamps = [lamp for lamp in shining_lights(scene) if lamp.casts_shadow]
        self._sky = float(luminance(scene.world.reshape(-1, 3)).mean(dtype=np.float64))
        surfaces, triangle = job.patch_scene.surfaces, job.patch_scene.geometry.triangle
        sent = luminance(surfaces.emission + surfaces.reflectance * irradiance)
        count = np.bincount(triangle, minlength=len(self._triangles.mesh))
        self._radiance = np.bincount(triangle, sent, len(count)) / np.maximum(count, 1)

    def mean_of(self, mesh: int) -> float:
        """Return the mean luminance of E/pi at points of the back faces of a mesh."""
        points, normals = self._points_of(mesh)
        lights = [self._unshadowed(lamp, points, normals) for lamp in self._lamps]
        lights.sort(key=lambda found: -float(found[0].sum()))
        lamps = sum(self._shadowed(points, *found) for found in lights[:_LAMPS] if found[0].any())
        return self._gathered(points, normals) + float(np.mean(lamps))

    def _points_of(self, mesh: int) -> tuple[np.ndarray, np.ndarray]:
        """Return points on back faces, (p, 3) float64 relative to `Triangles.origin`, and their normals."""
        own = np.flatnonzero(self._triangles.mesh == mesh)
        corners = self._triangles.positions[own].astype(np.float64)
        across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
        areas = np.linalg.norm(across, axis=1)
        where, places = np.cumsum(areas), _unit_square(_POINTS)
        chosen = np.searchsorted(where, (np.arange(_POINTS) + 0.5) / _POINTS * where[-1]).clip(
            max=len(own) - 1
        )
        root = np.sqrt(places[:, :1])
        weights = np.concatenate([1 - root, root * (1 - places[:, 1:]), root * places[:, 1:]], axis=1)
        normals = across[chosen] / np.maximum(areas[chosen, None], 1e-30)
        points = np.einsum("pk,pkd->pd", weights, corners[chosen])
        return points + _HEIGHT * self._triangles.diagonal * normals, normals

    def _gathered(self, points: np.ndarray, normals: np.ndarray) -> float:
        """Return the mean luminance of E/pi from surfaces and sky, with cosine-distributed rays."""
        spots = _unit_square(_POINTS * _RAYS)
        height, angle = 2 * spots[:, 0] - 1, 2 * np.pi * spots[:, 1]
        radius = np.sqrt(1 - height * height)
        sphere = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)

        # Consecutive spots are neighbours, so each goes to another point.
        directions = np.tile(normals, (_RAYS, 1)) + 0.999 * sphere
        hit, front, _ = self._tracer.cast(np.tile(points, (_RAYS, 1)), directions)
        return float(np.where(hit < 0, self._sky, np.where(front, self._radiance[hit], 0)).mean())

    def _unshadowed(
        self, lamp: Light, points: np.ndarray, normals: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the luminance of E/pi from the centre of a lamp without shadows, (p,), and vectors to it."""
        away, strength = (
            np.asarray(lamp.axes[2], np.float64),
            float(luminance(lamp.strength[None])[0]) / np.pi,
        )
        if lamp.kind == "sun":
            ways = np.broadcast_to(away * 2 * self._triangles.diagonal, points.shape)
            scale = np.full(len(points), strength)
        else:
            ways = lamp.position - self._triangles.origin - points
            square = np.maximum((ways * ways).sum(axis=1), 1e-30)
            forward = (ways @ away) / np.sqrt(square)
            scale = strength / square
            if lamp.kind == "spot":
                scale = np.where(forward > np.cos(lamp.half_angle), scale, 0)
            if lamp.kind == "area":
                scale = scale * np.maximum(forward, 0) * float(np.prod(lamp.size))
        cosine = (ways * normals).sum(axis=1) / np.linalg.norm(ways, axis=1)
        return scale * np.maximum(cosine, 0), ways

    def _shadowed(self, points: np.ndarray, light: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Return the light of a lamp at the points that no surface shadows, (p,); 0 at others."""
        hit, _, distance = self._tracer.cast(points, ways, kind=SHADOW)
        is_free = (hit < 0) | (distance > 1)
        return np.where(is_free, light, 0)
