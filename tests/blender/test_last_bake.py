"""Last Bake: objects of warnings, and the report in the clipboard."""

import json

import pytest

from tests.blender.things import furnace, mesh_object, part, report, square


def select(*names):
    import bpy

    return bpy.ops.hemibake.select_objects(names=json.dumps(names))


def selected():
    import bpy

    return sorted(obj.name for obj in bpy.context.selected_objects)


def test_report_tells_which_objects_each_warning_is_about():
    square()
    wires = [mesh_object(f"Wire {number}", [(0, 0, 0), (1, 0, 0)], []).name for number in range(7)]
    part("operators.bake")
    import bpy

    bpy.ops.hemibake.bake()
    facts = dict(zip(report()["warnings"], report()["objects_of_warnings"], strict=True))
    about = {text.partition(":")[0].split(" ")[0]: names for text, names in facts.items()}
    assert about["Objects"] == wires
    assert [names for text, names in facts.items() if "not saved" in text] == [[]]


def test_objects_are_selected_and_all_others_are_not():
    import bpy

    first, second, third = square("A"), square("B"), square("C")
    first.select_set(True)
    bpy.context.view_layer.objects.active = first
    assert select("B", "Gone", "C") == {"FINISHED"}
    assert selected() == ["B", "C"] and bpy.context.object == second and third.select_get()


def test_hidden_objects_are_told_and_the_selection_stays():
    first, second = square("A"), square("B")
    first.select_set(True)
    second.hide_set(True)
    with pytest.raises(RuntimeError, match="hidden or deleted"):
        select("B", "Gone")
    assert selected() == ["A"]


def test_nothing_is_selected_in_edit_mode():
    import bpy

    bpy.context.view_layer.objects.active = square("A")
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.hemibake.select_objects.poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.hemibake.select_objects.poll()


def copied():
    """Return the operator's text for the clipboard, which Blender does not have without a window."""
    import bpy

    assert bpy.ops.hemibake.copy_report() == {"FINISHED"}
    return part("operators.last_bake")._whole_text(bpy.context.scene)


@pytest.mark.parametrize(
    ("objects", "instances", "told"),
    [
        (0, 0, "0 objects, "),
        (0, 1, "1 instance, "),
        (1, 17, "1 object, 17 instances, "),
        (3, 0, "3 objects, "),
    ],
)
def test_summary_counts_what_got_light(objects, instances, told):
    facts = {"patches": 1021, "iterations": 1, "convergence_error": None, "seconds": {"total": 1.25}}
    summary = part("operators.last_bake").summary
    assert summary({"objects": objects, "instances": instances, **facts}) == (
        f"{told}1,021 texels, 1 bounce, 1.2 s"
    )


def test_copied_report_has_summary_warnings_and_figures():
    import bpy

    assert not bpy.ops.hemibake.copy_report.poll()
    furnace()
    mesh_object("Wire", [(0, 0, 0), (1, 0, 0)], [])
    bpy.ops.hemibake.bake()
    text = copied()
    head, figures = text.split("{\n", 1)
    assert bpy.app.version_string in head and "Baked 1 object, " in head and "'Wire'" in head
    facts = json.loads("{" + figures)
    assert facts["devices"] == report()["devices"] and facts["seconds"]["total"] > 0


def test_copied_report_has_the_failure():
    import bpy

    with pytest.raises(RuntimeError):
        bpy.ops.hemibake.bake()
    assert "failed: The scene has no mesh with faces" in copied()
