from dataclasses import replace

import numpy as np
import pytest

from engine.patches.unmapped_meshes import clusters, place_unmapped
from engine.scene.model import NO_LIGHTMAP, Material, Mesh, Scene
from engine.scene.triangles import join_meshes

GREY = Material("Grey", np.full(3, 0.5, np.float32), np.zeros(3, np.float32))


def mesh(positions, atlas, uvs=None):
    count = len(positions)
    return Mesh(
        name="Mesh",
        positions=np.asarray(positions, np.float32),
        normals=np.tile(np.float32([0, 0, 1]), (count, 3, 1)),
        uvs=np.zeros((count, 3, 2), np.float32) if uvs is None else np.asarray(uvs, np.float32),
        face=np.arange(count, dtype=np.int32),
        subface=np.zeros(count, np.int32),
        material=np.zeros(count, np.int32),
        atlas=atlas,
    )


BAKED = mesh([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]], 0, [[(0, 0), (1, 0), (0, 1)]])


def triangles(sizes, seed=0):
    """Return right triangles of the given sizes, apart from each other, (t, 3, 3)."""
    corner = np.random.default_rng(seed).random((len(sizes), 1, 3)) * 20
    return corner + np.asarray(sizes)[:, None, None] * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])


def texels(uvs, resolution):
    """Return the texels whose centres each triangle covers, one set each."""
    centers = (np.arange(resolution) + 0.5) / resolution
    x, y = (grid.ravel() for grid in np.meshgrid(centers, centers))
    found = []
    for a, b, c in uvs.astype(np.float64):
        sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        inside = np.all([side >= 0 for side in sides], axis=0) & (np.linalg.det([b - a, c - a]) != 0)
        found.append(set(np.flatnonzero(inside).tolist()))
    return found


def test_without_occluders_the_scene_stays():
    scene = Scene((BAKED,), (GREY,))
    assert place_unmapped(scene, 61) is scene


def test_triangles_get_texels_in_proportion_to_their_size_and_no_other_has_them():
    """Two occluders with a baked mesh and an empty one between them."""
    first, second = (mesh(triangles(sizes), NO_LIGHTMAP) for sizes in ([0.01, 0.3], [1.0, 2.5, 0.7]))
    scene = Scene((first, BAKED, mesh(np.zeros((0, 3, 3)), NO_LIGHTMAP), second), (GREY,))
    placed = place_unmapped(scene, 61)
    assert placed.atlases == ("Lightmap", "(occluders)")
    assert [each.atlas for each in placed.meshes] == [1, 0, 0, 1]
    covered = texels(np.concatenate([placed.meshes[0].uvs, placed.meshes[3].uvs]), 61)
    count = [len(part) for part in covered]
    assert count[0] == 1 and count[0] <= count[1] <= count[4] <= count[2] <= count[3] and count[3] > 100
    assert sum(map(len, covered)) == len(set().union(*covered))


@pytest.mark.parametrize(("count", "resolution"), [(701, 61), (1103, 23), (97, 11), (11, 8)])
def test_more_clusters_than_texels_get_more_atlases(count, resolution):
    """Tetrahedra: four clusters each, that never merge."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])[
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    ]
    offsets = np.random.default_rng(2).random((count, 1, 1, 3)) * 20
    scene = Scene((BAKED, *(mesh(corners + one, NO_LIGHTMAP) for one in offsets)), (GREY,))
    placed = place_unmapped(scene, resolution)
    assert len(set(placed.atlases)) == 2
    parts = placed.meshes[1:]
    assert {part.atlas for part in parts} == set(range(1, len(placed.atlases)))
    assert sum(len(part.positions) for part in parts) == 4 * count
    for atlas in range(1, min(len(placed.atlases), 4)):
        covered = texels(np.concatenate([part.uvs for part in parts if part.atlas == atlas]), resolution)
        assert all(covered) and sum(map(len, covered)) == len(set().union(*covered))


def test_an_occluder_in_several_atlases_keeps_its_faces_and_textures():
    count = 40
    one = mesh(triangles(np.full(count, 0.01)), NO_LIGHTMAP)
    one = replace(
        one,
        face=np.arange(count, dtype=np.int32) // 3,
        subface=np.arange(count, dtype=np.int32) % 3,
        material=np.arange(count, dtype=np.int32),
        texture_uvs={"Map": np.arange(6 * count, dtype=np.float32).reshape(count, 3, 2)},
    )
    placed = place_unmapped(Scene((BAKED, one), (GREY,) * count), 4)
    parts = sorted(placed.meshes[1:], key=lambda part: part.atlas)
    assert len(parts) == len(placed.atlases) - 1 == 3
    for part in parts:
        index = part.material
        assert part.name == "Mesh" and (np.diff(index) > 0).all()
        for name in ("positions", "normals", "face", "subface"):
            assert (getattr(part, name) == getattr(one, name)[index]).all()
        assert (part.texture_uvs["Map"] == one.texture_uvs["Map"][index]).all()
    assert (np.sort(np.concatenate([part.material for part in parts])) == np.arange(count)).all()


def test_small_triangles_that_are_close_have_one_texel():
    near = np.array([(0, 0, 0), (1e-3, 0, 0), (0, 1e-3, 0)]) + np.arange(5)[:, None, None] * 1e-3
    placed = place_unmapped(Scene((BAKED, mesh(near + 0.001, NO_LIGHTMAP)), (GREY,)), 67)
    uvs = placed.meshes[1].uvs
    assert len({tuple(np.floor(uv.mean(axis=0) * 67)) for uv in uvs}) == 1
    assert sum(len(part) for part in texels(uvs, 67)) == 1


@pytest.mark.parametrize("resolution", [8, 23, 67])
def test_places_always_fit(resolution):
    sizes = np.random.default_rng(1).random(3000) ** 3 * 3
    placed = place_unmapped(Scene((BAKED, mesh(triangles(sizes), NO_LIGHTMAP)), (GREY,)), resolution)
    uvs = placed.meshes[1].uvs
    assert uvs.min() >= 0 and uvs.max() <= 1
    covered = texels(uvs[:200], resolution)
    assert sum(map(len, covered)) == len(set().union(*covered))


def test_triangles_represent_their_cluster_as_often_as_they_are_large():
    """Of three triangles in each of 500 clusters, the last has half of the area, and every second texel."""
    count = 500
    corner = np.zeros((3 * count, 1, 3))
    corner[:, 0, 0] = np.repeat(np.arange(count) * 3.0, 3)
    legs = np.tile([0.002, 0.002, 0.002 * np.sqrt(2)], count)
    small = mesh(corner + legs[:, None, None] * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), NO_LIGHTMAP)
    placed = place_unmapped(Scene((BAKED, small), (GREY,)), 61).meshes[1]
    chosen = np.ptp(placed.uvs, axis=1).max(axis=1).reshape(count, 3) > 0
    whole = chosen[chosen.sum(axis=1) == 1]
    assert len(whole) > count / 2
    assert whole.mean(axis=0) == pytest.approx([0.25, 0.25, 0.5], abs=0.07)


@pytest.mark.parametrize("size", [1.7, 1e-7])
def test_clusters_join_triangles_of_one_mesh_direction_and_cell(size):
    """Cells too many for one integer are sorted by columns. Only chosen triangles count."""
    corners = triangles(np.full(401, 1e-3))
    corners[200:400] = corners[:200]
    corners[300:400, :, 2] *= -1
    meshes = [mesh(corners[part], 0) for part in (slice(0, 101), slice(101, 401))]
    joined = join_meshes(Scene(tuple(meshes), (GREY,)))
    chosen = np.flatnonzero(np.arange(401) != 7)
    found = clusters(joined, chosen, size)
    centers = joined.positions[chosen].mean(axis=1)
    cells = np.floor((centers - centers.min(axis=0)) / size).astype(np.int64)
    expected = np.unique(np.column_stack([joined.mesh[chosen], cells]), axis=0, return_inverse=True)[
        1
    ].ravel()
    same, right = (numbers[:, None] == numbers for numbers in (found, expected))
    assert np.array_equal(same, right) and found.max() == expected.max() < 400
