"""Scene data model: triangle meshes with lightmap UVs, materials, lights and the world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..array_ops import take_rows
from .probe_volume import ProbeVolume
from .profile import Profile
from .reflection_sphere import ReflectionSphere
from .texture import Texture
from .transmission import Transmission


@dataclass(frozen=True)
class BackSide:
    """Diffuse reflectance and emission of the back face; fields as in `Material`."""

    reflectance: np.ndarray
    emission: np.ndarray
    reflectance_map: Texture | None = None
    emission_map: Texture | None = None


@dataclass(frozen=True)
class Material:
    """Diffuse material; each quantity is a constant, multiplied by a texture if there is one.

    Reflectance and emission describe the opaque part of the surface: 1 - the largest channel of
    `transmission.bounce`. The reflectance of a tinted sheet may therefore exceed 1.

    reflectance:   (3,) float32, diffuse reflectance of the front face
    emission:      (3,) float32, W/(m^2 sr), radiance that the front face emits
    translucency:  (3,) float32, diffuse transmittance: fraction of light that leaves the other side
    transmission:  straight-through transmittance, RGB
    back:          reflectance and emission of the back face; None if equal to the front
    """

    name: str
    reflectance: np.ndarray
    emission: np.ndarray
    reflectance_map: Texture | None = None
    emission_map: Texture | None = None
    translucency: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    translucency_map: Texture | None = None
    transmission: Transmission = field(default_factory=Transmission)
    back: BackSide | None = None

    @cached_property
    def translucent(self) -> bool:
        """True if light on one side leaves the other side diffusely."""
        return bool(np.any(self.translucency))


#: Arrays of a mesh with one entry for each triangle.
_TRIANGLE_ARRAYS = ("positions", "normals", "uvs", "face", "subface", "material")

#: `Mesh.atlas` of a mesh without lightmap, which blocks, reflects and emits light.
NO_LIGHTMAP = -1


@dataclass(frozen=True)
class Mesh:
    """Triangles of one object or instance, as a triangle soup.

    Sessions cache data by array, so change a mesh by new arrays, not by edits of its arrays.

    positions:    (t, 3, 3) float32, m, relative to `Scene.origin`, world axes; counter-clockwise seen from
                  the front
    normals:      (t, 3, 3) float32, world space, unit shading normal of each corner
    uvs:          (t, 3, 2) float32, lightmap UV of each corner, in [0, 1]; arbitrary without lightmap
    face:         (t,) int32, polygon of each triangle, ascending
    subface:      (t,) int32, index of the triangle within its polygon, ascending in each polygon
    material:     (t,) int32, index into `Scene.materials`
    atlas:        index of the lightmap, or NO_LIGHTMAP
    texture_uvs:  (t, 3, 2) float32 for each UV map that the materials' textures use, by name
    light_group:  name of the light group of the mesh's emission, see `Scene.light_groups`
    front:        (t,) int32, the front triangle of each back-face triangle, as index among all triangles of
                  the scene; None if the mesh holds no back faces (engine/patches/backs.py)
    """

    name: str
    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    face: np.ndarray
    subface: np.ndarray
    material: np.ndarray
    atlas: int = 0
    texture_uvs: dict[str, np.ndarray] = field(default_factory=dict)
    light_group: str = ""
    front: np.ndarray | None = None

    def subset(self, chosen: np.ndarray) -> Mesh:
        """Return the triangles that a mask selects."""
        numbers = np.flatnonzero(chosen)
        arrays: dict[str, Any] = {name: take_rows(getattr(self, name), numbers) for name in _TRIANGLE_ARRAYS}
        if self.front is not None:
            arrays["front"] = self.front[numbers]
        texture_uvs = {name: take_rows(uvs, numbers) for name, uvs in self.texture_uvs.items()}
        return replace(self, texture_uvs=texture_uvs, **arrays)


#: Valid values of `Light.kind`.
LIGHT_KINDS = ("point", "spot", "sun", "area")


@dataclass(frozen=True)
class Light:
    """Light source that is not a surface; rays do not hit it.

    kind:            one of LIGHT_KINDS
    position:        (3,) float64, m, relative to `Scene.origin`
    axes:            (3, 3) float64, rows are the unit vectors of the local x, y, z axes in world space; spot,
                     sun and area lights emit along -z
    strength:        (3,) float32. point, spot: radiant intensity, W/sr; sun: irradiance at normal incidence,
                     W/m^2; area: radiance P / (pi area), W/(m^2 sr)
    radius:          point, spot: m
    soft:            point, spot: True for a disk that faces the receiver, False for a sphere
    half_angle:      radians. spot: half the cone angle; sun: half the disk's angle; area: half the spread,
                     pi/2 for none
    blend:           spot: fraction of the cone in which the light fades out
    stretch:         (3,) float64, scale along x, y, z; unequal values make the cone of a spot elliptical and
                     rotate the directions of a profile
    size:            (2,) float64, m, area: full widths along x and y
    ellipse:         area: True for an ellipse, False for a rectangle
    casts_shadow:    False if surfaces do not block the light
    profile:         factors of the strength by direction; None for 1 everywhere; not for suns
    falloff_power:   exponent of the distance to the receiver, m, by which the strength is multiplied
    falloff_smooth:  smoothing s, m^2, of the factor d^2 / (s + d^2); neither falloff applies to suns
    light_group:     name of the light's group, see `Scene.light_groups`
    of_world:        True for the sun of a sky texture: part of the world, without a shadow mask
    visible:         True if cameras see the light itself, and reflection cubes therefore show it
    """

    name: str
    kind: str
    position: np.ndarray
    axes: np.ndarray
    strength: np.ndarray
    radius: float = 0.0
    soft: bool = True
    half_angle: float = np.pi / 2
    blend: float = 0.0
    stretch: np.ndarray = field(default_factory=lambda: np.ones(3))
    size: np.ndarray = field(default_factory=lambda: np.zeros(2))
    ellipse: bool = False
    casts_shadow: bool = True
    profile: Profile | None = None
    falloff_power: int = 0
    falloff_smooth: float = 0.0
    light_group: str = ""
    of_world: bool = False
    visible: bool = False

    def relative_to(self, point: np.ndarray) -> Light:
        """Return the light with its position relative to a point, (3,) float64, m."""
        return replace(self, position=self.position - point)


@dataclass(frozen=True)
class Scene:
    """Complete input of a bake, besides the settings.

    meshes, materials:  objects and their materials
    atlases:            name of each lightmap; `Mesh.atlas` indexes it
    world:              (3,) float32, W/(m^2 sr), radiance of the environment; or (h, w, 3) float32,
                        equirectangular. The direction (x, y, z) is at u = 1/2 - atan2(y, x) / (2 pi), v = 1 -
                        acos(z) / pi, row 0 at v = 0 (Cycles, kernel/camera/projection.h)
    origin:             (3,) float64, world space, m: the point to which all positions are relative
    lights:             light sources
    light_groups:       names of the light groups, each a lightmap of output "light_groups"; emitters with
                        another name or none are in group `light_groups.UNGROUPED`
    world_light_group:  name of the world's light group
    metres_per_unit:    metres per scene unit, for messages only: coordinates and settings are in scene units
    probe_volumes:      grids of points that get the radiance from all directions
    reflection_spheres: points that get a cube map
    """

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    atlases: tuple[str, ...] = ("Lightmap",)
    world: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    lights: tuple[Light, ...] = ()
    light_groups: tuple[str, ...] = ()
    world_light_group: str = ""
    metres_per_unit: float = 1.0
    probe_volumes: tuple[ProbeVolume, ...] = ()
    reflection_spheres: tuple[ReflectionSphere, ...] = ()


def shining_lights(scene: Scene) -> tuple[Light, ...]:
    """Return the lights with nonzero strength; lights with a shadow mask come first."""
    shining = (light for light in scene.lights if light.strength.any())
    return tuple(sorted(shining, key=lambda light: light.of_world))


def masked_lights(scene: Scene) -> tuple[Light, ...]:
    """Return the lights with a shadow mask, in the order of `shining_lights`."""
    return tuple(light for light in shining_lights(scene) if not light.of_world)


def emits(material: Material) -> bool:
    """Return True if either face of a material emits light."""
    back = material.back
    return bool(material.emission.any() or (back is not None and back.emission.any()))


def without_emission(material: Material) -> Material:
    """Return a copy of the material without emission on either face."""
    black, back = np.zeros_like(material.emission), material.back
    if back is not None:
        back = replace(back, emission=black, emission_map=None)
    return replace(material, emission=black, emission_map=None, back=back)
