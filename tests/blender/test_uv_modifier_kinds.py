"""One of each kind of modifier that copies or makes faces: its UVs are drawn, exported, brought and told."""

import json

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    covering,
    evaluated_uvs,
    loop_uvs,
    material,
    mesh_object,
    part,
    pixels,
    read_scene,
    report,
)
from tests.rows import long

NAME = "Lightmap UVs"

#: Modifiers by name: type, settings, and what changes the faces that they make.
KINDS = {
    "Mirror": ("MIRROR", {"use_mirror_merge": False}, {"use_axis": (True, True, False)}),
    "Array": ("ARRAY", {"count": 3, "relative_offset_displace": (1.3, 0, 0)}, {"count": 5}),
    "Solidify": ("SOLIDIFY", {"thickness": 0.13}, {"use_rim_only": True}),
    "Bevel": ("BEVEL", {"affect": "VERTICES", "width": 0.47, "segments": 4}, {"segments": 3}),
    "Nodes": ("NODES", {}, None),
}


@pytest.fixture(scope="module")
def file(hemibake, tmp_path_factory):
    """A file with cubes, each with a modifier of another kind, unwrapped into one lightmap."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.hemicube = "high", 128, "16"
    surface = material("Glow", emission=0.5)
    for number, (name, (kind, values, _)) in enumerate(KINDS.items()):
        obj = mesh_object(name, CUBE, INWARD, surface=surface)
        obj.location = (5 * number, 0.3 * number, 0.1 * number)
        obj.rotation_euler = (0.2, 0.1 * number, 0.3)
        modifier = obj.modifiers.new("Maker", kind)
        for key, value in values.items():
            setattr(modifier, key, value)
    bpy.data.objects["Nodes"].modifiers["Maker"].node_group = extruding()
    bpy.context.view_layer.update()
    assert bpy.ops.hemibake.unwrap() == {"FINISHED"}
    path = str(tmp_path_factory.mktemp("kinds") / "row.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


@pytest.fixture
def row(file):
    """The objects of that file, by name."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=file)
    return {name: bpy.data.objects[name] for name in KINDS}


def extruding():
    """Return a node group that pulls each face out by itself."""
    import bpy

    group = bpy.data.node_groups.new("Extruding", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    extrude = group.nodes.new("GeometryNodeExtrudeMesh")
    extrude.inputs["Individual"].default_value, extrude.inputs["Offset Scale"].default_value = True, 0.2
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], extrude.inputs["Mesh"])
    group.links.new(extrude.outputs["Mesh"], group.nodes.new("NodeGroupOutput").inputs[0])
    return group


@pytest.fixture
def elsewhere(row):
    """The UVs of that file, by name; the scene is empty again."""
    import bpy

    uvs = all_uvs()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.hemicube = "high", 128, "16"
    return uvs


def all_uvs():
    """Return the UVs of each object's evaluated mesh, by name."""
    import bpy

    return {name: evaluated_uvs(bpy.data.objects[name]) for name in KINDS}


def equal(uvs, others):
    return all(np.array_equal(uvs[name], others[name]) for name in KINDS)


def check():
    """Return the check's findings on results of modifiers."""
    import bpy

    bpy.ops.hemibake.check()
    found = part("operators.checks").last_check(bpy.context.scene).findings
    return [one for one in found if "has changed since" in one.text]


def fix(found):
    import bpy

    return bpy.ops.hemibake.fix(fix=found.fix, names=json.dumps(found.objects), value=found.value)


def texels_of(meshes) -> np.ndarray:
    """Return the number of triangles over each point of a grid over the lightmap."""
    return covering(np.concatenate([mesh.uvs for mesh in meshes]), 512)


def test_each_has_a_modifier_and_a_place_of_its_own_in_the_lightmap(row):
    import bpy

    for name, obj in row.items():
        assert [modifier.name for modifier in obj.modifiers] == ["Maker", NAME]
        assert not obj.data.uv_layers and len(evaluated_uvs(obj)) > len(obj.data.loops), name
    covered = texels_of(read_scene().scene.meshes)
    assert (covered > 1).sum() <= 0.005 * (covered > 0).sum() and (covered > 0).mean() > 0.3
    before = all_uvs()
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert report()["objects"] == len(KINDS) and equal(all_uvs(), before)


@pytest.mark.parametrize("engine", ["CYCLES", long("EEVEE")])
def test_renders_have_the_uvs_of_each(row, tmp_path, engine):
    """The picture shows UVs as colours; each pixel must have the UV of the face that its ray hits."""
    import bpy

    scene = bpy.context.scene
    shown = coordinates()
    for obj in row.values():
        obj.data.materials[0] = shown
    camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 26, (11, 1, 9)
    scene.camera, scene.world = camera, None
    drawn = render(scene, engine, tmp_path / "drawn.exr")
    expected = met_by_rays(scene, drawn.shape[:2])
    hit = ~np.isnan(expected[..., 0])
    assert 400 < hit.sum() < 0.6 * hit.size
    apart = np.abs(drawn[..., :2] - expected)[hit].max(axis=1)

    # A pixel on an edge may show the face beside it.
    assert np.median(apart) < 2e-3 and (apart > 0.01).mean() < 0.04


def coordinates():
    """Return a material that glows in the colour (u, v, 0)."""
    import bpy

    result = bpy.data.materials.new("Coordinates")
    tree = part("operators.compat").new_node_tree(result)
    uv, glow = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeEmission")
    uv.uv_map = "Lightmap"
    tree.links.new(uv.outputs[0], glow.inputs["Color"])
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    return result


def render(scene, engine, path) -> np.ndarray:
    """Return a render of pixel centres, (h, w, 4)."""
    import bpy

    if engine == "EEVEE":
        engine = "BLENDER_EEVEE_NEXT" if bpy.app.version < (5, 0, 0) else "BLENDER_EEVEE"
    scene.render.engine, scene.render.filter_size = engine, 0
    scene.cycles.samples, scene.cycles.use_denoising, scene.eevee.taa_render_samples = 1, False, 1
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 208, 40, 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return pixels(bpy.data.images.load(str(path)))


def met_by_rays(scene, shape) -> np.ndarray:
    """Return the UVs which rays down through the pixel centres of a camera meet, (h, w, 2), NaN for none."""
    import bpy
    from mathutils import Vector
    from mathutils.geometry import barycentric_transform

    depsgraph, camera = bpy.context.evaluated_depsgraph_get(), scene.camera
    uvs, size = all_uvs(), camera.data.ortho_scale / shape[1]
    met = np.full((*shape, 2), np.nan)
    for row, column in np.ndindex(shape):
        start = camera.location + size * Vector((column + 0.5 - shape[1] / 2, row + 0.5 - shape[0] / 2, 0))
        hit, place, _, face, obj, matrix = scene.ray_cast(depsgraph, start, (0, 0, -1))
        if not hit:
            continue
        mesh, point = obj.evaluated_get(depsgraph).data, matrix.inverted() @ place
        distances = []
        for triangle in (one for one in mesh.loop_triangles if one.polygon_index == face):
            corners = [mesh.vertices[index].co for index in triangle.vertices]
            places = [Vector((*uvs[obj.name][loop], 0)) for loop in triangle.loops]
            at = barycentric_transform(point, *corners, *places)
            back = barycentric_transform(point, *corners, *map(Vector, np.eye(3)))
            distances.append((-min(back), tuple(at)[:2]))
        met[row, column] = min(distances)[1]
    return met


def test_gltf_with_modifiers_has_the_uvs_of_each(row, tmp_path):
    import addon_utils
    import bpy

    addon_utils.enable("io_scene_gltf2")
    expected, path = all_uvs(), str(tmp_path / "row.glb")
    bpy.ops.export_scene.gltf(filepath=path, export_apply=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=path)
    assert sorted(obj.name for obj in bpy.data.objects) == sorted(KINDS)
    for name in KINDS:
        obj = bpy.data.objects[name]
        exported = evaluated_uvs(obj, obj.data.uv_layers[-1].name)
        apart = np.abs(exported[:, None] - expected[name][None]).max(axis=2)
        assert apart.min(axis=0).max() < 1e-6 and apart.min(axis=1).max() < 1e-6, name


def test_undo_and_redo(row):
    import bpy

    uvs = all_uvs()
    bpy.ops.ed.undo_push(message="Unwrap")
    for obj in row.values():
        obj.select_set(True)
    bpy.ops.hemibake.remove_uv_modifiers()
    bpy.ops.ed.undo_push(message="Remove")
    bpy.ops.ed.undo()
    assert equal(all_uvs(), uvs)
    bpy.ops.ed.redo()
    assert all(len(bpy.data.objects[name].modifiers) == 1 for name in KINDS)
    assert [group.name for group in bpy.data.node_groups] == ["Extruding"]
    bpy.ops.ed.undo()
    assert equal(all_uvs(), uvs)


@pytest.mark.parametrize("how", ["append", "link"])
def test_objects_of_another_file_are_baked_with_its_uvs(file, elsewhere, how):
    import bpy

    uvs, folder = elsewhere, f"{file}/Object/"
    names = [{"name": name} for name in KINDS]
    getattr(bpy.ops.wm, how)(filepath=folder + "Mirror", directory=folder, files=names)
    assert equal(all_uvs(), uvs) and not check()
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert report()["objects"] == len(KINDS) and equal(all_uvs(), uvs)
    warnings = report()["warnings"]
    assert not [text for text in warnings if any(f"'{name}'" in text for name in KINDS)]


def change(row):
    """Change which faces the modifiers make."""
    import bpy

    for name, (*_, changed) in KINDS.items():
        for key, value in (changed or {}).items():
            setattr(row[name].modifiers["Maker"], key, value)
    extrude = next(node for node in bpy.data.node_groups["Extruding"].nodes if node.type == "EXTRUDE_MESH")
    extrude.inputs["Individual"].default_value = False
    bpy.context.view_layer.update()


def test_changed_topology_is_told_and_unwrapped_anew(row):
    import bpy

    assert not check()
    change(row)
    (found,) = check()
    assert (found.severity, found.fix) == ("INFO", "unwrap") and set(found.objects) == set(KINDS)
    assert fix(found) == {"FINISHED"} and not check()
    covered = texels_of(read_scene().scene.meshes)
    assert (covered > 1).sum() <= 0.005 * (covered > 0).sum()
    assert bpy.ops.hemibake.bake() == {"FINISHED"} and report()["objects"] == len(KINDS)


def test_linked_objects_that_have_changed_are_applied_on_copies(row, tmp_path):
    import bpy

    change(row)
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.hemibake.resolution = 128
    with bpy.data.libraries.load(path, link=True) as (_, linked):
        linked.objects = list(KINDS)
    for obj in linked.objects:
        bpy_link(obj)
    bpy.context.view_layer.update()
    (found,) = check()
    assert (found.severity, found.fix) == ("ERROR", "apply_on_copy") and set(found.objects) == set(KINDS)
    assert fix(found) == {"FINISHED"} and not check()
    assert {obj.name for obj in bpy.context.scene.objects} == {f"{name} applied" for name in KINDS}
    assert bpy.ops.hemibake.bake() == {"FINISHED"} and report()["objects"] == len(KINDS)


def test_copies_with_applied_modifiers_keep_the_uvs(row):
    import bpy

    uvs = all_uvs()
    for obj in row.values():
        obj.select_set(True)
    assert bpy.ops.hemibake.apply_on_copy() == {"FINISHED"}
    for name in KINDS:
        copy = bpy.data.objects[f"{name} applied"]
        assert not copy.modifiers and np.array_equal(loop_uvs(copy), uvs[name]), name


def test_bevelled_edges_follow_the_uvs_of_the_mesh():
    """This holds for any number of segments: each new face gets a UV area of its own."""
    import bpy

    obj = mesh_object("Box", CUBE, INWARD)
    bevel = obj.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.11, 2
    bpy.context.view_layer.update()
    bpy.ops.hemibake.unwrap()
    assert [modifier.name for modifier in obj.modifiers] == ["Bevel"] and "Lightmap" in obj.data.uv_layers
    for segments in (2, 5):
        bevel.segments = segments
        bpy.context.view_layer.update()
        assert not check()
        covered = texels_of(read_scene().scene.meshes)
        assert (covered > 1).sum() <= 0.005 * (covered > 0).sum() and (covered > 0).mean() > 0.3
