"""Light Probe Spheres: read from the scene, baked, and written as EXR, HDR and KTX2 with manifest entries."""

import json
import sys

import numpy as np
import pytest

from tests.blender.things import bpy_link, furnace, part, pixels, report, square
from tests.json_schema import faults

SIZE = 64


def probe_sphere(name="Sphere", location=(0.5, 0.5, 0.5), scale=(1.0, 1.0, 1.0), **values):
    """Return a linked Light Probe Sphere."""
    import bpy

    data = bpy.data.lightprobes.new(name, "SPHERE")
    data.influence_distance = 0.45
    for key, value in values.items():
        setattr(data, key, value)
    obj = bpy_link(bpy.data.objects.new(name, data))
    obj.location, obj.scale = location, scale
    bpy.context.view_layer.update()
    return obj


def bake(folder):
    """Bake into a folder; return its manifest."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.directory, settings.reflection_cubes, settings.samples = str(folder), True, 32
    settings.reflection_size = str(SIZE)
    bpy.ops.hemibake.bake()
    return json.loads((folder / "hemibake.json").read_text())


def state(obj):
    """Return what a bake must not change in a sphere."""
    data = obj.data
    names = "influence_type", "influence_distance", "falloff", "parallax_type", "parallax_distance"
    return np.array(obj.matrix_world).tobytes(), *(getattr(data, name) for name in names)


def decoded(path):
    """Return the levels of a KTX2 cube map, (6, s, s, 3) float32 each."""
    data = path.read_bytes()
    words = np.frombuffer(data, "<u4", 17, 12)
    vk_format, _, width, height, depth, layers, faces, levels, scheme = words[:9]
    assert (vk_format, depth, layers, faces, scheme) == (123, 0, 0, 6, 0) and width == height == SIZE
    index = np.frombuffer(data, "<u8", 3 * int(levels), 80).reshape(-1, 3)
    assert int(index[0, 0] + index[0, 1]) == len(data) and (index[:, 0] % 4 == 0).all()
    ktx2 = part("engine.encoding.ktx2")
    return [
        ktx2.from_rgb9e5(np.frombuffer(data, "<u4", int(length) // 4, int(start))).reshape(
            6, SIZE >> level, SIZE >> level, 3
        )
        for level, (start, length, _) in enumerate(index)
    ]


def test_spheres_are_baked_into_cube_files(tmp_path):
    """In a furnace the radiance is 2 at every level; the mirrored object is described, not changed."""
    import bpy

    furnace()
    obj = probe_sphere(
        influence_type="BOX", falloff=0.25, use_custom_parallax=True, parallax_type="ELIPSOID",
        parallax_distance=0.7, scale=(-1.0, 0.5, 0.8),
    )  # fmt: skip
    obj.rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    before = state(obj)
    manifest = bake(tmp_path)
    (entry,) = manifest["reflections"]
    assert state(obj) == before and faults(manifest) == []
    assert entry["name"] == "Sphere" and entry["position"] == pytest.approx([0.5, 0.5, 0.5])
    assert entry["size"] == SIZE and entry["roughness"] == pytest.approx([0, 1 / 3, 2 / 3, 1])
    world = np.array(obj.matrix_world)
    for key, shape, distance in (("influence", "box", 0.45), ("parallax", "sphere", 0.7)):
        matrix = np.array(entry[key]["matrix"])
        assert entry[key]["shape"] == shape and np.linalg.det(matrix[:3, :3]) > 0
        assert np.abs(matrix[:3, 1:3]) == pytest.approx(np.abs(distance * world[:3, 1:3]), abs=1e-6)
    assert entry["influence"]["falloff"] == pytest.approx(0.25)
    assert [name.rsplit(".")[-1] for name in entry["files"]] == ["exr", "hdr", "ktx2"]
    for name in entry["files"]:
        assert any(path.endswith(name) for path in report()["files"])
    levels = decoded(tmp_path / entry["files"][2])
    assert [level.shape[1] for level in levels] == [64, 32, 16, 8]
    for level in levels:
        assert level == pytest.approx(np.full_like(level, 2.0), rel=0.02)
    strip = part("operators.result.reflection_files").cube_strip(levels)
    for name in entry["files"][:2]:
        image = bpy.data.images.load(str(tmp_path / name))
        shown = pixels(image)[..., :3]
        assert shown.shape == (120, 6 * SIZE, 3)
        assert shown == pytest.approx(strip, rel=0.01, abs=1e-6)


def test_files_of_others_stay(tmp_path):
    """A second bake replaces its own files; a changed one gets a neighbor with a number."""
    square()
    probe_sphere("Mirror", (0.5, 0.5, 1.0))
    (first,) = bake(tmp_path)["reflections"]
    (again,) = bake(tmp_path)["reflections"]
    assert again["files"] == first["files"]
    (tmp_path / first["files"][1]).write_bytes(b"mine")
    (third,) = bake(tmp_path)["reflections"]
    assert third["files"] != first["files"] and (tmp_path / first["files"][1]).read_bytes() == b"mine"


def test_bad_spheres_never_block_others(tmp_path):
    """Without a radius, scaled to nothing, with an empty parallax: each gets a message with the remedy."""
    square()
    probe_sphere("Good", (0.5, 0.5, 1.0))
    probe_sphere("Empty", influence_distance=0.0)
    probe_sphere("Flat", scale=(1, 1, 0))
    probe_sphere("No Parallax", use_custom_parallax=True, parallax_distance=0.0)
    (entry,) = bake(tmp_path)["reflections"]
    assert entry["name"] == "Good"
    warnings = report()["warnings"]
    for name in ("Empty", "Flat"):
        assert any(f"Light Probe Sphere '{name}': its influence has no size." in text for text in warnings)
    assert any("'No Parallax': its custom parallax has no size." in text for text in warnings)


def test_a_scene_without_spheres_gets_a_note(tmp_path):
    square()
    assert "reflections" not in bake(tmp_path)
    assert any("the scene has no Light Probe Sphere" in text for text in report()["warnings"])


def test_spheres_are_left_out_of_bakes_without_the_switch(tmp_path):
    import bpy

    square()
    probe_sphere()
    settings = bpy.context.scene.hemibake
    settings.directory, settings.samples = str(tmp_path), 32
    bpy.ops.hemibake.bake()
    assert "reflections" not in json.loads((tmp_path / "hemibake.json").read_text())


def test_lamps_are_shown_if_cameras_see_them(tmp_path):
    """An area lamp above the sphere has the radiance P / (pi area) with Ray Visibility > Camera only."""
    import bpy

    square()
    probe_sphere()
    data = bpy.data.lights.new("Lamp", "AREA")
    data.size, data.energy = 1.0, 100.0
    lamp = bpy_link(bpy.data.objects.new("Lamp", data))
    lamp.location = (0.5, 0.5, 2.5)
    for is_visible in (True, False):
        lamp.visible_camera = is_visible
        (entry,) = bake(tmp_path)["reflections"]
        up = decoded(tmp_path / entry["files"][2])[0][2, 28:36, 28:36]
        assert up.mean() == pytest.approx(100 / np.pi * is_visible, rel=0.05)


@pytest.mark.long
def test_faces_agree_with_cycles(tmp_path):
    """In the Cornell box, off its middle: each face's mean within 3 % of a render by Cycles' camera."""
    import bpy

    from tools.engines import cornell

    sys.path.insert(0, str(cornell.ROOT / "examples"))
    import cornell_box

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    cornell_box.build()
    bpy.data.objects["Front Wall"].visible_camera = True
    place = (0.2, -0.3, 1.4)
    probe_sphere(location=place)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution = "high", 96
    (entry,) = bake(tmp_path)["reflections"]
    faces = decoded(tmp_path / entry["files"][2])[0]
    axes = part("engine.reflections.cube_faces").face_axes()
    for number, face in enumerate(faces):
        shown = rendered_face(axes[number], place, tmp_path / "face.exr")
        assert face.mean(axis=(0, 1)) == pytest.approx(shown.mean(axis=(0, 1)), rel=0.03)


def rendered_face(axes, place, path):
    """Return what Cycles' camera sees of a face of a cube, (h, w, 3), top row first."""
    import bpy
    from mathutils import Matrix

    scene, camera = bpy.context.scene, bpy.context.scene.camera
    columns, rows, outward = axes
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = np.stack([columns, -rows, -outward], axis=1), place
    camera.matrix_world, camera.data.angle = Matrix(turned.tolist()), np.pi / 2
    camera.data.clip_start = 1e-3
    render = scene.render
    render.engine, render.resolution_x, render.resolution_y = "CYCLES", 32, 32
    render.resolution_percentage, render.filepath = 100, str(path)
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 256, False, 32
    scene.cycles.diffuse_bounces, scene.cycles.use_adaptive_sampling = 32, False
    scene.cycles.sample_clamp_indirect = 0
    bpy.ops.render.render(write_still=True)
    return pixels(bpy.data.images.load(str(path), check_existing=False))[::-1, :, :3]
