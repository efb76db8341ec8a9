"""Without xatlas, Blender's operators make lightmap UVs, and everything else works as before."""

import sys

import numpy as np
import pytest

from tests.blender import test_uv_modifier
from tests.blender.test_unwrap import area_ratio, bumpy_grid, comb, unwrap
from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE,
    furnace,
    loop_uvs,
    mesh_object,
    part,
    pixels,
    report,
    snapshot,
    square,
    unwrap_missing,
)
from tests.rows import long

RESOLUTION = 257


@pytest.fixture(autouse=True)
def without_xatlas(empty_scene, monkeypatch):
    import bpy

    monkeypatch.setitem(sys.modules, "xatlas", None)
    bpy.context.scene.hemibake.resolution = RESOLUTION


def coverage(obj, size) -> np.ndarray:
    """Return the number of triangles of the UV layer over each texel centre of a size x size grid."""
    obj.data.calc_loop_triangles()
    triangles = np.array([list(triangle.loops) for triangle in obj.data.loop_triangles])
    covered = part("operators.scene.uvs.uv_faults").covered_texels
    texels, count = covered(loop_uvs(obj)[triangles], size)
    grid = np.zeros(size * (size + 1), int)
    grid[texels] = count
    return grid.reshape(size, size + 1)[:, :-1]


def cube(name="Cube"):
    return mesh_object(name, CUBE, INWARD)


def spiral(steps=53):
    """Return a ramp of two turns: seen from above it lies on itself."""
    angle = np.linspace(0, 4 * np.pi, steps)
    rim = np.stack([np.cos(angle), np.sin(angle), angle / 8], axis=1)
    inner = rim * (0.4, 0.4, 1)
    quads = [(i, i + 1, steps + i + 1, steps + i) for i in range(steps - 1)]
    return mesh_object("Spiral", [*map(tuple, rim), *map(tuple, inner)], quads)


def primitive(name, **options):
    def make():
        import bpy

        getattr(bpy.ops.mesh, f"primitive_{name}_add")(**options)
        made = bpy.context.object
        bpy.context.view_layer.objects.active = None
        made.select_set(False)
        return made

    return make


def double():
    return mesh_object("Sheet", SQUARE, [(0, 1, 2, 3), (3, 2, 1, 0)])


MESHES = [
    cube,
    bumpy_grid,
    comb,
    spiral,
    double,
    primitive("uv_sphere"),
    primitive("torus"),
    primitive("monkey"),
]


@pytest.mark.one_version
@pytest.mark.parametrize("make", MESHES)
def test_charts_lie_inside_do_not_overlap_and_give_every_face_its_share(make):
    obj = make()
    assert unwrap() == {"FINISHED"}
    uvs = loop_uvs(obj)
    assert uvs.min() > 0 and uvs.max() < 1
    assert coverage(obj, 4 * RESOLUTION).max() == 1
    ratio = area_ratio(obj)
    assert ratio.min() > 0.2 * np.median(ratio) and (coverage(obj, RESOLUTION) > 0).mean() > 0.1


@pytest.mark.one_version
def test_meshes_share_an_atlas_by_their_size_in_the_world():
    made = [make() for make in MESHES]
    made[0].scale = (2, 2, 2)
    unwrap()
    assert {obj.hemibake.atlas for obj in made} == {"Lightmap"}
    assert sum(coverage(obj, 4 * RESOLUTION) for obj in made).max() == 1
    density = [np.median(area_ratio(obj)) for obj in made]
    assert max(density) < 1.5 * min(density)


@pytest.mark.one_version
def test_charts_keep_two_empty_texels_between_them():
    obj = cube()
    unwrap()
    uvs = loop_uvs(obj).reshape(-1, 4, 2).astype(np.float64) * RESOLUTION
    low, high = uvs.min(axis=1), uvs.max(axis=1)
    gaps = [np.maximum(low[i] - high[j], low[j] - high[i]).max() for i in range(6) for j in range(i)]
    assert min(gaps) > 2 - 1e-3
    assert low == pytest.approx(np.round(low), abs=1e-3)


@pytest.mark.parametrize("mode", ["OBJECT", "EDIT"])
def test_nothing_of_the_user_changes_and_what_is_made_can_be_taken_back(mode):
    import bpy

    obj, copied, other = cube(), cube("Copied"), cube("Other")
    obj.data.uv_layers.new(name="One")
    obj.data.uv_layers.new(name="Two")
    obj.data.uv_layers.active_index = 0
    copied.modifiers.new("Array", "ARRAY")
    for each in (obj, copied):
        each.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode=mode)
    before, datablocks = snapshot(), names()
    changes = part("operators.rollback").Rollback()
    made = unwrap_missing([obj, copied, other], RESOLUTION, changes)
    after = snapshot()
    assert len(made.objects) == 3 and after != before
    for key in ("mode", "active", "selected", "render", "materials", "images"):
        assert after[key] == before[key]
    assert names()[:2] == datablocks[:2] and obj.data.uv_layers.active.name == "One"
    changes.undo()
    assert snapshot() == before and names() == datablocks


def names():
    """Return the names of scenes, of workspaces, and of objects and meshes."""
    import bpy

    data = bpy.data
    kinds = (data.scenes, data.workspaces, data.objects, data.meshes)
    return [sorted(item.name for item in kind) for kind in kinds]


@pytest.mark.parametrize(
    ("kind", "settings"), [("ARRAY", {"count": 3}), long("MIRROR", {}), long("BEVEL", {"width": 0.1})]
)
def test_modifiers_that_make_faces_get_uvs_of_these(kind, settings):
    import bpy

    chair = test_uv_modifier.copied(kind, **settings)
    furnace("Room").scale = (9, 9, 9)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert chair.modifiers[-1].name == "Lightmap UVs" or kind == "BEVEL"
    assert test_uv_modifier.coverage("Chair", "Room").max() == 1
    assert report()["objects"] == 2


@pytest.mark.one_version
def test_charts_that_do_not_fit_one_lightmap_go_to_several():
    import bpy

    bpy.context.scene.hemibake.resolution = 24
    objects = [cube(f"Cube {index}") for index in range(11)]
    assert unwrap() == {"FINISHED"}
    for atlas in {obj.hemibake.atlas for obj in objects}:
        assert sum(coverage(obj, 96) for obj in objects if obj.hemibake.atlas == atlas).max() == 1


def test_bake_is_right_and_says_how_its_uvs_were_made_only_once_they_are():
    import bpy

    furnace()
    bpy.ops.hemibake.bake()
    image = pixels(bpy.data.images["Lightmap"])
    covered = coverage(bpy.data.objects["Furnace"], RESOLUTION) > 0
    assert image[covered][:, :3] == pytest.approx(2, rel=0.01)
    assert any("Smart UV Project" in warning for warning in report()["warnings"])
    bpy.ops.hemibake.bake()
    assert not any("Smart UV Project" in warning for warning in report()["warnings"])


def test_self_test_says_that_xatlas_is_missing():
    import bpy

    assert bpy.ops.hemibake.self_test() == {"FINISHED"}
    last = part("operators.self_test").last_test
    assert last.right and "xatlas is missing" in last.text.splitlines()[1]


def test_layer_of_the_user_is_left_alone_without_a_notice():
    import bpy

    obj = square()
    before = loop_uvs(obj).copy()
    bpy.context.scene.world = bpy.data.worlds.new("White")
    bpy.ops.hemibake.bake()
    assert (loop_uvs(obj) == before).all() and report()["objects"] == 1
    assert not any("xatlas" in warning for warning in report()["warnings"])


def test_mesh_of_which_blender_drops_faces_gets_a_chart_for_each_face(monkeypatch):
    import bpy

    charts, obj = part("operators.scene.uvs.blender_charts"), cube()
    monkeypatch.setattr(charts, "_project", lambda: bpy.ops.mesh.delete(type="FACE"))
    assert unwrap() == {"FINISHED"}
    assert coverage(obj, RESOLUTION).max() == 1 and area_ratio(obj).min() > 0
