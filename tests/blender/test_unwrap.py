"""Lightmap UVs made by xatlas are sound."""

import time

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE,
    covering,
    cross,
    loop_uvs,
    mesh_object,
    part,
    snapshot,
    square,
    unwrap_missing,
)

RESOLUTION = 127


@pytest.fixture(autouse=True)
def resolution():
    import bpy

    bpy.context.scene.hemibake.resolution = RESOLUTION


def coverage(obj, size: int) -> np.ndarray:
    """Return the number of triangles of the UV layer over each texel centre of a size x size grid."""
    obj.data.calc_loop_triangles()
    triangles = np.array([list(triangle.loops) for triangle in obj.data.loop_triangles])
    return covering(loop_uvs(obj)[triangles], size)


def area_ratio(obj) -> np.ndarray:
    """Return UV area / world area of each triangle."""
    obj.data.calc_loop_triangles()
    loops = np.array([list(triangle.loops) for triangle in obj.data.loop_triangles])
    vertices = np.array([list(triangle.vertices) for triangle in obj.data.loop_triangles])
    corners = np.array([obj.matrix_world @ vertex.co for vertex in obj.data.vertices])[vertices]
    uvs = loop_uvs(obj)[loops].astype(np.float64)
    world = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.abs(cross(uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0])) / world


def bumpy_grid(n=6):
    """Return a grid of quads, none of them flat."""
    height = np.random.default_rng(7).uniform(-0.6, 0.6, (n + 1) ** 2)
    vertices = [(i % (n + 1), i // (n + 1), height[i]) for i in range((n + 1) ** 2)]
    corner = [row * (n + 1) + column for row in range(n) for column in range(n)]
    return mesh_object("Bumpy", vertices, [(i, i + 1, i + n + 2, i + n + 1) for i in corner])


def comb():
    """Return a flat concave n-gon and a folded one."""
    flat = [(0, 0, 0), (6, 0, 0), (6, 3, 0), (5, 1, 0), (4, 3, 0), (3, 1, 0), (2, 3, 0), (1, 1, 0), (0, 3, 0)]
    folded = [(10, 0, 0), (12, 0, 0), (12, 2, 0), (12, 2, 2), (11, 2, 3), (10, 2, 2)]
    return mesh_object("Comb", flat + folded, [range(9), range(9, 15)])


def unwrap():
    import bpy

    return bpy.ops.hemibake.unwrap()


@pytest.mark.parametrize("make", [bumpy_grid, comb, lambda: mesh_object("Cube", CUBE, INWARD)])
def test_charts_lie_inside_and_do_not_overlap(make):
    obj = make()
    assert unwrap() == {"FINISHED"}
    uvs = loop_uvs(obj)
    assert uvs.min() >= 0 and uvs.max() <= 1
    assert coverage(obj, 509).max() == 1


@pytest.mark.parametrize("make", [bumpy_grid, comb])
def test_every_face_has_its_share_of_the_area(make):
    obj = make()
    unwrap()
    ratio = area_ratio(obj)
    assert ratio.min() > 0.3 * np.median(ratio)


def test_objects_share_the_atlas_in_proportion_to_their_world_size():
    small, large = mesh_object("Small", CUBE, INWARD), mesh_object("Large", CUBE, INWARD)
    large.scale = (3, 3, 3)
    objects = [small, bumpy_grid(5), large, comb()]
    unwrap()
    ratios = [area_ratio(obj).mean() for obj in objects]
    assert ratios == pytest.approx(np.full(4, ratios[0]), rel=0.25)
    assert sum(coverage(obj, 257) for obj in objects).max() == 1
    assert {obj.hemibake.atlas for obj in objects} == {"Lightmap"}


def test_charts_keep_two_empty_texels_between_them():
    """Those of one object as those of several."""
    cubes = [mesh_object(f"Cube {size}", CUBE, INWARD) for size in (1, 1.7, 0.6)]
    for cube, size in zip(cubes, (1, 1.7, 0.6), strict=True):
        cube.scale = (size, size, size)
    unwrap()
    uvs = np.concatenate([loop_uvs(cube) for cube in cubes]).reshape(-1, 4, 2) * RESOLUTION
    low, high = uvs.min(axis=1), uvs.max(axis=1)
    for i in range(18):
        for j in range(i):
            gap = np.maximum(low[i] - high[j], low[j] - high[i])
            assert gap.max() >= 2 - 1e-3 or np.allclose(gap.max(), 0, atol=1e-3)


def test_other_layers_selection_and_mode_stay():
    import bpy

    obj = mesh_object("Cube", CUBE, INWARD)
    for name in ("One", "Two"):
        obj.data.uv_layers.new(name=name)
    obj.data.uv_layers.active_index = 1
    obj.data.uv_layers["One"].active_render = True
    before = [loop_uvs(obj, name).copy() for name in ("One", "Two")]
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    unwrap()
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    layers = obj.data.uv_layers
    assert [layer.name for layer in layers] == ["One", "Two", "Lightmap"]
    assert layers.active.name == "Two" and layers["One"].active_render
    assert all((loop_uvs(obj, name) == old).all() for name, old in zip(("One", "Two"), before, strict=True))


@pytest.mark.parametrize("active", [True, False])
def test_objects_in_edit_mode_are_unwrapped_as_edited(active):
    import bmesh
    import bpy

    first, second = square("First", uvs=None), mesh_object("Second", [], [])
    for obj in (first, second):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = first
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(second.data)
    bmesh.ops.create_cube(edited, size=1)
    bmesh.update_edit_mesh(second.data)
    if not active:
        bpy.context.view_layer.objects.active = None
    assert unwrap() == {"FINISHED"}
    assert first.data.is_editmode and second.data.is_editmode
    bpy.context.view_layer.objects.active = first
    bpy.ops.object.mode_set(mode="OBJECT")
    assert (coverage(first, 131) + coverage(second, 131)).max() == 1
    assert coverage(second, 131).sum() > 1000


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_what_is_made_can_be_taken_back(mode):
    import bpy

    obj, copied = mesh_object("Cube", CUBE, INWARD), mesh_object("Copied", CUBE, INWARD)
    obj.data.uv_layers.new(name="One")
    copied.modifiers.new("Array", "ARRAY")
    for each in (obj, copied):
        each.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode=mode)
    before, changes = snapshot(), part("operators.rollback").Rollback()
    made = unwrap_missing([obj, copied], RESOLUTION, changes)
    assert len(made.objects) == 2 and snapshot() != before
    changes.undo()
    assert snapshot() == before


def test_layer_without_a_name_is_refused():
    import bpy

    bpy.context.scene.hemibake.uv_layer = ""
    square()
    with pytest.raises(RuntimeError, match="UV layer has no name. Type one"):
        unwrap()


def test_new_objects_do_not_join_an_atlas_in_use():
    old, new = square("Old"), mesh_object("New", CUBE, INWARD)
    unwrap()
    assert (old.hemibake.atlas, new.hemibake.atlas) == ("Lightmap", "Lightmap.001")


def test_unwrapping_twice_changes_nothing():
    obj = mesh_object("Cube", CUBE, INWARD)
    unwrap()
    before = loop_uvs(obj).copy()
    assert unwrap() == {"CANCELLED"}
    assert (loop_uvs(obj) == before).all()


def eight_layers():
    obj = mesh_object("Odd", CUBE, INWARD)
    for index in range(8):
        obj.data.uv_layers.new(name=f"Layer {index}")


def attribute_in_the_way():
    mesh_object("Odd", CUBE, INWARD).data.attributes.new("Lightmap", "FLOAT", "POINT")


def distant_vertex(distance):
    return lambda: mesh_object("Odd", [*CUBE[:7], (distance, 1, 1)], INWARD)


def infinite_scale():
    mesh_object("Odd", CUBE, INWARD).scale = (np.inf, 1, 1)


CANNOT = {
    "8 layers": (eight_layers, "8 UV layers.*Remove one"),
    "attribute": (attribute_in_the_way, "an attribute called 'Lightmap'.*Rename it"),
    "1e10 m": (distant_vertex(1e10), "1,000,000 km.*Delete distant vertices"),
    "1e38 m": (distant_vertex(1e38), "1,000,000 km.*Delete distant vertices"),
    "infinite vertex": (distant_vertex(np.inf), "NaN or infinite vertex.*Delete those"),
    "infinite scale": (infinite_scale, "(NaN or infinite|1,000,000 km).*scale"),
    "thin": (distant_vertex(1e7), "too many charts.*Raise the resolution"),
}


@pytest.mark.parametrize("case", CANNOT)
def test_object_that_cannot_have_uvs_is_named_and_the_others_have_some(case):
    import bpy

    make, words = CANNOT[case]
    make()
    with pytest.raises(RuntimeError, match=f"'Odd': .*{words}"):
        unwrap()
    good = mesh_object("Good", CUBE, INWARD)
    bpy.context.view_layer.update()
    assert unwrap() == {"FINISHED"}
    assert coverage(good, RESOLUTION).max() == 1
    assert good.hemibake.atlas == "Lightmap" and coverage(good, RESOLUTION).sum() > 0.3 * RESOLUTION**2
    assert "Lightmap" not in bpy.data.objects["Odd"].data.uv_layers


def test_charts_that_do_not_fit_one_lightmap_go_to_several():
    import bpy

    bpy.context.scene.hemibake.resolution = 16
    objects = [mesh_object(f"Cube {index}", CUBE, INWARD) for index in range(7)]
    assert unwrap() == {"FINISHED"}
    atlases = {obj.hemibake.atlas for obj in objects}
    assert len(atlases) > 1 and "Lightmap" in atlases
    for atlas in atlases:
        assert sum(coverage(obj, 96) for obj in objects if obj.hemibake.atlas == atlas).max() == 1


def test_mesh_whose_other_user_is_hidden_does_not_cover_the_others():
    """It fills a square of its own, for a tile in the atlas."""
    import bpy

    shown, other = mesh_object("Shown", CUBE, INWARD), mesh_object("Other", CUBE, INWARD)
    other.location.x = 3
    hidden = bpy.data.objects.new("Hidden", shown.data)
    bpy.context.scene.collection.objects.link(hidden)
    hidden.hide_set(True)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert shown.hemibake.image != other.hemibake.image


def test_thousands_of_objects_are_looked_through_once():
    import bpy

    mesh = square("First", uvs=None).data
    for number in range(4000):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Copy {number}", mesh.copy()))
    multi_user = part("operators.scene.uvs.multi_user")
    start = time.process_time()
    assert multi_user.multi_user_sources("Lightmap") == set()
    assert time.process_time() - start < 1


def test_doubled_faces_get_charts_of_their_own():
    """A square seen from both sides: two faces over the same vertices."""
    import bpy

    obj = mesh_object("Sheet", SQUARE, [(0, 1, 2, 3), (3, 2, 1, 0)])
    bpy.ops.hemibake.unwrap()
    uvs = loop_uvs(obj).reshape(2, 4, 2)
    low, high = uvs.min(axis=1), uvs.max(axis=1)
    assert (high[0] < low[1]).any() or (high[1] < low[0]).any()


def arch(name, steps=9):
    """Return half a tube: a surface that bends without a crease."""
    angle = np.linspace(0, np.pi, steps)
    rims = [(np.cos(a), y, np.sin(a)) for a in angle for y in (0, 2)]
    quads = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(steps - 1)]
    return mesh_object(name, rims, quads)


@pytest.mark.long
def test_mesh_that_xatlas_cannot_cut_is_named_and_the_others_go_on(monkeypatch):
    from pathlib import Path

    process = part("operators.scene.uvs.unwrap_process")
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setattr(process, "_UNWRAP", "crashing_unwrap:unwrap")
    monkeypatch.setattr(process, "_CUT", "crashing_unwrap:cut")
    objects = [arch(name) for name in ("First", "Bad", "Second", "Bad too", "Third")]
    for number, obj in enumerate(objects):
        obj.location.x = 3 * number
    made = unwrap_missing(objects, RESOLUTION, part("operators.rollback").Rollback())
    assert made.objects == objects and not made.skipped
    (note,) = made.notes
    assert "'Bad', 'Bad too'." in note and "'First'" not in note and "Smart UV" in note
    assert sum(coverage(obj, 509) for obj in objects).max() == 1
    assert min(coverage(obj, 127).sum() for obj in objects) > 1000


def test_charts_do_not_depend_on_the_number_of_cores(monkeypatch):
    process = part("operators.scene.uvs.unwrap_process")
    monkeypatch.setattr(process, "_MANY", 1)
    objects, found = [arch(name, 5 + 2 * number) for number, name in enumerate("ABC")], []
    for cores in (1, 3):
        monkeypatch.setattr(process.os, "cpu_count", lambda cores=cores: cores)
        changes = part("operators.rollback").Rollback()
        unwrap_missing(objects, RESOLUTION, changes)
        found.append(np.concatenate([loop_uvs(obj) for obj in objects]))
        changes.undo()
    assert np.array_equal(*found)


def test_unwrapping_without_a_process_fails_as_a_whole_and_says_what(monkeypatch):
    process = part("operators.scene.uvs.unwrap_process")
    for name in ("_UNWRAP", "_CUT"):
        monkeypatch.setattr(process, name, "no_such_module:work")
    obj, changes = arch("Arch"), part("operators.rollback").Rollback()
    with pytest.raises(Exception, match="could not be made. The unwrapping process could not start"):
        unwrap_missing([obj], RESOLUTION, changes)
    assert not obj.data.uv_layers


def collapsed_faces(count, unit):
    """Return vertices and faces of a plate with `count` faces that have a corner in the middle of an edge."""
    random = np.random.default_rng(11)
    vertices, faces = [tuple(corner) for corner in np.array(SQUARE) * unit], [(0, 1, 2, 3)]
    for _ in range(count):
        first = (random.uniform(0, 1, 3) * unit).astype(np.float32)
        second = (first + random.normal(size=3) * 0.1 * unit).astype(np.float32)
        corners = (first, second, (first + second) / np.float32(2))
        faces.append(tuple(range(len(vertices), len(vertices) + 3)))
        vertices += [tuple(float(value) for value in corner) for corner in corners]
    return vertices, faces


@pytest.mark.parametrize("unit", [1.0, 0.001, 1000.0])
def test_collapsed_faces_take_no_room_from_the_others(unit):
    import bpy

    plate = mesh_object("Plate", *collapsed_faces(307, unit))
    floor = mesh_object("Floor", np.array(SQUARE) * unit, [(0, 1, 2, 3)])
    unwrap_missing([plate, floor], 64, part("operators.rollback").Rollback())
    width = np.ptp(loop_uvs(floor).reshape(-1, 2), axis=0).min() * 64
    assert width > 25
    assert np.ptp(loop_uvs(plate).reshape(-1, 2)[:4], axis=0).min() * 64 == pytest.approx(width, abs=2)
    bpy.ops.hemibake.check()
    found = part("operators.checks").last_check(bpy.context.scene).findings
    assert not any("zero area" in one.text or "room" in one.text or "too small" in one.text for one in found)


def test_a_refused_unwrap_leaves_the_charts_of_others():
    import bpy

    bpy.context.scene.hemibake.resolution = 32
    other = square("Other", uvs=None)
    other.scale = (3, 1, 1)
    gone = bumpy_grid(3)
    assert unwrap() == {"FINISHED"}
    bpy.data.objects.remove(gone)
    count = 900
    left = np.arange(count) * 2.0
    points = [(x + dx, 5 + y, x % 7) for x in left for dx, y in ((0, 0), (1, 0), (0, 1))]
    mesh_object("Shards", points, np.arange(3 * count).reshape(-1, 3).tolist())
    before, known = snapshot(), loop_uvs(other)
    with pytest.raises(RuntimeError, match="too many charts"):
        unwrap()
    assert (loop_uvs(other) == known).all()
    assert snapshot() == before


def plates(name, rows):
    """Return an object of rows x rows separate squares."""
    starts = [(3 + 1.5 * i, 1.5 * k) for i in range(rows) for k in range(rows)]
    points = [(x + dx, y + dy, 0) for x, y in starts for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return mesh_object(name, points, np.arange(4 * rows**2).reshape(-1, 4).tolist())


def test_a_refused_unwrap_tells_only_why(capfd):
    import bpy

    settings = bpy.context.scene.hemibake
    settings.resolution = 64
    for index in range(9):
        square(f"Wall {index}", uvs=None).scale = (1 + index, 1, 1)
    assert unwrap() == {"FINISHED"}
    settings.resolution = 16
    for name in ("Many", "Many Others"):
        plates(name, 30).select_set(True)
    before, _ = snapshot(), capfd.readouterr()
    with pytest.raises(RuntimeError, match="too many charts") as refused:
        unwrap()
    assert "New lightmap UVs were made" not in str(refused.value)
    assert "Info: " not in capfd.readouterr().out
    assert snapshot() == before
