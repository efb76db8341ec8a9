"""Panels are drawn on a layout that writes down what it is asked to show."""

import json

import pytest

from tests.blender.things import furnace, part


class Layout:
    """Takes the calls of `bpy.types.UILayout`; a property, operator or icon that is not there fails."""

    def __init__(self, shown):
        self.shown = shown

    def _part(self, **options):
        return Layout(self.shown)

    row = column = box = split = _part

    def prop(self, owner, name, **options):
        assert name in owner.bl_rna.properties, name
        self.shown.append(name)

    def operator(self, name, **options):
        import bpy

        group, operator = name.split(".")
        assert operator in dir(getattr(bpy.ops, group))
        self.shown.append(name)
        return Layout(self.shown)

    def label(self, text="", icon="NONE"):
        import bpy

        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self.shown.append(text)

    def progress(self, **options):
        self.shown.append(options["text"])


def draw(name):
    """Draw a panel and return what it shows; None if it does not want to be shown."""
    import bpy

    panel = getattr(part("panels.bake"), name)
    if hasattr(panel, "poll") and not panel.poll(bpy.context):
        return None
    shown = []
    holder = type("Holder", (), {"layout": Layout(shown), "bl_rna": panel.bl_rna})()
    panel.draw(holder, bpy.context)
    return shown


def test_panels_show_every_setting_once():
    shown = [*draw("HEMIBAKE_PT_bake"), *draw("HEMIBAKE_PT_outputs"), *draw("HEMIBAKE_PT_advanced")]
    settings = [name for name in shown if not name.startswith("hemibake.")]
    people = {name for name, known in part("engine.settings").descriptions().items() if known.panel}
    hidden = {"ao_samples", "ao_distance"}
    assert set(settings) == (people | {"uv_layer", "directory"}) - hidden
    assert len(settings) == len(set(settings))


def test_ambient_occlusion_shows_its_settings():
    import bpy

    bpy.context.scene.hemibake.outputs = {"combined", "ambient_occlusion"}
    assert {"ao_samples", "ao_distance"} <= set(draw("HEMIBAKE_PT_outputs"))


@pytest.mark.parametrize("role", ["BAKED", "OCCLUDER", "IGNORED"])
def test_active_object_shows_its_role_and_where_it_was_baked(role):
    import bpy

    obj = furnace()
    bpy.context.view_layer.objects.active = obj
    obj.hemibake.role = role
    obj.hemibake.image = bpy.data.images.new("Map", 4, 4)
    shown = draw("HEMIBAKE_PT_object")
    assert ("atlas" in shown) == (role == "BAKED") and "Baked into 'Map'" in shown


def test_no_active_object_and_no_report_show_no_panel():
    assert draw("HEMIBAKE_PT_object") is None and draw("HEMIBAKE_PT_report") is None


def test_report_is_shown_with_the_first_line_of_each_warning():
    import bpy

    report = {
        "objects": 3, "patches": 1021, "iterations": 7,
        "visibility": "rays", "method": "cached", "samples": 2048,
        "residual": None, "seconds": {"total": 1.25}, "images": ["Lightmap"], "warnings": ["First.\nSecond."],
    }  # fmt: skip
    bpy.context.scene.hemibake.report = json.dumps(report)
    shown = draw("HEMIBAKE_PT_report")
    assert "3 objects, 1021 patches" in shown and "Lightmap" in shown and "First." in shown
