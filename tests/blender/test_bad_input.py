"""Unbakeable input gives a message with a remedy and leaves the .blend unchanged."""

from collections.abc import Callable

import numpy as np
import pytest

from tests.blender.things import (
    SQUARE,
    SQUARE_UVS,
    files_below,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    report,
    snapshot,
    square,
)


def bake() -> str:
    """Bake, expecting an error, and return its message."""
    import bpy

    with pytest.raises(RuntimeError) as caught:
        bpy.ops.hemibake.bake()
    return str(caught.value)


def no_mesh():
    import bpy

    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Empty", None))


def no_faces():
    mesh_object("Points", SQUARE, [])


def zero_area():
    mesh_object("Flat", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])


def nan_coordinates():
    mesh_object("Broken", [(0, 0, 0), (1, 0, 0), (np.nan, 1, 0)], [(0, 1, 2)])


def nan_coordinates_with_uvs():
    mesh_object("Broken", [(0, 0, 0), (1, 0, 0), (np.nan, 1, 0)], [(0, 1, 2)], SQUARE_UVS[:3])


def nan_uvs():
    square("Odd", uvs=[(np.nan, 0), *SQUARE_UVS[1:]])


def overlapping_uvs():
    square("Folded", uvs=[(0.1, 0.1), (0.9, 0.1), (0.1, 0.2), (0.9, 0.2)])


def resolution(value: int) -> Callable[[], None]:
    def make():
        import bpy

        square()
        bpy.context.scene.hemibake.resolution = value

    return make


def with_material(name: str, value) -> Callable[[], None]:
    def make():
        surface = material("Lava", emission=1.0)
        surface.node_tree.nodes["Principled BSDF"].inputs[name].default_value = value
        square(surface=surface)

    return make


def world_nan():
    import bpy

    square()
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    nodes = part("operators.compat").new_node_tree(world).nodes
    background = next(node for node in nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (np.nan, 1, 1, 1)


def lamp_nan():
    import bpy

    lamp = bpy.data.lights.new("Bulb", "POINT")
    lamp.energy = np.nan
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Bulb", lamp))


#: Faults of a material, a lamp or the world: something else is baked instead.
REPLACED = {
    "NaN base colour": (
        with_material("Base Color", (np.nan, 0, 0, 1)),
        ["'Lava'", "reflectance", "base color", "grey is baked"],
    ),
    "infinite emission": (
        with_material("Emission Color", (np.inf, 0, 0, 1)), ["'Lava'", "emission", "grey is baked"],
    ),
    "NaN lamp": (lamp_nan, ["'Bulb'", "power", "not baked"]),
    "NaN world": (world_nan, ["world", "NaN", "color and strength", "black"]),
}  # fmt: skip

CASES = {
    "no mesh": (no_mesh, ["no mesh", "Add a mesh object"]),
    "no faces": (no_faces, ["Points", "no faces"]),
    "zero area": (zero_area, ["Flat", "zero-area"]),
    "NaN coordinates": (nan_coordinates, ["'Broken'", "NaN", "Delete those vertices"]),
    "NaN coordinates with UVs": (nan_coordinates_with_uvs, ["'Broken'", "NaN", "Delete those vertices"]),
    "NaN UVs": (nan_uvs, ["'Odd'", "NaN", "Unwrap"]),
    "overlapping UVs": (overlapping_uvs, ["'Folded'", "Unwrap"]),
    "resolution 0": (resolution(0), ["resolution is 0", "choose 8 to 16384"]),
    "resolution 100000": (resolution(100_000), ["resolution is 100000", "choose 8 to 16384"]),
}


@pytest.mark.parametrize("case", CASES)
def test_error_names_the_cause_and_the_remedy_and_nothing_changes(case, tmp_path):
    import bpy

    make, words = CASES[case]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    mesh_object("Good", [(5, 0, 0), (6, 0, 0), (5, 1, 0)], [(0, 1, 2)]).hide_render = True
    make()
    before, files = snapshot(), files_below(tmp_path)
    message = bake()
    assert all(word in message for word in words), message
    assert snapshot() == before
    assert files_below(tmp_path) == files


def test_what_was_made_for_a_bake_that_fails_is_removed(monkeypatch):
    def refuse(*arguments, **named):
        raise part("engine.errors").SceneError("Refused.")

    mesh_object("New", SQUARE, [(0, 1, 2, 3)])
    mesh_object("Copied", SQUARE, [(0, 1, 2, 3)]).modifiers.new("Array", "ARRAY")
    before = snapshot()
    monkeypatch.setattr(part("operators.bake_run"), "read_scene", refuse)
    assert "Refused" in bake()
    assert snapshot() == before


#: Faults of one object: where there are others, these are baked.
OF_ONE_OBJECT = [
    "no faces",
    "zero area",
    "NaN coordinates",
    "NaN coordinates with UVs",
    "NaN UVs",
    "overlapping UVs",
    "linked without UVs",
]


@pytest.mark.parametrize("case", OF_ONE_OBJECT)
def test_fault_of_one_object_is_told_and_the_others_are_baked(case, tmp_path):
    import bpy

    make, words = {**CASES, "linked without UVs": (linked_square(tmp_path), ["'Far'", "local"])}[case]
    make()
    room = furnace("Good")
    room.location = (5, 5, 5)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert any(all(word in warning for word in words) for warning in report()["warnings"])
    assert pixels(room.hemibake.image)[..., :3].max() == pytest.approx(2, rel=0.01)
    assert report()["objects"] == 1


@pytest.mark.parametrize("case", REPLACED)
def test_fault_of_a_material_lamp_or_world_is_told_and_the_rest_is_baked(case):
    import bpy

    make, words = REPLACED[case]
    make()
    room = furnace("Good")
    room.location = (5, 5, 5)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert sum(all(word in warning for word in words) for warning in report()["warnings"]) == 1
    assert pixels(room.hemibake.image)[..., :3].max() == pytest.approx(2, rel=0.01)
    assert np.isfinite(pixels(room.hemibake.image)).all()


def test_folder_that_cannot_be_written_is_told(tmp_path):
    import bpy

    (tmp_path / "file").write_text("not a folder")
    bpy.context.scene.hemibake.directory = str(tmp_path / "file")
    square("Only", uvs=None)
    before = snapshot()
    assert "Choose another folder" in bake()
    assert snapshot() == before


def linked_square(folder) -> Callable[[], None]:
    """Return a function that links a square without UVs from another file."""

    def make():
        import bpy

        mesh_object("Far", SQUARE, [(0, 1, 2, 3)])
        library = str(folder / "library.blend")
        bpy.ops.wm.save_as_mainfile(filepath=library)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.context.scene.hemibake.resolution, bpy.context.scene.hemibake.hemicube = 32, "16"
        with bpy.data.libraries.load(library, link=True) as (_, linked):
            linked.objects = ["Far"]
        bpy.context.scene.collection.objects.link(linked.objects[0])

    return make


def test_linked_mesh_without_uvs_is_the_reason_told(tmp_path):
    linked_square(tmp_path)()
    message = bake()
    assert "Nothing is left to bake" in message and "on a copy" in message
