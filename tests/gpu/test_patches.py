import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Mesh, Scene, SceneError
from engine.patches.coverage import check_overlap, touched_triangles
from engine.patches.geometry import patch_geometry
from engine.patches.patch_list import list_patches
from engine.patches.texel_to_patch import add_thin_patches
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import furnace, nine_quad_room, quads, rectangle

GREY = Material("grey", np.full(3, 0.5, np.float32), np.zeros(3, np.float32))


def one_quad(chart, resolution=16, name="Quad"):
    corners = rectangle((1, 2, 3), (4, 0, 0), (0, 2, 0))[None]
    return quads(corners, [chart], [0], resolution, name)


def grown(graphics, scene, resolution):
    triangles = join_meshes(scene)
    covered = list_patches(graphics, scene, resolution)
    touched = touched_triangles(graphics, triangles, len(scene.atlases), resolution)
    return covered, *add_thin_patches(scene, triangles, covered, touched)


def test_texels_of_a_quad_become_patches(graphics):
    scene = Scene((one_quad((4, 6, 8, 4)),), (GREY,))
    patches = list_patches(graphics, scene, 16)
    rows, columns = np.divmod(patches.texel, 16)
    assert len(patches) == 32
    assert set(zip(rows, columns, strict=True)) == {(y, x) for y in range(6, 10) for x in range(4, 12)}
    assert set(patches.subface) == {0, 1} and set(patches.face) == {0} and set(patches.mesh) == {0}
    np.testing.assert_allclose(patches.barycentric.sum(axis=1), 1, atol=1e-5)


def test_centres_normals_and_areas_follow_from_the_barycentrics(graphics):
    scene = Scene((one_quad((4, 6, 8, 4)),), (GREY,))
    patches = list_patches(graphics, scene, 16)
    geometry = patch_geometry(scene, join_meshes(scene), patches)
    rows, columns = np.divmod(patches.texel, 16)
    expected = np.stack([1 + (columns - 4 + 0.5) / 2, 2 + (rows - 6 + 0.5) / 2, np.full(32, 3)], axis=1)
    np.testing.assert_allclose(geometry.center + geometry.triangles.origin, expected, atol=1e-4)
    np.testing.assert_allclose(geometry.normal, np.tile([0, 0, 1], (32, 1)), atol=1e-6)
    np.testing.assert_allclose(geometry.geometric, np.tile([0, 0, 1], (32, 1)), atol=1e-6)
    np.testing.assert_allclose(geometry.area, 0.25, rtol=1e-5)
    np.testing.assert_allclose(geometry.edge_u, np.tile([0.5, 0, 0], (32, 1)), atol=1e-5)


def test_faces_subfaces_meshes_and_atlases_are_told_apart(graphics):
    room = nine_quad_room().meshes[0]
    second = replace(one_quad((2, 2, 8, 4), 128, "Other"), atlas=1)
    scene = Scene((room, second), nine_quad_room().materials, ("First", "Second"))
    patches = list_patches(graphics, scene, 128)
    assert set(patches.face[patches.mesh == 0]) == set(range(9))
    assert (patches.atlas == patches.mesh).all() and (patches.mesh == 1).sum() == 32
    geometry = patch_geometry(scene, join_meshes(scene), patches)
    assert (geometry.triangle[patches.mesh == 1] >= 18).all()


def test_a_dropped_triangle_leaves_the_others_in_place(graphics):
    """A polygon whose first triangle was dropped still finds its second."""
    mesh = one_quad((4, 6, 8, 4))
    names = ("positions", "normals", "uvs", "face", "subface", "material")
    kept = {name: getattr(mesh, name)[1:] for name in names}
    scene = Scene((Mesh("Half", **kept),), (GREY,))
    patches = list_patches(graphics, scene, 16)
    assert set(patches.subface) == {1}
    assert (patch_geometry(scene, join_meshes(scene), patches).triangle == 0).all()


def test_places_on_slivers_lie_on_their_triangles(graphics):
    """Rasterisation finds barycentrics of thousands, or NaN, for triangles thinner than its own grid."""
    rng, count = np.random.default_rng(0), 20000
    start, angle = rng.random((count, 2)), rng.random(count) * 2 * np.pi
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.random((count, 1)) * 0.3
    across = along[:, ::-1] * (-1, 1) * 10 ** rng.uniform(-9, -2, (count, 1))
    corners = [start, start + along, start + along * rng.random((count, 1)) + across]
    square = quads(
        np.tile(rectangle((1e3, 0, 0), (1, 0, 0), (0, 1, 0)), (count, 1, 1)),
        [(0, 0, 1, 1)] * count,
        [0] * count,
        1,
    )
    slivers = square.part(square.subface == 0)
    slivers = replace(slivers, uvs=np.stack(corners, axis=1).clip(0, 1).astype(np.float32))
    scene = Scene((slivers,), (GREY,))
    patches = list_patches(graphics, scene, 331)
    assert patches.barycentric.min() >= 0 and len(patches) > 10000
    np.testing.assert_allclose(patches.barycentric.sum(axis=1), 1, rtol=1.1e-6)
    geometry = patch_geometry(scene, join_meshes(scene), patches)
    center = geometry.center + geometry.triangles.origin
    assert (np.abs(center - (1000.5, 0.5, 0)).max(axis=1) <= 0.501).all()


def test_one_atlas_is_held_at_a_time(graphics):
    """Both targets take 32 bytes a texel; what all atlases hold is the patches, few here."""
    resolution, atlases = 512, 7
    meshes = [replace(one_quad((3, 5, 7, 11), resolution), atlas=atlas) for atlas in range(atlases)]
    scene = Scene(tuple(meshes), (GREY,), tuple(map(str, range(atlases))))
    tracemalloc.start()
    try:
        patches = list_patches(graphics, scene, resolution)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(patches) == atlases * 77 and most < 2 * 32 * resolution**2


def test_nothing_covered_is_an_error(graphics):
    tiny = one_quad((0, 0, 1, 1), 4096)
    with pytest.raises(SceneError, match="No texel.*'Quad'.*[Uu]nwrap"):
        list_patches(graphics, Scene((tiny,), (GREY,)), 16)


def test_overlap_names_both_objects(graphics):
    scene = Scene((one_quad((2, 2, 8, 8), name="Table"), one_quad((6, 6, 8, 8), name="Chair")), (GREY,))
    triangles = join_meshes(scene)
    with pytest.raises(SceneError, match="overlap in atlas 'Lightmap'.*'Table', 'Chair'.*[Pp]ack"):
        check_overlap(graphics, scene, triangles, list_patches(graphics, scene, 16))


def test_shared_borders_are_no_overlap(graphics):
    scene = Scene((one_quad((2, 2, 5, 8)), one_quad((7, 2, 5, 8))), (GREY,))
    triangles = join_meshes(scene)
    assert check_overlap(graphics, scene, triangles, list_patches(graphics, scene, 16)) == []


def test_every_texel_a_surface_touches_belongs_to_a_patch_of_that_surface(graphics):
    """A quad whose borders lie within texels: its border texels belong to its own patches."""
    mesh = one_quad((4, 6, 8, 4))
    uvs = mesh.uvs * 0.83 + 0.041
    scene = Scene((replace(mesh, uvs=uvs),), (GREY,))
    covered, patches, _, texel_to_patch = grown(graphics, scene, 16)
    assert len(patches) == len(covered)
    low, high = uvs.reshape(-1, 2).min(axis=0) * 16, uvs.reshape(-1, 2).max(axis=0) * 16
    for y in range(int(low[1]), int(np.ceil(high[1]))):
        for x in range(int(low[0]), int(np.ceil(high[0]))):
            assert texel_to_patch[0, y, x] > 0
    assert (texel_to_patch > 0).sum() > len(covered)


def test_a_sliver_without_a_covered_centre_gets_a_patch_of_its_own(graphics):
    mesh = one_quad((4, 6, 8, 4))
    thin = mesh.uvs * np.float32([1, 0.01]) + np.float32([0, 0.9])
    sliver = replace(mesh, name="Sliver", positions=mesh.positions + 50, uvs=thin)
    scene = Scene((mesh, sliver), (GREY,))
    covered, patches, geometry, texel_to_patch = grown(graphics, scene, 16)
    added = patches.mesh == 1
    assert (covered.mesh == 0).all() and added.sum() == 8
    assert (geometry.center[added] + geometry.triangles.origin > 45).all()
    assert (texel_to_patch[0].ravel()[patches.texel] == np.arange(1, len(patches) + 1)).all()


def test_patch_order_and_ids_do_not_depend_on_charts_touching_the_border(graphics):
    covered, patches, _, texel_to_patch = grown(graphics, furnace(0.5, 1.0), 32)
    assert len(patches) == len(covered) == 6 * 64
    assert (np.diff(patches.texel) > 0).all()
    assert (texel_to_patch[0].ravel()[patches.texel] == np.arange(1, len(patches) + 1)).all()
