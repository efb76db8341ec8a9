from dataclasses import asdict, replace

import pytest

from tests.blender.things import part


def read():
    import bpy

    settings = part("operators.bake_settings").read_settings(bpy.context.scene.hemibake)
    return replace(settings, cache_dir=None)


def test_properties_start_with_the_defaults_of_the_engine():
    import bpy

    group = bpy.context.scene.hemibake
    for name in ("resolution", "hemicube"):
        group.property_unset(name)
    for name, value in asdict(part("engine.settings").Settings()).items():
        assert getattr(read(), name) == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [("resolution", 17, 17), ("hemicube", "128", 128), ("tolerance", 0.25, 0.25),
     ("method", "stream", "stream"), ("directions", "hemicube", "hemicube"),
     ("outputs", {"shadow_mask", "direct"}, ("direct", "shadow_mask")), ("patch_groups", "4", 4),
     ("memory_budget", 3, 3 << 20), ("batch_bytes", 1, 1 << 20), ("rotate", False, False),
     ("array_size", (97, 193, 5), (97, 193, 5)), ("patch_file", "", None)],
)  # fmt: skip
def test_properties_become_settings_of_the_engine(name, given, taken):
    import bpy

    setattr(bpy.context.scene.hemibake, name, given)
    assert getattr(read(), name) == taken


def test_every_setting_for_people_is_a_property_with_name_and_tooltip():
    import bpy

    properties = bpy.context.scene.hemibake.bl_rna.properties
    for name, description in part("engine.settings").descriptions().items():
        assert (name in properties) == (description.panel is not None)
        if name in properties:
            assert properties[name].name == description.label
            assert properties[name].description.startswith(description.text)
