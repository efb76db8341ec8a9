"""Validation of scenes: numeric limits, and errors that name the object."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..array_ops import map_blocks
from ..errors import SceneError
from .cutouts import distinct_transmittances, is_tinted_material, transmission_maps
from .mesh_groups import joined, mesh_boxes, mesh_groups
from .model import LIGHT_KINDS, NO_LIGHTMAP, Light, Material, Mesh, Scene
from .probe_volume import MAX_PROBES, ProbeVolume, volume_issue
from .profile import check_profile
from .reflection_sphere import ReflectionSphere, sphere_issue
from .texture import Texture
from .transmission import Transmittance

#: Maximum radiance, W/(m^2 sr); sums of larger values overflow float32.
MAX_RADIANCE = 1e30

#: Maximum strength of a light, see `Light.strength`: divided by the least squared distance of kernels,
#: 1e-20 m^2, it fits into float32. A room of the largest extent needs half of it for a radiance of 1.
MAX_STRENGTH = 2e18

#: Maximum coordinate, m. Areas and their squares then fit into float32. Measured: furnace scenes of 4e9 m are
#: correct, of 1e10 m black.
LARGEST = 1e9

#: Minimum size of a scene, m. Measured: furnace scenes of 2.5e-10 m are correct; at 1e-10 m triangles have no
#: area.
SMALLEST = 1e-9

#: Maximum distance of a light, m; its square times an area fits into float32.
FARTHEST_LIGHT = 1e15

#: Tolerance of lightmap UVs outside [0, 1].
UV_TOLERANCE = 1e-4

#: Axes of each kind of light that must be unit vectors, and the tolerance of their length.
_AXES_NEEDED = {"sun": slice(2, 3), "spot": slice(3), "area": slice(3)}
_UNIT_TOLERANCE = 1e-3

#: Maximum reflectance of the opaque part of a tinted surface whose textures vary its transmittance.
_LARGEST_REFLECTANCE = 1e3

#: Tolerance of transmittance outside [0, 1], for rounding.
_ROUNDING = 1e-6

#: Number of values up to which a loop is faster than NumPy.
_FEW = 8

#: Values of light that error messages call invalid.
_NO_LIGHT = f"NaN, negative or greater than {MAX_RADIANCE:.0e}"
_NO_STRENGTH = f"NaN, negative or greater than {MAX_STRENGTH:.0e}"


def check_scene(scene: Scene) -> None:
    """Raise SceneError with the object's name if the scene cannot be baked."""
    if not any(len(mesh.positions) for mesh in scene.meshes):
        raise SceneError(
            "The scene has no mesh with faces to bake. Add a mesh object, or enable one in renders."
        )
    check_meshes(scene.meshes)
    check_references(scene)
    check_size(scene)
    for material in scene.materials:
        check_material(material)
    for light in scene.lights:
        check_light(light)
    check_world(scene.world)
    check_probe_volumes(scene.probe_volumes)
    check_reflection_spheres(scene.reflection_spheres)


def check_size(scene: Scene) -> None:
    """Raise SceneError with an object's name if the scene is too large or too small for float32."""
    meshes = [mesh for mesh in scene.meshes if len(mesh.positions)]
    low, high = mesh_boxes(meshes)
    reach = np.maximum(-low, high).max(axis=1)
    farthest = int(reach.argmax())
    if reach[farthest] > LARGEST:
        raise SceneError(
            f"Object '{meshes[farthest].name}' reaches {reach[farthest]:.3g} units from the middle of the "
            f"scene; at most {LARGEST:.0e} units can be baked. Delete its far vertices, move it closer, or "
            "scale the scene down."
        )
    size = (high.max(axis=0) - low.min(axis=0)).max()
    if size < np.float32(SMALLEST):
        largest = meshes[int((high - low).max(axis=1).argmax())].name
        raise SceneError(
            f"The scene is only {size:.3g} units large, and object '{largest}' is its largest; at least "
            f"{SMALLEST:.0e} units can be baked. Scale the scene up."
        )


def check_world(world: np.ndarray) -> None:
    """Raise SceneError if the world is neither a color nor an RGB image, or holds invalid radiance."""
    if world.shape != (3,) and (world.ndim != 3 or world.shape[2] != 3):
        raise SceneError(
            f"The world's radiance has the shape {world.shape}. "
            "Give it one colour, or an image of three channels."
        )
    if not world.size:
        raise SceneError("The world's image has no pixels. Choose another image.")
    if not _is_light(world):
        raise SceneError(f"The world's radiance is {_NO_LIGHT}. Correct its color and strength.")


def check_meshes(meshes: Sequence[Mesh]) -> None:
    """Raise SceneError if a mesh has invalid coordinates, normals, face order or lightmap UVs."""
    for group in mesh_groups(meshes):
        if any(is_faulty(group) for is_faulty, _ in _FAULTS):
            for mesh in group:
                for is_faulty, message in _FAULTS:
                    if is_faulty([mesh]):
                        raise SceneError(message.format(mesh.name))


def check_references(scene: Scene) -> None:
    """Raise SceneError if a mesh refers to an atlas, material or UV map that does not exist."""
    for mesh in scene.meshes:
        if not (mesh.atlas == NO_LIGHTMAP or 0 <= mesh.atlas < len(scene.atlases)):
            raise SceneError(
                f"Object '{mesh.name}' refers to atlas {mesh.atlas}, but the scene has {len(scene.atlases)}. "
                "Use one of these."
            )
    for group in mesh_groups(scene.meshes):
        if not _has_materials(group, len(scene.materials)):
            for mesh in group:
                _check_materials(mesh, len(scene.materials))
    textures = {index: found for index, each in enumerate(scene.materials) if (found := _textures(each))}
    if textures:
        for mesh in scene.meshes:
            _check_uv_maps(mesh, scene.materials, textures)


def _has_materials(meshes: Sequence[Mesh], count: int) -> bool:
    """Return True if all triangles refer to one of `count` materials."""
    numbers = joined(meshes, "material")
    return bool(numbers.min(initial=0) >= 0 and numbers.max(initial=-1) < count)


def _check_materials(mesh: Mesh, count: int) -> None:
    """Raise SceneError if a mesh refers to a material beyond the `count` of the scene."""
    if not _has_materials([mesh], count):
        raise SceneError(
            f"Object '{mesh.name}' refers to materials {mesh.material.min()} to {mesh.material.max()}, but "
            f"the scene has {count}. Assign one of these to its faces."
        )


def _check_uv_maps(
    mesh: Mesh, materials: Sequence[Material], textures: Mapping[int, Sequence[Texture]]
) -> None:
    """Raise SceneError if a mesh lacks the UV map that a texture of its materials needs.

    textures:  textures by index of their material
    """
    for index in np.flatnonzero(np.bincount(mesh.material)):
        for texture in textures.get(int(index), ()):
            if texture.uv_map not in mesh.texture_uvs:
                raise SceneError(
                    f"Object '{mesh.name}' has no UV map '{texture.uv_map}', which texture '{texture.name}' "
                    f"of material '{materials[index].name}' uses. Add the UV map, or choose another one."
                )


def _has_infinite(name: str) -> Callable[[Sequence[Mesh]], bool]:
    """Return a function that finds NaN and infinite values in an array of meshes."""
    return lambda meshes: not np.isfinite(joined(meshes, name)).all()


def _is_unordered(meshes: Sequence[Mesh]) -> bool:
    """Return True if triangles of a mesh are not in the order of face, then subface."""
    face, subface = joined(meshes, "face"), joined(meshes, "subface")
    if not len(face):
        return False
    if face.min(initial=0) < 0 or subface.min(initial=0) < 0:
        return True
    is_inner = np.ones(len(face), bool)
    is_inner[np.cumsum([len(mesh.face) for mesh in meshes]) - 1] = False
    step, substep = np.diff(face), np.diff(subface)
    return bool((((step < 0) | ((step == 0) & (substep <= 0))) & is_inner[:-1]).any())


def _mapped(meshes: Sequence[Mesh]) -> list[Mesh]:
    """Return the meshes with a lightmap."""
    return [mesh for mesh in meshes if mesh.atlas != NO_LIGHTMAP]


def _has_infinite_uvs(meshes: Sequence[Mesh]) -> bool:
    """Return True if lightmap UVs are not finite."""
    mapped = _mapped(meshes)
    return bool(mapped) and not np.isfinite(joined(mapped, "uvs")).all()


def _is_outside(meshes: Sequence[Mesh]) -> bool:
    """Return True if lightmap UVs lie outside the lightmap."""
    mapped = _mapped(meshes)
    if not mapped:
        return False
    uvs = joined(mapped, "uvs")
    return bool(uvs.min(initial=0) < -UV_TOLERANCE or uvs.max(initial=1) > 1 + UV_TOLERANCE)


#: Faults of meshes: a function that returns True if one of several meshes has it, and its message
#: with the name of the object.
_FAULTS: tuple[tuple[Callable[[Sequence[Mesh]], bool], str], ...] = (
    (
        _has_infinite("positions"),
        "Object '{}' has NaN or infinite vertex coordinates. "
        "Delete those vertices, or check the modifiers and the object's scale.",
    ),
    (
        _has_infinite("normals"),
        "Object '{}' has NaN or infinite normals. Clear its custom normals, or check the object's scale.",
    ),
    (
        _is_unordered,
        "The triangles of object '{}' are not in the order of its polygons. "
        "Sort them by face, then by subface.",
    ),
    (_has_infinite_uvs, "Object '{}' has NaN or infinite lightmap UVs. Unwrap its lightmap UVs again."),
    (
        _is_outside,
        "Object '{}' has lightmap UVs outside 0-1. "
        "Pack its UV islands into the unit square, or delete the lightmap UV layer for a new one.",
    ),
)


def check_material(material: Material) -> None:
    """Raise SceneError if a material has invalid values or an empty texture."""
    for texture in _textures(material):
        if not texture.pixels.size:
            raise SceneError(
                f"Texture '{texture.name}' of material '{material.name}' has no pixels. Choose another image."
            )
    reflects = _values(material.reflectance, material.reflectance_map)
    if not all(_is_light(values, 1) for values in reflects):
        _check_tinted_reflectance(material)
    emitted = _values(material.emission, material.emission_map)
    if material.back is not None:
        emitted += _values(material.back.emission, material.back.emission_map)
    if not all(_is_light(values) for values in emitted):
        raise SceneError(
            f"Material '{material.name}' has an emission that is {_NO_LIGHT}. "
            "Correct its emission color and strength."
        )
    for entry in distinct_transmittances(material):
        if not _is_fraction(entry):
            raise SceneError(
                f"Material '{material.name}' has a transmittance that is not between 0 and 1. "
                "Correct its alpha, or the color of its Transparent BSDF."
            )


def check_light(light: Light) -> None:
    """Raise SceneError if a light has an unknown kind or invalid values."""
    if light.kind not in LIGHT_KINDS:
        raise SceneError(
            f"Light '{light.name}' is of kind '{light.kind}'. Choose one of {', '.join(LIGHT_KINDS)}."
        )
    if not _is_light(light.strength, MAX_STRENGTH):
        raise SceneError(
            f"Light '{light.name}' has a power for its area that is {_NO_STRENGTH}. Change its power or size."
        )
    numbers = (
        light.position,
        light.axes,
        light.size,
        light.radius,
        light.half_angle,
        light.blend,
        light.stretch,
        light.falloff_power,
        light.falloff_smooth,
    )
    if not all(np.isfinite(values).all() for values in numbers):
        raise SceneError(f"Light '{light.name}' has a position or size that is NaN or infinite. Correct it.")
    if np.abs(light.position).max() > FARTHEST_LIGHT or max(light.radius, *light.size) > LARGEST:
        raise SceneError(
            f"Light '{light.name}' is farther than {FARTHEST_LIGHT:.0e} units or larger than {LARGEST:.0e} "
            "units. Move it closer, or make it smaller."
        )
    lengths = np.linalg.norm(light.axes, axis=1)[_AXES_NEEDED.get(light.kind, slice(0))]
    if (np.abs(lengths - 1) > _UNIT_TOLERANCE).any() or (np.asarray(light.stretch) <= 0).any():
        raise SceneError(
            f"Light '{light.name}' has axes that are not unit vectors, or a scale that is not positive. "
            "Give it a scale above 0."
        )
    if light.profile is not None:
        check_profile(light.profile, light.name)
        brightest = light.strength * light.profile.factors.max(axis=(0, 1)).astype(np.float64)
        if not _is_light(brightest, MAX_STRENGTH):
            raise SceneError(f"Light '{light.name}' has a profile and a power that are too large. Lower one.")


def _check_tinted_reflectance(material: Material) -> None:
    """Raise SceneError if a material reflects and transmits more light than it receives.

    The opaque part of a tinted surface is 1 - the largest channel of its transmittance. In the other channels
    it may reflect more than 1. If textures vary the transmittance, only the maximum reflectance is tested.
    """
    transmission, reflectance = material.transmission, np.asarray(material.reflectance, np.float64)
    pixels = material.reflectance_map.pixels if material.reflectance_map is not None else np.ones(1)
    largest = reflectance * pixels.max(axis=tuple(range(pixels.ndim - 1)))
    limit = np.ones(3)
    if is_tinted_material(material):
        passed = np.asarray(transmission.bounce.offset, np.float64)
        mapped = transmission.bounce.texture is not None or material.reflectance_map is not None
        limit = np.full(3, _LARGEST_REFLECTANCE)
        if not mapped and passed.max() < 1:
            limit = np.minimum(limit, (1 - passed) / (1 - passed.max()))
    if not (_is_light(reflectance) and _is_light(pixels) and (largest <= limit + _ROUNDING * limit).all()):
        raise SceneError(
            f"Material '{material.name}' has a reflectance that is not between 0 and 1, or reflects and "
            "passes more light than it receives. Correct its base color, or darken the color of its "
            "Transparent BSDF."
        )


def _is_fraction(entry: Transmittance) -> bool:
    """Return True if a transmittance is within [0, 1] for all values of its texture."""
    ends = np.asarray(entry.offset), np.asarray(entry.offset) + np.asarray(entry.scale)
    within = all(-_ROUNDING <= value <= 1 + _ROUNDING for end in ends for value in end.tolist())
    return within and (entry.texture is None or _is_light(entry.texture.pixels, 1))


def _textures(material: Material) -> list[Texture]:
    """Return the textures of a material."""
    maps = [material.reflectance_map, material.emission_map, *transmission_maps(material)]
    if material.back is not None:
        maps += [material.back.reflectance_map, material.back.emission_map]
    return [texture for texture in maps if texture is not None]


def _values(constant: np.ndarray, texture: Texture | None) -> list[np.ndarray]:
    """Return the constant and, if there is one, the texture's pixels of a quantity."""
    return [constant] if texture is None else [constant, texture.pixels]


def _is_light(values: np.ndarray, most: float = MAX_RADIANCE) -> bool:
    """Return True if all values are within [0, most]; NaN is invalid."""
    flat, limit = np.ravel(values), np.float32(most)
    if len(flat) <= _FEW:
        return all(0 <= value <= float(limit) for value in flat.tolist())
    within: list[bool] = []

    def test(part: slice) -> None:
        within.append(bool(flat[part].min() >= 0 and flat[part].max() <= limit))

    map_blocks(len(flat), flat.itemsize, test)
    return all(within)


def check_probe_volumes(volumes: Sequence[ProbeVolume]) -> None:
    """Raise SceneError with the volume's name if its probes cannot be baked."""
    for volume in volumes:
        issue = volume_issue(volume)
        if issue is not None:
            raise SceneError(f"Light Probe Volume '{volume.name}': {issue}")
    count = sum(volume.count for volume in volumes)
    if count > MAX_PROBES:
        raise SceneError(
            f"Light Probe Volumes: {count:,} probes exceed {MAX_PROBES:,} in total. Lower their resolutions."
        )


def check_reflection_spheres(spheres: Sequence[ReflectionSphere]) -> None:
    """Raise SceneError with the sphere's name if its cube map cannot be baked."""
    for sphere in spheres:
        issue = sphere_issue(sphere)
        if issue is not None:
            raise SceneError(f"Light Probe Sphere '{sphere.name}': {issue}")
