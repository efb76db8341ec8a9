"""Light groups of the view layer become maps, and the preview mixes them without a bake."""

import json

import numpy as np
import pytest

from tests.blender.test_preview_render import Nodes, render, shown_square, stage
from tests.blender.things import bpy_link, part, pixels, report, snapshot
from tests.json_schema import faults
from tests.rows import long

__all__ = ["stage"]


@pytest.fixture
def lit(stage):
    """Return a scene with a sun, a lamp and a glowing floor in groups; the sky is in none."""
    import bpy

    layer = bpy.context.view_layer
    for name in ("Day", "Night", "Nobody"):
        layer.lightgroups.add(name=name)
    lamp = bpy_link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    lamp.data.energy, lamp.data.shadow_soft_size, lamp.location = 20, 0.0, (0.3, 0.4, 1.1)
    lamp.data.color = (1.0, 0.5, 0.2)
    bpy.data.objects["Sun"].lightgroup, lamp.lightgroup = "Day", "Night"
    bpy.data.objects["Floor"].lightgroup = "Night"
    nodes = Nodes("Card")
    shown_square(nodes.done(nodes.principled(Base_Color=(0.7, 0.6, 0.5, 1))))
    stage.hemibake.outputs = {"combined", "light_groups"}
    return stage


def group_nodes(scene) -> dict:
    """Return the mixer's node with the colour and strength of each group, by group."""
    mixer = part("operators.result.light_mixer")
    return {name: holders for name, *holders in mixer.mixed_groups(scene.hemibake.light_mixer)}


def test_groups_of_the_view_layer_become_images_and_files(lit, tmp_path):
    import bpy

    lit.world.lightgroup = "Day"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "groups.blend"))
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    names = ["Lightmap", *(f"Lightmap light group {name}" for name in ("Day", "Night", "Nobody"))]
    assert report()["images"] == names
    combined, *groups = (pixels(bpy.data.images[name])[..., :3].astype(np.float64) for name in names)
    assert np.abs(sum(groups) - combined).max() <= 1e-5 * combined.mean()
    assert groups[0].any() and groups[1].any() and not groups[2].any()
    manifest = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    assert faults(manifest) == []
    assert [group["name"] for group in manifest["groups"]] == ["Day", "Night", "Nobody"]
    entries = manifest["lightmaps"]
    assert {entry["output"] for entry in entries.values()} == {
        "combined", "light_group Day", "light_group Night", "light_group Nobody"
    }  # fmt: skip
    assert all((tmp_path / "lightmaps" / name).exists() for name in entries)


@pytest.mark.parametrize("what", ["lamp", "group", long("world"), long("object")])
def test_light_that_changes_its_group_is_baked_again(lit, what):
    """The card faces its light, because a light that reaches no texel may change its group without effect."""
    import bpy

    if what == "object":
        bpy.data.objects["Shown"].rotation_euler.x = np.pi
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    lit.hemibake.target = "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()
    if what == "group":
        layer = bpy.context.view_layer
        layer.lightgroups["Nobody"].name = "Anybody"
    else:
        objects = bpy.data.objects
        {"world": lit.world, "lamp": objects["Lamp"], "object": objects["Floor"]}[what].lightgroup = "Day"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def test_the_mixer_shows_changed_lamps_at_once(lit, tmp_path):
    """The mixed preview equals a render by Cycles and a new bake."""
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    sun, lamp, sky = bpy.data.objects["Sun"], bpy.data.objects["Lamp"], lit.world
    sun.data.energy *= 0.25
    lamp.data.color = (0.3, 1.0, 0.6)
    changed = render(lit, tmp_path, 64)
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    sun.hide_render = lamp.hide_render = True
    lit.world = None
    first = render(lit, tmp_path, 16)
    mixed = group_nodes(lit)
    assert list(mixed) == ["Day", "Night", "Nobody", "Ungrouped"]
    mixed["Day"][1].default_value = 0.25
    mixed["Night"][0].default_value = (0.3, 2.0, 3.0, 1.0)
    shown = render(lit, tmp_path, 16)

    # The floor is in the lamp's group, too, but meets nothing but the card's back.
    assert off(first, changed) > 0.2 and off(shown, changed) < 0.03
    sun.hide_render = lamp.hide_render = False
    lit.world = sky
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    mixed["Day"][1].default_value = 1.0
    mixed["Night"][0].default_value = (1.0, 1.0, 1.0, 1.0)
    sun.hide_render = lamp.hide_render = True
    lit.world = None
    assert off(render(lit, tmp_path, 16), shown) < 0.03


def off(first, second) -> float:
    """Return the RMS difference of two pictures, relative to the mean of the second."""
    return float(np.sqrt(((first - second) ** 2).mean()) / second.mean())


def test_the_mixer_takes_keyframes(lit, tmp_path):
    import bpy

    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    strength = group_nodes(lit)["Day"][1]
    for frame, value in ((1, 1.0), (11, 0.0)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    bpy.data.objects["Sun"].hide_render = bpy.data.objects["Lamp"].hide_render = True
    lit.world = None
    pictures = []
    for frame in (1, 6, 11):
        lit.frame_set(frame)
        pictures.append(render(lit, tmp_path, 4).mean())
    assert pictures[0] > 1.1 * pictures[1] > 1.1 * pictures[2]


def test_values_of_the_mixer_outlive_preview_bake_and_other_groups(lit):
    import bpy

    bpy.ops.hemibake.bake()
    before = snapshot()["materials"]
    bpy.ops.hemibake.preview()
    tree = lit.hemibake.light_mixer
    group_nodes(lit)["Night"][1].default_value = 3.0
    bpy.ops.hemibake.preview()
    assert snapshot()["materials"] == before and lit.hemibake.light_mixer == tree
    bpy.context.view_layer.lightgroups.add(name="Dawn")
    bpy.data.objects["Sun"].lightgroup = "Dawn"
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    assert list(group_nodes(lit)) == ["Day", "Night", "Nobody", "Dawn", "Ungrouped"]
    assert lit.hemibake.light_mixer == tree and group_nodes(lit)["Night"][1].default_value == 3.0


def test_a_renamed_group_keeps_its_values_and_their_animation(lit):
    """Another group is new at the same time, and one that is gone leaves its values to nobody."""
    import bpy

    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    mixed = group_nodes(lit)
    mixed["Day"][0].default_value = (0.5, 0.25, 2.0, 1.0)
    mixed["Night"][1].default_value = mixed["Nobody"][1].default_value = 3.0
    for frame, value in ((1, 1.0), (11, 0.0)):
        mixed["Day"][1].default_value = value
        mixed["Day"][1].keyframe_insert("default_value", frame=frame)
    groups = bpy.context.view_layer.lightgroups
    bpy.context.view_layer.active_lightgroup_index = groups.find("Nobody")
    bpy.ops.scene.view_layer_remove_lightgroup()
    groups["Day"].name = "Dusk"
    groups.add(name="Dawn")
    bpy.ops.hemibake.bake()
    mixed = group_nodes(lit)
    assert list(mixed) == ["Dusk", "Night", "Dawn", "Ungrouped"]
    assert tuple(mixed["Dusk"][0].default_value) == (0.5, 0.25, 2.0, 1.0)
    lit.frame_set(6)
    assert 0.4 < mixed["Dusk"][1].default_value < 0.6
    assert mixed["Night"][1].default_value == 3.0 and mixed["Dawn"][1].default_value == 1.0
    groups["Night"].name = "Evening"
    bpy.data.objects["Lamp"].lightgroup = "Dusk"
    bpy.ops.hemibake.bake()
    assert group_nodes(lit)["Evening"][1].default_value == 1.0


@pytest.mark.parametrize("what", ["renamed", "added", "none"])
def test_an_open_preview_mixes_the_groups_of_the_next_bake(lit, what):
    import bpy

    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    group_nodes(lit)["Night"][1].default_value = 3.0
    layer = bpy.context.view_layer
    if what == "renamed":
        layer.lightgroups["Day"].name = "Dusk"
    elif what == "added":
        layer.lightgroups.add(name="Dawn")
    else:
        lit.hemibake.outputs = {"combined"}
    bpy.ops.hemibake.bake()
    groups = {
        "renamed": ["Night", "Nobody", "Dusk", "Ungrouped"],
        "added": ["Day", "Night", "Nobody", "Dawn", "Ungrouped"],
        "none": [],
    }[what]
    (preview,) = [item for item in bpy.data.materials if item.name == "Card (lightmap)"]
    shown = preview.node_tree.nodes
    images = {node.image.name for node in shown if node.type == "TEX_IMAGE"}
    assert images == ({f"Lightmap light group {name}" for name in groups} or {"Lightmap"})
    if groups:
        assert set(group_nodes(lit)) == set(groups)
        assert group_nodes(lit)["Night"][1].default_value == 3.0


def test_without_maps_of_groups_the_preview_shows_all_light(lit):
    import bpy

    bpy.ops.hemibake.bake()
    lit.hemibake.outputs = {"combined"}
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    assert lit.hemibake.light_mixer is None


def test_groups_without_all_light_are_refused(lit):
    import bpy

    lit.hemibake.outputs = {"light_groups"}
    with pytest.raises(RuntimeError, match="Add combined"):
        bpy.ops.hemibake.bake()
