"""Detection of triangles of open surfaces, and the back faces that they get."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from engine import Scene
from engine.patches.backs import with_places
from engine.scene import open_surfaces
from engine.scene.model import NO_LIGHTMAP, BackSide
from engine.scene.open_surfaces import OpenSurfaces, open_triangles
from engine.scene.transmission import CLEAR, OPAQUE, Transmission, from_opacity
from engine.scene.triangles import join_meshes
from tests.analytic.rooms import Atlas, block, room
from tests.analytic.scenes import material, quads, rectangle

X, Y, Z = np.eye(3)
RESOLUTION = 127


def box(low=(0.4, 0.2, 0.3), high=(0.7, 0.6, 0.9)):
    return block(Atlas(RESOLUTION), low, high, "Box")


CUBE = box((0, 0, 0), (1, 1, 1))


def sheet(corner=(3, 1, 2), name="Sheet", atlas=0):
    mesh = quads(rectangle(corner, X, Y)[None], [(90, 90, 20, 20)], [0], RESOLUTION, name)
    return replace(mesh, atlas=atlas)


def open_by_dictionaries(meshes):
    """Return the open triangles by a dictionary of edges and a search, for vertices far apart."""
    corners = [tuple(map(tuple, triangle)) for mesh in meshes for triangle in mesh.positions.tolist()]
    edges = defaultdict(list)
    for number, triangle in enumerate(corners):
        for ends in zip(triangle, triangle[1:] + triangle[:1], strict=True):
            edges[frozenset(ends)].append(number)
    left = [number for users in edges.values() if len(users) % 2 for number in users]
    found = set(left)
    while left:
        number = left.pop()
        triangle = corners[number]
        for ends in zip(triangle, triangle[1:] + triangle[:1], strict=True):
            new = set(edges[frozenset(ends)]) - found
            found |= new
            left += new
    return [number in found for number in range(len(corners))]


@pytest.mark.parametrize("seed", range(5))
def test_parts_of_many_boxes_match_a_dictionary_of_edges(seed):
    rng = np.random.default_rng(seed)
    meshes = []
    for _ in range(29):
        corner, size = rng.integers(-30, 30, 3), rng.integers(1, 4, 3)
        whole = replace(CUBE, positions=(CUBE.positions * size + corner).astype(np.float32))
        kept = rng.random(12) < rng.choice([0.4, 0.9, 1.0, 1.0])
        meshes += [whole.subset(kept), *([whole.subset(~kept)] if rng.random() < 0.5 else [])]
    assert open_triangles(meshes).tolist() == open_by_dictionaries(meshes)


def test_meshes_that_stay_are_not_examined_again(monkeypatch):
    examined = []
    closed_meshes = open_surfaces.closed_meshes
    monkeypatch.setattr(
        open_surfaces, "closed_meshes", lambda each: examined.append(len(each)) or closed_meshes(each)
    )
    surfaces, meshes = OpenSurfaces(), [box(), sheet(), sheet((5, 5, 5)).subset(np.zeros(2, bool))]
    expected = [False] * 12 + [True] * 2
    assert surfaces.of(meshes).tolist() == expected
    assert surfaces.of([*meshes, box((7, 7, 7), (8, 8, 8))]).tolist() == expected + [False] * 12
    assert surfaces.of(meshes).tolist() == expected and surfaces.of([]).tolist() == []
    assert examined == [3, 1, 0, 0]


def test_closed_meshes_have_no_open_triangle():
    inwards = room(Atlas(RESOLUTION), (-1, -1, -1), (0, 0.5, 0.25), "Room")
    assert not open_triangles([inwards, box()]).any()


def test_all_triangles_of_an_open_surface_are_open_and_those_of_closed_ones_are_not():
    lidless = box((2, 0, 0), (2.5, 0.3, 0.3)).subset(np.arange(12) > 1)
    found = open_triangles([box(), lidless, box((5, 5, 5), (5.5, 5.7, 5.3)), sheet()])
    assert found.tolist() == [False] * 12 + [True] * 10 + [False] * 12 + [True] * 2


def test_parts_of_a_body_in_several_meshes_close_each_other_far_from_the_origin():
    """glTF splits bodies by material; world positions are off by rounding."""
    far = replace(box(), positions=box().positions + np.float32(1000.1))
    some = np.arange(12) < 5
    other = far.subset(~some)
    other = replace(other, positions=np.nextafter(other.positions, np.float32(np.inf)))
    assert not open_triangles([far.subset(some), other]).any()
    assert open_triangles([far.subset(some)]).all()


def test_triangles_without_an_area_do_not_open_a_mesh():
    flat = box()
    flat = replace(flat, positions=flat.positions[:1, [0, 1, 1]])
    assert not open_triangles([box(), flat])[:12].any()


def test_a_closed_scene_stays_as_it_is():
    scene = Scene((box(),), (material("Grey", 0.5),))
    assert with_places(scene, RESOLUTION) is scene
    assert join_meshes(scene).backs is None


def test_backs_are_the_fronts_turned_over_in_atlases_of_the_engine():
    scene = Scene((box(), sheet(), sheet((7, 7, 7), "Hidden", NO_LIGHTMAP)), (material("Grey", 0.5),))
    placed = with_places(scene, RESOLUTION)
    triangles = join_meshes(placed)
    assert triangles.solid == 16 and len(triangles.mesh) == 20
    assert triangles.backs[:12].tolist() == [-1] * 12
    fronts = np.arange(12, 16)
    backs = triangles.backs[fronts]
    assert (triangles.positions[backs] == triangles.positions[fronts][:, [0, 2, 1]]).all()
    assert (triangles.normals[backs] == -triangles.normals[fronts][:, [0, 2, 1]]).all()
    assert (triangles.atlas[backs] == 2).all() and placed.atlases[0] == scene.atlases[0]
    assert triangles.one_sided.tolist() == [False] * 12 + [True] * 8


def test_backs_of_translucent_surfaces_mirror_the_texels_of_their_fronts():
    cloth = replace(material("Cloth", 0.2), translucency=np.full(3, 0.5, np.float32))
    closed = replace(box(), material=np.ones(12, np.int32))
    placed = with_places(Scene((sheet(), closed), (material("Grey", 0.5), cloth)), RESOLUTION)
    triangles = join_meshes(placed)
    backs = triangles.backs[2:14]
    assert (triangles.uvs[backs] == triangles.uvs[2:14][:, [0, 2, 1]]).all()
    assert (triangles.atlas[backs] == 1).all() and (triangles.atlas[triangles.backs[:2]] == 2).all()


def test_a_back_has_its_own_material_where_it_differs_and_no_patches_where_it_is_clear():
    back = BackSide(np.zeros(3, np.float32), np.ones(3, np.float32))
    two = replace(material("Two", 0.5), back=back)
    placed = with_places(Scene((sheet(),), (two,)), RESOLUTION)
    of_back = placed.materials[placed.meshes[1].material[0]]
    assert (of_back.emission == 1).all() and (of_back.reflectance == 0).all()
    clear = Scene((sheet(),), (replace(two, transmission=Transmission(bounce_back=CLEAR)),))
    assert with_places(clear, RESOLUTION) is clear
    glass = replace(
        material("Glass", 0.5), transmission=Transmission(OPAQUE, OPAQUE, CLEAR, from_opacity(0.25))
    )
    turned = with_places(Scene((sheet(),), (glass,)), RESOLUTION).materials[1].transmission
    assert turned == Transmission(CLEAR, glass.transmission.bounce_back, OPAQUE, OPAQUE)


@pytest.mark.parametrize("is_strip", [True, False])
def test_components_are_connected_in_any_order_of_triangles(is_strip):
    rng, count = np.random.default_rng(3), 400
    component = np.sort(rng.integers(0, 9, count)) if is_strip else rng.integers(0, 9, count)
    members = np.argsort(component, kind="stable")
    pairs = np.stack([members[:-1], members[1:]])
    pairs = pairs[:, component[pairs[0]] == component[pairs[1]]]
    pairs = rng.permuted(pairs, axis=0)[:, rng.permutation(pairs.shape[1])]
    chosen = np.array([7, 123])
    found = open_surfaces._components_of(chosen, pairs, count)
    assert np.array_equal(found, np.isin(component, component[chosen]))
