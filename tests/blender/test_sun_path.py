"""Sun paths: maps and light states of several times of a day from one bake."""

import json

import numpy as np
import pytest

from tests.blender.test_world import skies_in_a_group, sky_texture, world
from tests.blender.things import INWARD, bpy_link, material, mesh_object, part, pixels, report, square
from tests.json_schema import faults

TIMES = [f"{hour:02d}:00" for hour in range(8, 17)]


def add_sun(name="Sun", **values):
    """Return a sun light of strength 2 without a disk."""
    import bpy

    sun = bpy_link(bpy.data.objects.new(name, bpy.data.lights.new(name, "SUN")))
    sun.data.energy, sun.data.angle, sun.rotation_euler = 2.0, 0.0, (0.3, 0.2, 0.1)
    for key, value in values.items():
        setattr(sun, key, value)
    return sun


def prepare(times, folder=None, **settings):
    import bpy

    made = bpy.context.scene.hemibake
    made.outputs, made.sun_times, made.resolution = {"combined", "light_groups"}, " ".join(times), 16
    for name, value in settings.items():
        setattr(made, name, value)
    if folder is not None:
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "sun.blend"))
    return made


def state_light(settings, time):
    """Return the light of a state, (h, w, 3): the sum of strength x color x map."""
    import bpy

    mix = part("operators.result.light_states").state_mix(settings.light_states[time])
    total = 0.0
    for group in json.loads(settings.lightmaps["Lightmap"].light_groups):
        color, strength = mix.get(group, ((1, 1, 1), 1))
        image = bpy.data.images[f"Lightmap light group {group}"]
        total = total + pixels(image)[..., :3] * np.array(color) * strength
    return total


def towards(settings, hour):
    """Return the direction to the sun, (3,)."""
    where = settings.sun_latitude, settings.sun_day, settings.sun_north
    return part("engine.scene.sun_path").sun_direction(hour, *where)


def test_a_floor_follows_the_cosine_of_the_sun_in_one_map(tmp_path):
    """E = strength x cos(zenith); at night it is black. Keyframes and rotation of the sun stay."""
    import bpy

    square(surface=material(colour=(0.5, 0.5, 0.5)))
    sun = add_sun()
    sun.keyframe_insert("rotation_euler", frame=1)
    settings = prepare(["5:07", "08:00,09:30", "12:00", "17:15", "23:00"], tmp_path, sun_day=172)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert np.allclose(sun.rotation_euler, (0.3, 0.2, 0.1)) and sun.animation_data.action
    assert settings.light_states.keys() == ["05:07", "08:00", "09:30", "12:00", "17:15", "23:00"]
    assert len(json.loads(settings.lightmaps["Lightmap"].light_groups)) == 1
    for time in [state.name for state in settings.light_states]:
        hour = int(time[:2]) + int(time[3:]) / 60
        wanted = 2 / np.pi * max(0, towards(settings, hour)[2])
        assert state_light(settings, time) == pytest.approx(wanted, rel=2e-3, abs=1e-6)
    combined = pixels(bpy.data.images["Lightmap"])[..., :3]
    hours = (5 + 7 / 60, 8, 9.5, 12, 17.25)
    mean = np.mean([2 / np.pi * towards(settings, hour)[2] for hour in hours])
    assert combined == pytest.approx(mean, rel=2e-3)
    assert any("23:00" in text and "below the horizon" in text for text in report()["warnings"])
    manifest = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    assert faults(manifest) == [] and [*manifest["states"]] == [*settings.light_states.keys()]


def window_room():
    """Return a room with a window to the south, seen from inside."""
    vertices = [(x, y, z) for z in (0, 2.5) for y in (0, 3) for x in (0, 4)]
    walls = [face for face in INWARD if set(face) != {0, 4, 5, 1}]
    mesh_object("Room", vertices, walls, surface=material("Wall", (0.7, 0.6, 0.5)))
    strips = [
        ((0, 0, 0), (4, 0, 1)),
        ((0, 0, 2), (4, 0, 2.5)),
        ((0, 0, 1), (1, 0, 2)),
        ((2.5, 0, 1), (4, 0, 2)),
    ]
    corners, faces = [], []
    for (x0, _, z0), (x1, _, z1) in strips:
        faces.append(tuple(range(len(corners), len(corners) + 4)))
        corners += [(x0, 0, z0), (x0, 0, z1), (x1, 0, z1), (x1, 0, z0)]
    mesh_object("South", corners, faces, surface=material("South", (0.7, 0.7, 0.7)))


def test_a_room_with_a_window_over_nine_hours(tmp_path):
    """Each state is within 1 % of a bake of that hour alone, and the groups add up to the combined map.

    Texel samples and seams are off: they differ by the light of the other hours.
    """
    import bpy
    from mathutils import Vector

    window_room()
    sun = add_sun()
    settings = prepare(
        TIMES, tmp_path, resolution=32, denoise=False, hide_seams=False, adaptive=False, texel_samples="1",
        samples=512, light_samples=1024,
    )  # fmt: skip
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    (reason,) = [text for text in report()["reasons"] if text.startswith("Sun path: 9 positions in")]
    states = {time: state_light(settings, time) for time in TIMES}
    groups = json.loads(settings.lightmaps["Lightmap"].light_groups)
    total = sum(pixels(bpy.data.images[f"Lightmap light group {name}"])[..., :3] for name in groups)
    combined = pixels(bpy.data.images["Lightmap"])[..., :3]
    assert total == pytest.approx(combined, rel=1e-3, abs=1e-5 * float(combined.mean()))
    settings.sun_times, errors = "", []
    for time in TIMES[::4]:
        sun.rotation_euler = Vector(towards(settings, int(time[:2]))).to_track_quat("Z", "Y").to_euler()
        assert bpy.ops.hemibake.bake() == {"FINISHED"}
        alone = pixels(bpy.data.images["Lightmap"])[..., :3]
        errors.append(np.sqrt(np.mean((states[time] - alone) ** 2)) / alone.mean())
    assert max(errors) < 0.01, (errors, reason)


def test_states_of_the_last_path_are_replaced_and_others_stay(tmp_path):
    """Old files of the path are no longer light groups of the manifest; a color of a lamp stays."""
    import bpy

    window_room()
    add_sun()
    lamp = bpy_link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    bpy.context.view_layer.lightgroups.add(name="Lamps")
    lamp.location, lamp.lightgroup = (2, 2, 2), "Lamps"
    settings = prepare(["09:00", "15:00"], tmp_path)
    bpy.ops.hemibake.bake()
    assert json.loads(settings.lightmaps["Lightmap"].light_groups) == ["Lamps", "Sun 09:00", "Sun 15:00"]
    states, mix = part("operators.result.light_states"), {"Lamps": ((1, 0.5, 0.25), 3.0)}
    morning = settings.light_states["09:00"]
    states.set_state_mix(morning, states.state_mix(morning) | mix)
    own = settings.light_states.add()
    own.name = "11:00"
    morning.name = "Morning"
    settings.sun_times = "09:00 11:00 22:00"
    bpy.ops.hemibake.bake()
    assert settings.light_states.keys() == ["11:00", "Morning", "11:00.001", "22:00"]
    assert states.find_state(bpy.context.scene, "09:00").name == "Morning"
    noon = settings.light_states["11:00.001"]
    states.set_state_mix(noon, states.state_mix(noon) | mix)
    bpy.ops.hemibake.bake()
    assert settings.light_states.keys() == ["11:00", "Morning", "11:00.001", "22:00"]
    for name in ("Morning", "11:00.001"):
        assert states.state_mix(settings.light_states[name])["Lamps"] == mix["Lamps"]
    assert not any(states.missing_groups(bpy.context.scene, state) for state in settings.light_states)
    dark = states.state_mix(settings.light_states["22:00"])
    assert {group: strength for group, (_, strength) in dark.items()} == {"Sun 09:00": 0, "Sun 11:00": 0}
    manifest = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    assert faults(manifest) == []
    assert [group["name"] for group in manifest["groups"]] == ["Lamps", "Sun 09:00", "Sun 11:00"]
    settings.sun_times = "15:00"
    bpy.ops.hemibake.bake()
    files = {path.name for path in (tmp_path / "lightmaps").glob("*15_00*")}
    assert files == {"sun_Lightmap light group Sun 15_00.exr"}


@pytest.mark.parametrize("next_times", ["15:00", ""])
def test_maps_of_the_last_path_are_removed_and_images_of_the_user_stay(next_times, tmp_path):
    """The last path's map that something else uses stays in the .blend, too."""
    import bpy

    square()
    sun, maps = add_sun(), []
    settings = prepare(["09:00"], tmp_path)
    for used in (False, True):
        settings.sun_times = "11:00" if used else "09:00"
        bpy.ops.hemibake.bake()
        (name,) = (entry.name for entry in settings.lightmaps if entry.companion_of)
        maps.append(name)
    bpy.data.images[name].use_fake_user = True
    bpy.data.images.new("Lightmap light group Sun 10:00", 4, 4)
    settings.sun_times = next_times
    if not next_times:
        sun.lightgroup = bpy.context.view_layer.lightgroups.add(name="Sun 11:00").name
    bpy.ops.hemibake.bake()
    assert maps == [f"Lightmap light group Sun {time}" for time in ("09:00", "11:00")]
    assert [entry.name for entry in settings.lightmaps if entry.companion_of] == [
        f"Lightmap light group Sun {next_times or '11:00'}"
    ]
    found = {image.name for image in bpy.data.images}
    assert maps[0] not in found and {maps[1], "Lightmap light group Sun 10:00"} <= found


def test_a_folder_changed_during_the_bake_does_not_lose_it(tmp_path):
    """The files are in the folder that was chosen first, with masks of the kept positions only."""
    import bpy

    square()
    add_sun()
    settings = prepare(["09:00", "12:00", "15:00"], tmp_path)
    settings.outputs |= {"shadow_mask"}
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    lightmap = run.run_to_end()
    settings.directory, settings.file_name = "", "{nothing}"
    done = run.finish(lightmap)
    (group,) = json.loads(settings.lightmaps["Lightmap"].light_groups)
    maps = ["Lightmap", f"Lightmap shadow mask {group}", f"Lightmap light group {group}"]
    assert run.failure is None and sorted(done["images"]) == sorted(maps)
    written = {path.name for path in (tmp_path / "lightmaps").glob("*.exr")}
    assert written == {f"sun_{name}.exr".replace(":", "_") for name in maps}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("none", "no sun light for the sun path. Add one"),
        ("two", "several sun lights, 'Sun', 'Moon'. Choose one"),
        ("hidden", "Light 'Sun': no sun light that renders show"),
        ("time", "'25:00' is no time of day"),
        ("some", "a sun path needs new maps of all objects"),
    ],
)
def test_errors_name_the_remedy_and_change_nothing(change, words, monkeypatch):
    """Faults are found before the scene is unwrapped, except a missing sun: the sky may have one."""
    import bpy

    if change != "none":
        monkeypatch.setattr(part("operators.bake_run"), "choose_width", None)

    square()
    sun = add_sun()
    settings = prepare(["12:00"])
    if change == "none":
        bpy.data.objects.remove(sun)
    elif change == "two":
        add_sun("Moon")
    elif change == "hidden":
        settings.sun_light, sun.hide_render = sun, True
        add_sun("Moon")
    elif change == "time":
        settings.sun_times = "25:00"
    else:
        bpy.data.objects["Square"].select_set(True)
        settings.target = "SELECTED"
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.hemibake.bake()
    assert not settings.light_states and not settings.lightmaps


def test_a_path_without_light_groups_is_noted():
    import bpy

    square()
    add_sun()
    prepare(["12:00"]).outputs = {"direct"}
    bpy.ops.hemibake.bake()
    assert any("the output Light Groups is off" in text for text in report()["warnings"])


def test_a_chosen_sun_moves_and_the_other_stays():
    import bpy

    square()
    add_sun(), add_sun("Moon", rotation_euler=(0, 0, 0))
    settings = prepare(["12:00", "01:00"], sun_light=bpy.data.objects["Sun"])
    bpy.ops.hemibake.bake()
    assert state_light(settings, "01:00") == pytest.approx(2 / np.pi, rel=1e-3)
    high = 2 / np.pi * (1 + towards(settings, 12)[2])
    assert state_light(settings, "12:00") == pytest.approx(high, rel=2e-3)


def test_the_sun_of_a_sky_texture_moves_and_the_sky_stays(monkeypatch):
    """Its strength is that of the bake without a path; states differ by the cosine of its zenith."""
    import bpy

    elevation = np.radians(50)
    panorama = part("operators.scene.light.refined_panorama")
    monkeypatch.setattr(panorama, "_ROWS", (16, 32))
    monkeypatch.setattr(panorama, "_TILE", 8)
    square()
    tree, background = world()
    sky = sky_texture(tree, 50, 20, 0.5)
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    settings = prepare([], samples=64)
    bpy.ops.hemibake.bake()
    whole = pixels(bpy.data.images["Lightmap"])[..., :3].mean(axis=(0, 1))
    settings.sun_times = "10:00 12:00 00:00"
    bpy.ops.hemibake.bake()
    assert set(json.loads(settings.lightmaps["Lightmap"].light_groups)) == {"Ungrouped", "Sun 10:00"}
    night, ten, noon = (state_light(settings, time).mean(axis=(0, 1)) for time in ("00:00", "10:00", "12:00"))
    sun = (whole - night) / np.sin(elevation)
    assert (night > 0.01 * whole).all()
    assert noon - night == pytest.approx(sun * towards(settings, 12)[2], rel=0.01)
    assert ten - night == pytest.approx(sun * towards(settings, 10)[2], rel=0.01)
    assert any("the sky stay the same along the sun path" in text for text in report()["warnings"])


@pytest.mark.parametrize("apart", [60, 0.3])
def test_the_sun_of_a_sky_texture_must_be_the_only_one(apart, monkeypatch):
    """Discs that overlap are not converted to lights, and count all the same."""
    import bpy

    panorama = part("operators.scene.light.refined_panorama")
    monkeypatch.setattr(panorama, "_ROWS", (16, 32))
    monkeypatch.setattr(panorama, "_TILE", 8)
    square()
    tree, background = world()
    skies_in_a_group(tree, background, (50, 20, 0.5), (50, 20 + apart, 0.5))
    prepare(["12:00"])
    with pytest.raises(RuntimeError, match="several sun discs, .* Turn off Sun Disc in all but one"):
        bpy.ops.hemibake.bake()


def test_a_path_below_the_horizon_leaves_the_other_light():
    import bpy

    square()
    add_sun()
    settings = prepare(["00:00"])
    bpy.ops.hemibake.bake()
    assert settings.light_states.keys() == ["00:00"] and not state_light(settings, "00:00").any()


def test_the_command_line_sets_the_path(tmp_path):
    """And writes the state of a time that the bake makes as plain lightmaps."""
    import bpy

    square()
    add_sun(), add_sun("Moon")
    options, command = (part(f"operators.command_line.{name}") for name in ("options", "command"))
    words = ["--out", str(tmp_path), "--resolution", "16", "--sun-path", "8:00", "9:30", "--state", "9:30"]
    parser = options.parser("bake", "")
    parsed = options.parse(
        parser, [*words, "--sun-light", "Moon", "--sun-latitude", "-35.5", "--sun-day", "9"]
    )
    settings = bpy.context.scene.hemibake
    settings.outputs = {"direct"}
    parsed.scene = None
    command.prepare(parsed)
    assert (settings.sun_times, settings.sun_light.name) == ("08:00 09:30", "Moon")
    assert (settings.sun_latitude, settings.sun_day) == (-35.5, 9)
    assert {"combined", "light_groups"} <= settings.outputs
    bpy.ops.hemibake.bake()
    done = command.write_states(parsed, {"files": [], "warnings": []})
    (path,) = done["files"]
    assert path.endswith("state 09_30.exr")
    image = bpy.data.images.load(path)
    wanted = state_light(settings, "09:30")
    assert pixels(image)[..., :3] == pytest.approx(wanted, rel=1e-4)
    parsed.sun_light = "Sunny"
    with pytest.raises(options.CommandError, match="'Sunny'; choose one of the sun lights: 'Sun', 'Moon'"):
        command.prepare(parsed)
    parsed.sun_light, parsed.sun_times = None, ["noon"]
    with pytest.raises(options.CommandError, match="'noon' is no time of day"):
        command.prepare(parsed)
    parsed.sun_times, parsed.collection = ["9:30"], "Squares"
    squares = bpy.data.collections.new("Squares")
    bpy.context.scene.collection.children.link(squares)
    squares.objects.link(bpy.data.objects["Square"])
    with pytest.raises(options.CommandError, match="Leave out --collection"):
        command.prepare(parsed)
