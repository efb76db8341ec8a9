"""Changes that count as new geometry, as new surfaces, or as neither."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from engine import Light, Material, Mesh, Scene, Texture
from engine.scene import digests
from engine.scene.digests import ArrayDigests, digest_of, geometry_digest, surfaces_digest
from engine.scene.model import NO_LIGHTMAP
from engine.scene.transmission import CLEAR, Transmission, Transmittance
from tests.transparency import CLEAR_BACK, transparent, uniform_transmission


def texture(seed: int, channels: int, uv_map: str = "UVMap") -> Texture:
    """Return a texture of 3 x 5 pixels."""
    pixels = np.random.default_rng(seed).random((3, 5, channels), np.float32)
    return Texture(f"Image {seed}", pixels, uv_map)


def mesh(name: str, seed: int) -> Mesh:
    """Return seven random triangles with two more UV maps."""
    random = np.random.default_rng(seed)
    triangles = np.arange(7, dtype=np.int32)
    normals = np.tile(np.float32([0, 0, 1]), (7, 3, 1))
    uvs = {map_: random.random((7, 3, 2), np.float32) for map_ in ("UVMap", "Holes")}
    positions, charts = random.random((7, 3, 3), np.float32), random.random((7, 3, 2), np.float32)
    return Mesh(name, positions, normals, charts, triangles, 0 * triangles, triangles % 2, texture_uvs=uvs)


GREY = np.full(3, 0.5, np.float32)
PLAIN = Material("Plain", GREY, 0 * GREY, reflectance_map=texture(1, 3))
HOLES = texture(2, 1, "Holes")
LEAVES = Material("Leaves", GREY, 0 * GREY, transmission=transparent(1.0, HOLES))
LAMP = Light("Lamp", "point", np.zeros(3), np.eye(3), GREY)
SCENE = Scene((mesh("A", 3), mesh("B", 4)), (PLAIN, LEAVES), lights=(LAMP,))


def with_mesh(**changes) -> Scene:
    """Return the scene with another second mesh."""
    return replace(SCENE, meshes=(SCENE.meshes[0], replace(SCENE.meshes[1], **changes)))


def with_material(index: int, **changes) -> Scene:
    """Return the scene with another material."""
    materials = list(SCENE.materials)
    materials[index] = replace(materials[index], **changes)
    return replace(SCENE, materials=tuple(materials))


def nudged(name: str) -> np.ndarray:
    """Return an array of the second mesh with one number changed in its last place."""
    array = getattr(SCENE.meshes[1], name).copy()
    array[-1, -1, -1] = np.nextafter(array[-1, -1, -1], np.float32(2))
    return array


def with_uvs(map_: str) -> Scene:
    """Return the scene with another UV map of the second mesh."""
    uvs = SCENE.meshes[1].texture_uvs
    return with_mesh(texture_uvs={**uvs, map_: uvs[map_] + np.float32(0.25)})


GEOMETRY = {
    "vertex": with_mesh(positions=nudged("positions")),
    "normal": with_mesh(normals=nudged("normals")),
    "lightmap UV": with_mesh(uvs=nudged("uvs")),
    "face": with_mesh(face=SCENE.meshes[1].face + 1),
    "slot": with_mesh(material=1 - SCENE.meshes[1].material),
    "atlas": replace(with_mesh(atlas=1), atlases=("One", "Two")),
    "occluder": with_mesh(atlas=NO_LIGHTMAP),
    "name": with_mesh(name="C"),
    "deleted": replace(SCENE, meshes=SCENE.meshes[:1]),
    "order": replace(SCENE, meshes=SCENE.meshes[::-1]),
    "alpha": with_material(0, transmission=transparent(0.5)),
    "threshold": with_material(1, transmission=transparent(1.0, HOLES, 0.5)),
    "clear back": with_material(0, transmission=CLEAR_BACK),
    "clear to shadow rays": with_material(0, transmission=Transmission(shadow=CLEAR)),
    "clear to other rays": with_material(0, transmission=Transmission(bounce=CLEAR)),
    "tint": with_material(0, transmission=uniform_transmission(Transmittance(np.float32([0.1, 0.0, 0.0])))),
    "hole": with_material(1, transmission=transparent(1.0, texture(5, 1, "Holes"))),
    "new hole": with_material(0, transmission=transparent(1.0, texture(2, 1))),
    "extension": with_material(1, transmission=transparent(1.0, replace(HOLES, extension="clip"))),
    "interpolation": with_material(1, transmission=transparent(1.0, replace(HOLES, smooth=False))),
    "mapping": with_material(1, transmission=transparent(1.0, replace(HOLES, transform=np.eye(2, 3) * 2))),
    "UVs of holes": with_uvs("Holes"),
}
SURFACES = {
    "reflectance": with_material(1, reflectance=2 * GREY),
    "emission": with_material(1, emission=GREY),
    "image": with_material(0, reflectance_map=texture(6, 3)),
    "colour space": with_material(0, reflectance_map=replace(PLAIN.reflectance_map, srgb=True)),
    "emission image": with_material(1, emission_map=texture(1, 3)),
    "UVs of images": with_uvs("UVMap"),
}
LIGHT = {
    "lamp": replace(SCENE, lights=(replace(LAMP, position=np.ones(3)),)),
    "no lamp": replace(SCENE, lights=()),
    "world": replace(SCENE, world=GREY),
    "origin": replace(SCENE, origin=np.ones(3)),
    "name of a material": with_material(0, name="Painted"),
    "name of a lightmap": replace(SCENE, atlases=("Kitchen",)),
}


@pytest.mark.parametrize("edit", GEOMETRY)
def test_what_patches_are_and_see_is_other_geometry(edit):
    assert geometry_digest(GEOMETRY[edit]) != geometry_digest(SCENE)


@pytest.mark.parametrize("edit", SURFACES)
def test_what_patches_reflect_and_emit_is_other_surfaces_alone(edit):
    assert geometry_digest(SURFACES[edit]) == geometry_digest(SCENE)
    assert surfaces_digest(SURFACES[edit]) != surfaces_digest(SCENE)


@pytest.mark.parametrize("edit", LIGHT)
def test_light_is_neither(edit):
    assert geometry_digest(LIGHT[edit]) == geometry_digest(SCENE)
    assert surfaces_digest(LIGHT[edit]) == surfaces_digest(SCENE)


def test_arrays_count_by_what_they_hold():
    """Addresses do not count: workers create new arrays in each bake, scripts may change theirs in place."""
    copied = with_mesh(**{name: getattr(SCENE.meshes[1], name).copy() for name in ("positions", "uvs")})
    assert geometry_digest(copied) == geometry_digest(SCENE)
    before = geometry_digest(copied)
    copied.meshes[1].positions[3, 1, 2] += 1
    assert geometry_digest(copied) != before


def test_a_map_that_moves_to_another_material_is_a_change():
    """Digests are of a sequence: the same images in other places are not the same."""
    swapped = replace(
        SCENE,
        materials=(
            replace(PLAIN, reflectance_map=None),
            replace(LEAVES, reflectance_map=PLAIN.reflectance_map),
        ),
    )
    assert surfaces_digest(swapped) != surfaces_digest(SCENE)


def test_every_part_of_a_long_array_counts_and_where_it_is():
    long = np.random.default_rng(3).random((3, 200_003))
    changed = [long.copy() for _ in range(4)]
    changed[0][0, 0] += 1
    changed[1][1, 131_072] += 1
    changed[2][2, -1] += 1
    changed[3].ravel()[: 1 << 18] = np.roll(long.ravel()[: 1 << 18], 1 << 17)
    digests = {digest_of([array]) for array in (long, *changed, long.reshape(-1, 3), long[:, :-1])}
    assert len(digests) == 7
    assert digest_of([long]) == digest_of([np.asfortranarray(long)])


def test_long_arrays_are_read_once_and_forgotten_with_their_scene(monkeypatch):
    """Their digests are those of whoever knows none; arrays of a piece or less are read each time."""
    monkeypatch.setattr(digests, "_PIECE", 60)
    read, tree = [], digests._tree_digest
    monkeypatch.setattr(digests, "_tree_digest", lambda array: read.append(id(array)) or tree(array))
    scene, known = with_mesh(name="C", positions=nudged("positions")), ArrayDigests()
    made = geometry_digest(scene, known), surfaces_digest(scene, known)
    first = len(read)
    assert first == len(set(read)) > 3
    assert (geometry_digest(scene, known), surfaces_digest(scene, known)) == made and len(read) == first
    assert geometry_digest(SCENE, known) != made[0] and len(read) == first + 1
    assert (geometry_digest(scene), surfaces_digest(scene)) == made
    del scene
    gc.collect()
    assert len(known._known) == first


def test_only_hashed_arrays_are_begun_and_none_outlives_its_bake(monkeypatch):
    monkeypatch.setattr(digests, "_PIECE", 60)
    begun, known, hashes = [], ArrayDigests(), digests._hashes
    monkeypatch.setattr(digests, "_hashes", lambda array: begun.append(id(array)) or hashes(array))
    front = SCENE.meshes[0]
    back = replace(front, positions=front.positions.copy(), front=np.arange(7, dtype=np.int32))
    scene = replace(SCENE, meshes=(front, replace(front, name="Shared"), back))
    known.begin(with_mesh(positions=nudged("positions")))
    begun.clear()
    known.begin(scene)
    assert id(back.positions) not in begun and len(begun) == len(set(begun)) == len(known._begun) == 3
    assert geometry_digest(scene, known) == geometry_digest(scene)
    assert not known._begun
