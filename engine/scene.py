"""What is baked: triangles with lightmap UVs, and materials."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .errors import SceneError


@dataclass(frozen=True)
class Material:
    """A diffuse surface.

    reflectance  (3,) float32, in [0, 1]
    emission     (3,) float32, radiance, sent out by both sides of the surface
    """

    name: str
    reflectance: np.ndarray
    emission: np.ndarray


@dataclass(frozen=True)
class Mesh:
    """The triangles of one object, as a triangle soup of corners.

    positions  (t, 3, 3) float32, metres from `Scene.origin` along the world's axes; counter-clockwise
               seen from the front
    normals    (t, 3, 3) float32, world space, unit shading normal of each corner
    uvs        (t, 3, 2) float32, lightmap UV of each corner, in [0, 1]
    face       (t,) int32, index of the polygon a triangle belongs to, ascending
    subface    (t,) int32, index of the triangle within its polygon, ascending in each polygon
    material   (t,) int32, index into `Scene.materials`
    atlas      index of the lightmap that holds the object's charts
    """

    name: str
    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    face: np.ndarray
    subface: np.ndarray
    material: np.ndarray
    atlas: int = 0


@dataclass(frozen=True)
class Scene:
    """Everything the engine needs to know.

    atlases  name of each lightmap; `Mesh.atlas` indexes it
    world    (3,) float32, radiance of the surroundings
    origin   (3,) float64, world space: the point that all `Mesh.positions` are relative to
    """

    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    atlases: tuple[str, ...] = ("Lightmap",)
    world: np.ndarray = field(default_factory=lambda: np.zeros(3, np.float32))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))


#: Greater radiances count as infinite: sums of them would leave float32.
MAX_RADIANCE = 1e30

#: Lightmap UVs may leave [0, 1] by this much before it counts as an error.
UV_TOLERANCE = 1e-4


def check_scene(scene: Scene) -> None:
    """Raise a SceneError that names the object if the scene cannot be baked."""
    if not any(len(mesh.positions) for mesh in scene.meshes):
        raise SceneError(
            "The scene has no mesh with faces to bake. Add a mesh object, or make one visible "
            "in the viewport and in renders."
        )
    for mesh in scene.meshes:
        check_mesh(mesh)
    for material in scene.materials:
        check_material(material)
    if not _is_light(scene.world):
        raise SceneError("The world's radiance is NaN, infinite or negative. Mend its colour and strength.")


def check_mesh(mesh: Mesh) -> None:
    """Raise a SceneError if a mesh has coordinates, normals or UVs that cannot be used."""
    if not np.isfinite(mesh.positions).all():
        raise SceneError(
            f"Object '{mesh.name}' has NaN or infinite vertex coordinates. "
            "Delete those vertices, or check the modifiers and the object's scale."
        )
    if not np.isfinite(mesh.uvs).all():
        raise SceneError(
            f"Object '{mesh.name}' has NaN or infinite lightmap UVs. Unwrap its lightmap UVs again."
        )
    if len(mesh.uvs) and (mesh.uvs.min() < -UV_TOLERANCE or mesh.uvs.max() > 1 + UV_TOLERANCE):
        raise SceneError(
            f"Object '{mesh.name}' has lightmap UVs outside 0-1. "
            "Pack its UV islands into the unit square, or delete the lightmap UV layer to have one made."
        )


def check_material(material: Material) -> None:
    """Raise a SceneError if a material's numbers are no light."""
    if not _is_light(material.reflectance) or np.max(material.reflectance) > 1:
        raise SceneError(
            f"Material '{material.name}' has a reflectance that is not between 0 and 1. Mend its base colour."
        )
    if not _is_light(material.emission):
        raise SceneError(
            f"Material '{material.name}' has an emission that is NaN, infinite or negative. "
            "Mend its emission colour and strength."
        )


def _is_light(values: np.ndarray) -> bool:
    """True for numbers that float32 sums of many can hold."""
    return bool(np.isfinite(values).all() and np.min(values) >= 0 and np.max(values) <= MAX_RADIANCE)
