"""Panels drawn on a layout that records their content."""

import json
import time
from importlib.util import find_spec

import pytest

from tests.blender.things import furnace, part, square
from tools.headless import MODULE


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
        return self._part()

    def prop_search(self, owner, name, collection, items, **options):
        assert items in collection.bl_rna.properties
        self.prop(owner, name)

    def template_list(self, kind, number, owner, items, active_owner, active, **options):
        import bpy

        panel_list = getattr(bpy.types, kind)
        assert active in active_owner.bl_rna.properties
        for item in getattr(owner, items):
            panel_list.draw_item(None, bpy.context, self, owner, item, 0, active_owner, active)

    def menu(self, name, **options):
        import bpy

        assert hasattr(bpy.types, name)
        self.shown.append(options.get("text", name))

    def template_node_view(self, tree, node, socket):
        assert socket in node.inputs.values()
        self.shown.append(f"{tree.name} of {tree.id_data.name}")

    def separator(self):
        pass

    def label(self, text="", icon="NONE"):
        import bpy

        assert icon in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items
        self.shown.append(text)

    def progress(self, **options):
        self.shown.append(options["text"])


def draw(name):
    """Draw a panel and return what it shows; None if it does not want to be shown."""
    import bpy

    panel = next(cls for cls in part("panels").CLASSES if cls.__name__ == name)
    if hasattr(panel, "poll") and not panel.poll(bpy.context):
        return None
    shown = []
    known = {"layout": Layout(shown), "bl_rna": panel.bl_rna, "_names": getattr(panel, "_names", ())}
    holder = type("Holder", (), known)()
    if hasattr(panel, "draw_header"):
        panel.draw_header(holder, bpy.context)
    panel.draw(holder, bpy.context)
    return shown


def test_panels_show_every_setting_once(devices):
    import bpy

    panels = (
        "bake",
        "outputs",
        "light_probes",
        "reflection_cubes",
        "advanced",
        "light",
        "texels",
        "uvs",
        "charts",
        "probe_files",
        "memory",
        "paper",
    )
    shown = [text for name in panels for text in draw(f"HEMIBAKE_PT_{name}")]
    shown += draw("HEMIBAKE_AP_preferences")
    groups = (bpy.context.scene.hemibake, part("operators.preferences").machine_properties())
    settings = [name for name in shown if any(name in group.bl_rna.properties for group in groups)]
    people = {name for name, known in part("engine.settings").descriptions().items() if known.panel}
    hidden = {"ao_samples", "ao_distance", "outputs"}
    hidden |= set() if find_spec("distributed") else {"scheduler"}
    own = {
        "uv_layer",
        "directory",
        "quality",
        "target",
        "meshes",
        "show_when_done",
        "size_mode",
        "lightmap_count",
        "padding",
        "mip_level",
        "file_name",
        "file_format",
        "exr_depth",
        "exr_codec",
    }
    own |= set(part("operators.chart_settings").CHART_PROPERTIES)
    own |= {
        f"makes_{item.identifier}"
        for item in bpy.context.scene.hemibake.bl_rna.properties["outputs"].enum_items
    }
    assert set(settings) == (people | own) - hidden
    assert len(settings) == len(set(settings))


@pytest.fixture
def devices(monkeypatch):
    """The devices of a machine that this is not."""
    found = part("engine.device.device_info")
    survey = found.DeviceSurvey(
        (
            found.DeviceInfo("OpenGL", "Card A", "4.6", use="drawing hemicubes"),
            found.DeviceInfo("OpenCL", "CUDA: Card A", "580.1", 3 << 30, "casting rays and summing light"),
            found.DeviceInfo("OpenCL", "Portable Computing Language: cpu", "PoCL 3.0", issue="no target"),
        ),
        ("There is a long sentence about what is missing here, and what to install. " * 3,),
    )
    monkeypatch.setattr(part("operators.devices").finder, "found", survey)


def preferences():
    return draw("HEMIBAKE_AP_preferences")


def test_preferences_show_devices_and_what_is_missing(devices):
    shown = preferences()
    assert {"OpenGL: Card A", "OpenCL: CUDA: Card A", "3.0 GiB, used for casting rays and summing light",
            "Driver 580.1", "not used, no target"} <= set(shown)  # fmt: skip
    assert all(len(text) < 200 for text in shown) and sum("sentence" in text for text in shown) > 1
    assert {"hemibake.find_devices", "hemibake.self_test", "hemibake.clear_cache", "wm.path_open"} <= set(
        shown
    )


def test_preferences_show_where_files_are(devices):
    files = part("operators.user_files")
    cache, log = files.cache_folder(), files.log_file()
    files.clear_cache()
    shown = preferences()
    (cache / "folder").mkdir(exist_ok=True)
    (cache / "folder" / "kernel").write_bytes(bytes(3 << 20))
    assert f"Cache: 0.0 MiB in {cache}" in shown and f"Log: {log}" in shown
    assert f"Cache: 3.0 MiB in {cache}" in preferences()
    files.clear_cache()
    assert f"Cache: 0.0 MiB in {cache}" in preferences() and not any(cache.iterdir())


def test_preferences_look_for_devices_by_themselves_without_waiting(monkeypatch):
    import bpy

    finder, steps = part("operators.devices").finder, []
    monkeypatch.setattr(finder, "found", None)
    monkeypatch.setattr(bpy.app.timers, "register", lambda step, **options: steps.append(step))
    try:
        assert "Searching for devices …" in preferences() and "Searching for devices …" in preferences()
        (step,) = steps
        while step() is not None:
            time.sleep(0.02)
        assert any(text.startswith("OpenGL: ") for text in preferences())
    finally:
        monkeypatch.setattr(bpy.app.timers, "unregister", lambda step: None)
        finder.stop()


@pytest.mark.parametrize("right", [True, False])
def test_preferences_show_what_the_last_test_told(devices, monkeypatch, right):
    last = part("operators.self_test").last_test
    monkeypatch.setattr(last, "right", right)
    monkeypatch.setattr(last, "text", "First.\nSecond.")
    shown = preferences()
    assert shown.index("First.") + 1 == shown.index("Second.")


def in_menu(menu):
    """Return the entries that Hemibake adds to a menu of Blender."""
    import bpy

    drawn = getattr(bpy.types, menu).draw._draw_funcs
    (entry,) = [function for function in drawn if function.__module__.startswith(MODULE)]
    shown = []
    entry(type("Menu", (), {"layout": Layout(shown)}), bpy.context)
    return shown


def test_every_operator_that_needs_no_argument_is_in_a_menu_for_the_search():
    import bpy

    assert in_menu("TOPBAR_MT_help") == ["hemibake.self_test"]
    assert in_menu("VIEW3D_MT_object") == ["HEMIBAKE_MT_lightmaps"]
    assert in_menu("TOPBAR_MT_file_export")[0] == "hemibake.export_for_engine"
    shown = {*draw("HEMIBAKE_MT_lightmaps"), "hemibake.self_test"}
    operators = {f"hemibake.{name}" for name in dir(bpy.ops.hemibake)}
    internal = {name for name in operators if "INTERNAL" in getattr(rna(name), "bl_options", ())}
    assert operators - internal == shown


def rna(operator):
    """Return the class of an operator."""
    import bpy

    kind = operator.replace(".", "_OT_").replace("hemibake", "HEMIBAKE")
    return bpy.types.Operator.bl_rna_get_subclass_py(kind)


def test_tooltips_read_as_those_of_blender():
    import bpy

    groups = [bpy.context.scene.hemibake, square().hemibake]
    texts = [prop.description for group in groups for prop in group.bl_rna.properties if not prop.is_hidden]
    texts += [rna(f"hemibake.{name}").bl_rna.description for name in dir(bpy.ops.hemibake)]
    assert len(texts) > 40
    for text in texts:
        assert text == text.strip() and not text.endswith(".") and (not text or text[0].isupper()), text


def test_ambient_occlusion_shows_its_settings():
    import bpy

    bpy.context.scene.hemibake.outputs = {"combined", "ambient_occlusion"}
    assert {"ao_samples", "ao_distance"} <= set(draw("HEMIBAKE_PT_outputs"))


@pytest.mark.parametrize(
    ("before", "switch", "after"),
    [
        ({"combined"}, "indirect", {"combined", "indirect"}),
        ({"combined", "direct"}, "combined", {"direct"}),
        ({"direct"}, "direct", {"direct"}),
        ({"direct"}, "light_groups", {"combined", "direct", "light_groups"}),
        ({"combined", "light_groups", "directional", "direct"}, "combined", {"direct"}),
        ({"combined", "light_groups"}, "combined", {"combined", "light_groups"}),
        (
            {"combined", "directional", "dominant_direction"},
            "spherical_harmonics",
            {"combined", "spherical_harmonics"},
        ),
        ({"combined", "spherical_harmonics"}, "directional", {"combined", "directional"}),
    ],
)
def test_an_output_is_switched_by_itself_with_what_it_needs(before, switch, after):
    import bpy

    settings = bpy.context.scene.hemibake
    settings.outputs = before
    name = f"makes_{switch}"
    setattr(settings, name, not getattr(settings, name))
    assert settings.outputs == after
    assert all(getattr(settings, f"makes_{output}") == (output in after) for output in (*before, *after))
    part("engine.settings").check_settings(part("operators.bake_settings").read_settings(settings))


@pytest.mark.parametrize("role", ["BAKED", "NO_LIGHTMAP", "IGNORED"])
def test_active_object_shows_its_role_and_where_it_was_baked(role):
    import bpy

    obj = furnace()
    bpy.context.view_layer.objects.active = obj
    obj.hemibake.role = role
    obj.hemibake.image = bpy.data.images.new("Map", 4, 4)
    shown = draw("HEMIBAKE_PT_object")
    assert ("atlas" in shown) == (role == "BAKED") and "Baked into 'Map'" in shown


def test_no_active_object_and_no_report_show_no_panel():
    assert draw("HEMIBAKE_PT_object") is None and draw("HEMIBAKE_PT_last_bake") is None


REPORT = {
    "objects": 3, "patches": 1021, "iterations": 1, "convergence_error": None, "seconds": {"total": 1.25},
    "images": ["Lightmap"], "warnings": ["A first sentence about much. " * 9 + "\nAll.", "Second."],
    "objects_of_warnings": [["Square", "Gone"], []], "fixes_of_warnings": ["", ""],
}  # fmt: skip


def test_last_bake_is_summed_up_and_has_each_warning_whole_with_what_it_is_about():
    import bpy

    square()
    bpy.context.scene.hemibake.report = json.dumps(REPORT)
    shown = draw("HEMIBAKE_PT_last_bake")
    assert shown[0] == "3 objects, 1,021 texels, 1 bounce, 1.2 s"
    words = " ".join(shown).split()
    assert words.count("about") == 9 and "All." in words and "Second." in words
    assert max(map(len, shown)) < 150
    assert shown.count("hemibake.select_objects") == 1 and shown[-1] == "hemibake.copy_report"


ENERGY = {"emitted": 12.341, "absorbed": 11.98, "escaped": 0.34, "not_bounced": 0.011, "missing": 0.00081}


def test_where_the_light_went_is_told_if_it_is_known():
    import bpy

    for energy, line in (
        (
            ENERGY,
            "Light: 12.3 W emitted, 97.1% absorbed, 2.8% left the scene, 0.1% not bounced "
            "yet (balance error 0.08%)",
        ),
        (
            {**ENERGY, "not_bounced": -1e-5},
            "Light: 12.3 W emitted, 97.1% absorbed, 2.8% left the scene, 0.0% not bounced "
            "yet (balance error 0.08%)",
        ),
        (None, ""),
        ({**dict.fromkeys(ENERGY, 0.0)}, ""),
        ({**ENERGY, "emitted": None}, ""),
    ):
        bpy.context.scene.hemibake.report = json.dumps({**REPORT, "energy": energy})
        shown = " ".join(draw("HEMIBAKE_PT_last_bake"))
        assert line in shown and ("emitted" in shown) == bool(line)


def test_energy_of_a_furnace_is_absorbed():
    furnace()
    import bpy

    bpy.ops.hemibake.bake()
    energy = json.loads(bpy.context.scene.hemibake.report)["energy"]
    assert energy["absorbed"] == pytest.approx(energy["emitted"], rel=2e-3) and energy["emitted"] > 0


def test_failure_is_shown_until_the_next_bake():
    import bpy

    with pytest.raises(RuntimeError):
        bpy.ops.hemibake.bake()
    shown = " ".join(draw("HEMIBAKE_PT_last_bake"))
    assert "no mesh with faces" in shown and shown.endswith("hemibake.copy_report")
    furnace()
    bpy.ops.hemibake.bake()
    assert "no mesh with faces" not in " ".join(draw("HEMIBAKE_PT_last_bake"))


def wrapped(text, width):
    shown = []
    part("panels.wrapped_text").draw_text(Layout(shown), text, width)
    return shown


def test_text_is_wrapped_between_words_by_their_width():
    text = "Illicit lightmaps in Wimbledon: " + "x" * 200 + " and more"
    narrow, wide = wrapped(text, 90), wrapped(text, 190)
    assert " ".join(narrow) == " ".join(wide) == text and len(narrow) > len(wide) > 2
    assert wrapped("mmm mmm", 60) == ["mmm mmm"] or len(wrapped("mmm mmm", 60)) > len(wrapped("iii iii", 60))
    assert wrapped("One.\nTwo.", 500) == ["One.", "Two."]
    beside_icon = []
    part("panels.wrapped_text").draw_text(Layout(beside_icon), text, 190, "INFO")
    assert len(beside_icon) > len(wide)


def test_preset_is_custom_once_a_value_differs():
    import bpy

    settings = bpy.context.scene.hemibake
    settings.quality, settings.denoise = "draft", True
    settings.tolerance, settings.texel_samples = 0.01, "1"
    assert draw("HEMIBAKE_PT_bake")[0] == "Draft"
    settings.max_bounces = 3
    assert draw("HEMIBAKE_PT_bake")[0] == "Custom"


def test_light_groups_are_assigned_and_mixed_in_their_panel():
    import bpy

    assert draw("HEMIBAKE_PT_light_groups") is None
    scene = bpy.context.scene
    scene.hemibake.outputs = {"combined", "light_groups"}
    bpy.context.view_layer.lightgroups.add(name="Day")
    bpy.context.view_layer.objects.active = square()
    scene.world = bpy.data.worlds.new("Sky")
    shown = draw("HEMIBAKE_PT_light_groups")
    assert shown.count("name") == 1 and shown.count("lightgroup") == 1 and "Mixer" not in shown
    assert "lightgroup" in draw("HEMIBAKE_PT_object")
    assert any("Choose a group" in text for text in shown)
    assert "makes a light state of the sun" in " ".join(shown)
    part("operators.result.light_mixer").light_mixer(scene, ["Day", "Ungrouped"])
    scene.hemibake.lightmaps.add().light_groups = '["Day", "Ungrouped"]'
    scene.world, scene.hemibake.outputs = None, {"combined"}
    shown = draw("HEMIBAKE_PT_light_groups")
    assert "lightgroup" not in draw("HEMIBAKE_PT_object")
    assert shown.count("lightgroup") == 0 and shown.count("default_value") == 4
    mixer = ["Mixer", "Day", "default_value", "default_value", "Ungrouped", *["default_value"] * 2]
    hint = shown.index("Show Lightmaps to see the mix")
    assert shown[hint - 7 : hint] == mixer
    buttons = ["Light States", "hemibake.light_state_add", "hemibake.light_state_remove"]
    assert shown[hint + 1 : hint + 4] == buttons
    assert "named mix of the groups" in " ".join(shown[hint + 4 :])
    bpy.ops.hemibake.light_state_add(name="Night")
    scene.hemibake.light_states[0].groups["Day"].name = "Dawn"
    shown = draw("HEMIBAKE_PT_light_groups")
    assert shown.count("light_fade") == 1 and {"hemibake.light_state_apply", "Dawn"} <= {*shown}
    assert "No maps of Dawn: bake the group or store again" in " ".join(shown)
    scene.hemibake.sun_times = "8:00"
    shown = draw("HEMIBAKE_PT_light_groups")
    assert "sun_latitude" in shown and "makes a light state of the sun" not in " ".join(shown)
    scene.hemibake.lightmaps[0].light_groups = "[]"
    assert draw("HEMIBAKE_PT_light_groups") is None


def test_maps_beside_lightmaps_are_no_lightmaps_in_the_list():
    import bpy

    furnace()
    scene = bpy.context.scene
    scene.hemibake.outputs = {"combined", "direct", "directional"}
    bpy.ops.hemibake.bake()
    entries = {entry.name: entry.companion_of for entry in scene.hemibake.lightmaps}
    assert entries.pop("Lightmap") == "" and len(entries) == 5 and set(entries.values()) == {"Lightmap"}
    holder = type("Holder", (), {"bitflag_filter_item": 1 << 30, "filter_name": ""})()
    flags, order = bpy.types.HEMIBAKE_UL_lightmaps.filter_items(
        holder, bpy.context, scene.hemibake, "lightmaps"
    )
    assert flags == [1 << 30] + [0] * 5 and order == []
    assert "with 5 maps of other outputs" in " ".join(draw("HEMIBAKE_PT_lightmaps"))
    known = part("operators.properties")._known_atlases
    assert known(bpy.context.active_object, bpy.context, "") == ["Lightmap"]


def test_original_material_is_offered_while_the_lightmap_is_shown():
    import bpy

    room = furnace()
    bpy.context.view_layer.objects.active = room
    assert draw("HEMIBAKE_PT_original_material") is None and draw("HEMIBAKE_PT_material_tab") is None
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    shown, tab = draw("HEMIBAKE_PT_original_material"), draw("HEMIBAKE_PT_material_tab")
    assert shown[0] == "name" and len(shown) == 2 and "lightmap" not in shown[1]
    assert "copy" in tab[0] and tab[1:-1] == shown and tab[-1] == "hemibake.preview"
    room.data.materials.append(None)
    room.active_material_index = 1
    assert draw("HEMIBAKE_PT_original_material") == ["active_material_index", "No material"]


def test_tooltips_of_controls_have_at_most_110_characters():
    import bpy

    groups = [
        bpy.context.scene.hemibake,
        square().hemibake,
        part("operators.preferences").machine_properties(),
    ]
    shown = [prop for group in groups if group for prop in group.bl_rna.properties if not prop.is_hidden]
    texts = [prop.description for prop in shown]
    texts += [item.description for prop in shown if prop.type == "ENUM" for item in prop.enum_items]
    texts += [rna(f"hemibake.{name}").bl_rna.description for name in dir(bpy.ops.hemibake)]
    assert [text for text in texts if len(text) > 110] == []


def test_a_missing_denoiser_is_told_in_the_preferences_alone(devices, monkeypatch):
    for module in ("panels.bake", "panels.preferences"):
        monkeypatch.setattr(part(module), "denoise_library", lambda: None)
    assert not any("Open Image Denoise" in text for text in draw("HEMIBAKE_PT_bake"))
    assert any("Open Image Denoise" in text for text in preferences())
