"""What is baked: triangles with lightmap UVs, materials, lights and the world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from .profile import Profile
from .texture import Texture
from .transmission import Transmission


@dataclass(frozen=True)
class BackSide:
    """Emission and diffuse reflectance of the back of a surface; fields as in `Material`."""

    reflectance: np.ndarray
    emission: np.ndarray
    reflectance_map: Texture | None = None
    emission_map: Texture | None = None


@dataclass(frozen=True)
class Material:
    """A diffuse surface; each quantity is a constant, multiplied by a texture if there is one.

    reflectance and emission belong to the part of the surface that stops rays: 1 - the largest channel of
    `transmission.bounce`. So the reflectance of a tinted sheet may exceed 1.

    reflectance      (3,) float32, diffuse reflectance of the front
    emission         (3,) float32, radiance that the front emits, W/(m^2 sr)
    translucency     (3,) float32, diffuse transmittance: fraction of the light that leaves the other side
    transmission     straight-through transmittance, RGB
    back             reflectance and emission of the back; None is as the front
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

    @property
    def translucent(self) -> bool:
        """True if light that falls on one side leaves the other side diffusely."""
        return bool(np.any(self.translucency))


#: The arrays of a mesh, one entry a triangle.
_TRIANGLE_ARRAYS = ("positions", "normals", "uvs", "face", "subface", "material")

#: `Mesh.atlas` of a mesh that is seen and reflects, but is in no lightmap.
NO_LIGHTMAP = -1


@dataclass(frozen=True)
class Mesh:
    """The triangles of one object or instance, as a triangle soup of corners.

    positions     (t, 3, 3) float32, metres from `Scene.origin` along the world's axes;
                  counter-clockwise seen from the front
    normals       (t, 3, 3) float32, world space, unit shading normal of each corner
    uvs           (t, 3, 2) float32, lightmap UV of each corner, in [0, 1]; any for an occluder
    face          (t,) int32, index of the polygon a triangle belongs to, ascending
    subface       (t,) int32, index of the triangle within its polygon, ascending in each polygon
    material      (t,) int32, index into `Scene.materials`
    atlas         index of the lightmap that holds the object's charts, or NO_LIGHTMAP
    texture_uvs   (t, 3, 2) float32 of each UV map that the materials' textures name
    light_group   name of the light group that what it emits belongs to, see `Scene.light_groups`
    front         (t,) int32, index among all triangles of the scene: the front of each triangle, if the mesh
                  holds back faces (engine/patches/backs.py); None for all other meshes
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

    def part(self, chosen: np.ndarray) -> Mesh:
        """Return the triangles that a mask selects."""
        arrays = {name: getattr(self, name)[chosen] for name in _TRIANGLE_ARRAYS}
        if self.front is not None:
            arrays["front"] = self.front[chosen]
        return replace(
            self, texture_uvs={name: uvs[chosen] for name, uvs in self.texture_uvs.items()}, **arrays
        )


#: Kinds of lights.
LIGHT_KINDS = ("point", "spot", "sun", "area")


@dataclass(frozen=True)
class Light:
    """A light that is no surface: nothing sees it, it only lights.

    kind         one of LIGHT_KINDS
    position     (3,) float64, metres from `Scene.origin`
    axes         (3, 3) float64, rows are the unit vectors of its local x, y, z in world space; spot,
                 sun and area light shine along -z
    strength     (3,) float32. point, spot: radiant intensity, W/sr; sun: irradiance of a surface that
                 faces it, W/m^2; area: radiance P / (pi area), W/(m^2 sr)
    radius       point, spot: m
    soft         point, spot: True for a disk that faces the receiver, False for a sphere
    half_angle   spot: of the cone; sun: of its disk; area: half its spread, pi/2 for none; radians
    blend        spot: fraction of the cone in which it fades
    stretch      (3,) float64, scale along x, y, z: unequal ones make the cone of a spot elliptical and turn
                 the directions of a profile
    size         (2,) float64, area: full widths along x and y, m
    ellipse      area: True for an ellipse, False for a rectangle
    casts_shadow False lights through surfaces
    profile      factors of strength over directions, None for 1 everywhere; not of a sun
    falloff_power   strength is multiplied by the distance to the receiver, m, to this power
    falloff_smooth  and by d^2 / (smooth + d^2), m^2; neither of a sun
    light_group  name of the light group that it belongs to, see `Scene.light_groups`
    of_world     True for the sun of a sky: a part of the surroundings, without a shadow mask
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

    def relative_to(self, point: np.ndarray) -> Light:
        """Return the light with a position relative to a point, (3,) float64, metres."""
        return replace(self, position=self.position - point)


@dataclass(frozen=True)
class Scene:
    """Everything the engine needs to know.

    atlases  name of each lightmap; `Mesh.atlas` indexes it
    world    (3,) float32, radiance of the surroundings; or (h, w, 3) float32, equirectangular: the
             direction (x, y, z) is at u = 1/2 - atan2(y, x) / (2 pi), v = 1 - acos(z) / pi, row 0 at
             v = 0 (Cycles, kernel/camera/projection.h)
    origin   (3,) float64, world space: the point that all positions are relative to
    light_groups  names of groups of light, each with a lightmap of its own as output "light_groups"; what
             names another one, or none, is in the group `light_groups.UNGROUPED`
    world_light_group  name of the group of the surroundings
    metres_per_unit    for texts alone: coordinates and settings are in the scene's units of length
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


def shining_lights(scene: Scene) -> tuple[Light, ...]:
    """Return the lamps of a scene that give light, those with a shadow mask first."""
    shining = (light for light in scene.lights if light.strength.any())
    return tuple(sorted(shining, key=lambda light: light.of_world))


def masked_lights(scene: Scene) -> tuple[Light, ...]:
    """Return the lamps that give light and have a shadow mask, in the order of `shining_lights`."""
    return tuple(light for light in shining_lights(scene) if not light.of_world)


def emits(material: Material) -> bool:
    """Return True if a side of a material emits light."""
    back = material.back
    return bool(material.emission.any() or (back is not None and back.emission.any()))


def without_emission(material: Material) -> Material:
    """Return a material that emits nothing at either side."""
    black, back = np.zeros_like(material.emission), material.back
    if back is not None:
        back = replace(back, emission=black, emission_map=None)
    return replace(material, emission=black, emission_map=None, back=back)
