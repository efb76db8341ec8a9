"""Presets: detection of the current one, and user presets that are added and removed."""

import os
from pathlib import Path

import pytest

from tests.blender.things import part


@pytest.fixture
def settings():
    """The settings of a scene, and no presets of people's afterwards."""
    import bpy

    group = bpy.context.scene.hemibake
    for name in part("engine.settings").kept_with_scene():
        group.property_unset(name)
    yield group
    for preset in part("operators.presets").presets():
        if not preset.own:
            preset.path.unlink()


def current(settings):
    preset = part("operators.presets").current_preset(settings)
    return preset and preset.name


def apply(name):
    import bpy

    (preset,) = (preset for preset in part("operators.presets").presets() if preset.name == name)
    bpy.ops.script.execute_preset(filepath=str(preset.path), menu_idname="HEMIBAKE_MT_presets")


def add(name):
    import bpy

    return bpy.ops.hemibake.preset_add(name=name)


def test_a_new_scene_is_a_preview(settings):
    assert current(settings) == "Standard" and settings.quality == "preview"


@pytest.mark.parametrize(
    ("name", "quality"), [("Draft", "draft"), ("Standard", "preview"), ("Production", "high")]
)
def test_own_presets_are_applied_and_recognised(settings, name, quality):
    settings.resolution, settings.samples = 97, 5
    assert current(settings) is None
    apply(name)
    assert (current(settings), settings.quality, settings.resolution) == (name, quality, 97)
    settings.max_bounces = 7
    assert current(settings) is None


def test_presets_of_people_keep_every_setting_and_are_removed_again(settings):
    import bpy

    settings.outputs, settings.array_size, settings.samples = {"direct", "combined"}, (97, 193, 5), 12
    settings.tolerance = 0.0123
    assert add("My Rooms: 2") == {"FINISHED"} and current(settings) == "My Rooms: 2"
    apply("Draft")
    settings.outputs, settings.array_size = {"combined"}, (0, 0, 0)
    assert current(settings) == "Draft"
    apply("My Rooms: 2")
    assert current(settings) == "My Rooms: 2"
    assert settings.outputs == {"direct", "combined"} and tuple(settings.array_size) == (97, 193, 5)
    bpy.ops.hemibake.preset_add(name="My Rooms: 2", remove_name=True)
    assert current(settings) is None


def test_names_of_own_presets_are_taken(settings):
    assert add("Draft") == {"CANCELLED"}
    assert [preset.own for preset in part("operators.presets").presets()] == [True] * 3


def test_preset_that_changes_on_disk_is_read_again_and_a_broken_one_is_none(settings):
    settings.max_bounces = 7
    add("Mine")
    (mine,) = (preset.path for preset in part("operators.presets").presets() if not preset.own)
    assert current(settings) == "Mine"
    Path(mine).write_text("settings.max_bounces = 8\n")
    os.utime(mine, (1, 1))
    assert current(settings) is None
    Path(mine).write_text("settings.max_bounces = (\n")
    os.utime(mine, (2, 2))
    assert current(settings) is None


def test_presets_hold_nothing_that_belongs_to_one_scene(settings):
    add("Mine")
    (mine,) = (preset.path for preset in part("operators.presets").presets() if not preset.own)
    text = Path(mine).read_text()
    assert "settings.samples = 256" in text and "settings.size_mode = 'SIZE'" in text
    assert "seed" not in text and "patch_file" not in text
