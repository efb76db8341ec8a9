"""Light states: named mixes of light groups in the preview, in files and in the manifest."""

import json
from argparse import Namespace

import numpy as np
import pytest

from tests.blender.gltf_file import GltfFile
from tests.blender.test_light_groups import group_nodes, lit
from tests.blender.test_preview_render import stage
from tests.blender.things import part, pixels
from tests.json_schema import faults

__all__ = ["lit", "stage"]

GROUPS = ("Day", "Night", "Nobody")


@pytest.fixture
def baked(lit, tmp_path):
    """Return a saved and baked scene whose sky is in no group, at 16 x 16 texels."""
    import bpy

    lit.hemibake.resolution = 16
    lit.world.lightgroup = "Day"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "street.blend"))
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    return lit


def add_state(scene, name, **mix):
    """Add a state with a color and a strength for each group."""
    state = scene.hemibake.light_states.add()
    state.name = name
    part("operators.result.light_states").set_state_mix(state, mix)
    return state


def shown_mix(scene) -> dict:
    return {
        name: (tuple(color.default_value)[:3], strength.default_value)
        for name, (color, strength) in group_nodes(scene).items()
    }


def manifest(tmp_path) -> dict:
    made = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    assert faults(made) == []
    return made


def test_a_stored_mix_is_applied_again(baked):
    """Groups that a state leaves out are white with strength 1."""
    import bpy

    settings = baked.hemibake
    assert bpy.ops.hemibake.light_state_add(name="All") == {"FINISHED"}
    assert bpy.ops.hemibake.light_state_apply() == {"FINISHED"}
    group_nodes(baked)["Night"][0].default_value = (0.25, 0.5, 2.0, 1.0)
    group_nodes(baked)["Night"][1].default_value = 3.0
    assert bpy.ops.hemibake.light_state_add(name="Lamp") == {"FINISHED"}
    assert [*settings.light_states.keys()] == ["All", "Lamp"] and settings.active_light_state == 1
    stored = shown_mix(baked)
    bpy.ops.hemibake.light_state_apply(name="All")
    assert set(shown_mix(baked).values()) == {((1.0, 1.0, 1.0), 1.0)}
    bpy.ops.hemibake.light_state_apply(name="Lamp")
    assert shown_mix(baked) == stored and stored["Night"] == ((0.25, 0.5, 2.0), 3.0)
    add_state(baked, "Dark", Day=((0, 0, 0), 1.0))
    bpy.ops.hemibake.light_state_apply(name="Dark")
    assert shown_mix(baked)["Day"][0] == (0, 0, 0) and shown_mix(baked)["Night"] == ((1, 1, 1), 1)
    settings.active_light_state = 0
    assert bpy.ops.hemibake.light_state_store() == {"FINISHED"}
    assert tuple(settings.light_states["All"].groups["Day"].color) == (0, 0, 0)
    assert bpy.ops.hemibake.light_state_remove() == {"FINISHED"}
    assert [*settings.light_states.keys()] == ["Lamp", "Dark"] and settings.active_light_state == 0


def test_names_of_states_stay_unique(baked):
    import bpy

    for _ in range(2):
        bpy.ops.hemibake.light_state_add(name="Night")
    first, second = baked.hemibake.light_states
    assert (first.name, second.name) == ("Night", "Night.001")
    second.name = "Day"
    second.name = "Night"
    assert second.name == "Night.001"


def test_a_fade_ends_exactly_at_the_state():
    faded = part("operators.light_states").faded
    before, after = {"Day": ((1.0, 0.5, 0.1), 3.0)}, {"Day": ((0.0, 0.5, 0.7), 0.3)}
    assert faded(before, after, 0.0) == before and faded(before, after, 1.0) == after
    color, strength = faded(before, after, 0.25)["Day"]
    assert color == pytest.approx((0.75, 0.5, 0.25)) and strength == pytest.approx(2.325)


def test_all_light_is_the_sum_of_the_groups_and_a_state_is_one_plain_lightmap(baked, tmp_path):
    """Before any encoding, and in files: read back from OpenEXR."""
    import bpy

    mixed = part("operators.result.light_states").mixed_light
    maps = {name: pixels(bpy.data.images[f"Lightmap light group {name}"])[..., :3] for name in GROUPS}
    combined = pixels(bpy.data.images["Lightmap"])[..., :3]
    assert np.abs(mixed(maps, {}) - combined).max() <= 1e-5 * combined.mean()
    add_state(baked, "Blue", Day=((0.5, 0.5, 1.0), 0.5), Night=((0, 0, 0), 1.0))
    assert bpy.ops.hemibake.light_state_write(name="Blue") == {"FINISHED"}
    made = manifest(tmp_path)
    assert made["states"] == {"Blue": {"Day": [0.25, 0.25, 0.5], "Night": [0, 0, 0]}}
    (file,) = [name for name, entry in made["lightmaps"].items() if entry["output"] == "state Blue"]
    assert [entry["maps"]["state Blue"] for entry in made["objects"]] == [file] * len(made["objects"])
    image = bpy.data.images.load(str(tmp_path / "lightmaps" / file))
    wanted = maps["Day"] * (0.25, 0.25, 0.5) + maps["Nobody"]
    assert np.abs(pixels(image)[..., :3] - wanted).max() <= 1e-5 * wanted.max()


def test_states_are_written_in_the_format_of_the_bake_and_replaced(baked, tmp_path):
    import bpy

    baked.hemibake.file_format = "rgbm"
    state = add_state(baked, "Bright", Day=((1, 1, 1), 2.0))
    for strength in (2.0, 4.0):
        state.groups["Day"].strength = strength
        bpy.ops.hemibake.light_state_write(name="Bright")
    entries = [
        entry for entry in manifest(tmp_path)["lightmaps"].values() if entry["output"] == "state Bright"
    ]
    assert sorted(entry["format"] for entry in entries) == ["exr", "rgbm"]
    assert manifest(tmp_path)["states"]["Bright"]["Day"] == [4, 4, 4]


def test_states_of_another_scene_keep_their_files(baked, tmp_path):
    """Both scenes of the .blend have a state Bright in the folder; files of a deleted scene are replaced."""
    import bpy

    other = bpy.data.scenes.new("Other")
    state = add_state(baked, "Bright", Day=((1, 1, 1), 2.0))
    write = part("operators.result.state_files").write_state
    (first,) = write(baked, state)
    place = tmp_path / "lightmaps" / "hemibake.json"
    listed = json.loads(place.read_text())
    assert listed["lightmaps"][first.name]["scene"] == baked.name
    listed["lightmaps"][first.name]["scene"] = other.name
    place.write_text(json.dumps(listed))
    (second,) = write(baked, state)
    assert second != first and first.exists()
    assert {manifest(tmp_path)["lightmaps"][path.name]["scene"] for path in (first, second)} == {
        baked.name, other.name,
    }  # fmt: skip
    bpy.data.scenes.remove(other)
    assert write(baked, state) == [first]


def test_a_scene_without_states_keeps_those_of_another_scene(baked, tmp_path):
    """A scene that wrote all files in the folder removes its states."""
    import bpy

    other = bpy.data.scenes.new("Other")

    def written(states, scene, blend="../street.blend"):
        place = part("operators.result.destination").Destination(folder, (), "", blend, (), scene.name)
        part("operators.result.images").write_all([], place, states)
        return manifest(tmp_path).get("states")

    folder, states = tmp_path / "lightmaps", {"Bright": {"Day": [2.0, 2.0, 2.0]}}
    assert written(states, baked) == states == written({}, other)
    assert written({}, baked, "../another.blend") == states
    assert written({"Dim": {}}, other) == {"Dim": {}}
    assert written({}, baked) is None


def test_a_missing_group_is_named_and_the_rest_displayed(baked, tmp_path):
    import bpy

    add_state(baked, "Evening", Nowhere=((1, 0, 0), 1.0), Day=((0.5, 0.5, 0.5), 1.0))
    with pytest.raises(RuntimeError, match="State 'Evening': the last bake has no light group 'Nowhere'"):
        bpy.ops.hemibake.light_state_apply(name="Evening")
    assert shown_mix(baked)["Day"][0] == (0.5, 0.5, 0.5)
    assert bpy.ops.hemibake.light_state_write(name="Evening") == {"FINISHED"}
    assert "Nowhere" in manifest(tmp_path)["states"]["Evening"]
    with pytest.raises(RuntimeError, match="no light state 'Noon'. Choose one of: 'Evening'"):
        bpy.ops.hemibake.light_state_apply(name="Noon")


def test_states_follow_renamed_groups(baked):
    """As the mixer does; groups of other states stay."""
    import bpy

    bpy.ops.hemibake.preview()
    add_state(baked, "Noon", Day=((1, 1, 0.5), 2.0), Night=((0, 0, 0), 1.0))
    bpy.context.view_layer.lightgroups["Day"].name = "Sun"
    bpy.ops.hemibake.bake()
    assert [*baked.hemibake.light_states["Noon"].groups.keys()] == ["Sun", "Night"]


def test_the_command_line_writes_states(baked, tmp_path):
    command, options = part("operators.command_line.command"), part("operators.command_line.options")
    parsed = options.parse(options.parser("bake", ""), ["--out", "x", "--state", "A", "--state", "B"])
    assert parsed.states == ["A", "B"]
    add_state(baked, "A", Day=((1, 1, 1), 0.5), Nowhere=((1, 1, 1), 1.0))
    report = command.write_states(Namespace(states=["A"]), {"files": ["old.exr"], "warnings": []})
    assert len(report["files"]) == 2 and report["files"][1].endswith("state A.exr")
    assert "'Nowhere'" in report["warnings"][0]
    with pytest.raises(options.CommandError, match="no light state 'B'"):
        command._check_states(["B"])
    baked.hemibake.outputs = {"combined"}
    with pytest.raises(options.CommandError, match="Add light_groups to --outputs"):
        command._check_states(["A"])


def test_a_state_without_maps_of_groups_is_refused(lit, tmp_path):
    import bpy

    add_state(lit, "Night", Night=((1, 1, 1), 1.0))
    write = part("operators.result.state_files").write_state
    with pytest.raises(part("engine.errors").EngineError, match="no maps of light groups"):
        write(lit, lit.hemibake.light_states["Night"])
    assert not bpy.ops.hemibake.light_state_apply.poll()


@pytest.mark.parametrize(("kind", "ending"), [("HDR", ".glb"), ("PNG", ".gltf"), ("NONE", ".glb")])
def test_an_export_carries_groups_and_states(baked, tmp_path, kind, ending):
    """As maps in the file, and as files with a manifest; the maps of the groups sum to that of all light."""
    import bpy

    add_state(baked, "Night", Day=((0, 0, 0), 1.0))
    folder = tmp_path / "web"
    folder.mkdir()
    path = folder / f"street{ending}"
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=kind) == {"FINISHED"}
    listed = [{"name": name, "output": f"light_group {name}"} for name in GROUPS]
    made = json.loads((folder / "hemibake.json").read_text())
    assert faults(made) == [] and made["groups"] == listed and made["states"] == {"Night": {"Day": [0, 0, 0]}}
    assert {"combined", *(group["output"] for group in listed)} <= {*made["objects"][0]["maps"]}
    file = GltfFile(path)
    assert file.json["asset"]["extras"]["hemibake"] == {
        "version": 2, "groups": listed, "states": {"Night": {"Day": [0, 0, 0]}}
    }  # fmt: skip
    extensions = [known.get("extensions", {}) for known in file.json["materials"]]
    lightmaps = [known["MOZ_lightmap"] for known in extensions if "MOZ_lightmap" in known]
    assert len(lightmaps) == (0 if kind == "NONE" else 2)
    for lightmap in lightmaps:
        maps = lightmap["extras"]["hemibake"]["groups"]
        assert [*maps] == [*GROUPS]
        textures = [file.json["textures"][known["index"]]["name"] for known in maps.values()]
        assert textures == [f"Lightmap light group {name}" for name in GROUPS]
    if kind == "PNG":
        assert all((folder / f"street.Lightmap light group {name}.png").is_file() for name in GROUPS)


def test_extras_of_an_export_without_light_groups_tell_of_files_beside_it(stage, tmp_path):
    import bpy

    stage.hemibake.resolution = 16
    bpy.ops.hemibake.bake()
    for name, use_files in (("beside", True), ("inside", False)):
        path = tmp_path / f"{name}.glb"
        bpy.ops.hemibake.export_for_engine(filepath=str(path), use_files=use_files)
        extras = GltfFile(path).json["asset"].get("extras")
        assert extras == ({"hemibake": {"version": 2}} if use_files else None)
    assert "states" not in json.loads((tmp_path / "hemibake.json").read_text())
