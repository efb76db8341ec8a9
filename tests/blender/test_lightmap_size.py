"""Width of lightmaps: automatic, fixed, and by texels per metre."""

import numpy as np
import pytest

from tests.blender.test_panels import draw
from tests.blender.things import furnace, loop_uvs, part, read_scene, report, square


@pytest.fixture
def settings():
    import bpy

    settings = bpy.context.scene.hemibake
    settings.size_mode, settings.quality = "DENSITY", "draft"
    return settings


def bake():
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    return {image.name: image.size[0] for image in bpy.data.images if image.get("hemibake_atlas")}


def density(obj, width):
    """Return the texels per metre of an object of 6 square metres, whose quads keep their corners."""
    uvs = loop_uvs(obj).reshape(-1, 4, 2).astype(float) * width
    x, y = np.moveaxis(uvs, 2, 0)
    area = np.abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2).sum()
    return np.sqrt(area / len(uvs))


@pytest.mark.parametrize("wanted", [7.0, 23.0])
def test_new_charts_get_at_least_the_density(settings, wanted):
    settings.texels_per_metre = wanted
    room = furnace()
    (width,) = bake().values()
    assert wanted <= density(room, width) < 2 * wanted and width % 16 == 0


def set_units(system, scale):
    """Set the unit system and the metres a unit of length."""
    import bpy

    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, scale


@pytest.mark.parametrize(
    ("system", "scale", "metres"), [("METRIC", 0.01, 0.01), ("IMPERIAL", 0.25, 0.25), ("NONE", 0.001, 1.0)]
)
def test_densities_are_in_metres_whatever_the_unit(settings, system, scale, metres):
    settings.texels_per_metre = 11.0
    set_units(system, scale)
    room = furnace()
    room.scale = [2 / metres] * 3
    (width,) = bake().values()
    assert 11 <= density(room, width) / 2 < 22


@pytest.mark.parametrize(
    ("system", "scale", "units"), [("METRIC", 0.001, 700.0), ("IMPERIAL", 2.0, 0.35), ("NONE", 0.1, 0.7)]
)
def test_lengths_reach_the_engine_in_units_of_the_scene(settings, system, scale, units):
    settings.ao_distance = 0.7
    set_units(system, scale)
    assert part("operators.bake_settings").read_settings(settings).ao_distance == pytest.approx(units)
    square()
    assert read_scene().scene.metres_per_unit == pytest.approx(1.0 if system == "NONE" else scale)


def test_charts_that_are_there_decide(settings):
    settings.texels_per_metre = 50.0
    square(uvs=[(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)])
    assert bake() == {"Lightmap": 208}


def test_the_atlas_that_needs_most_decides(settings):
    settings.texels_per_metre = 50.0
    square("One", uvs=[(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)])
    square("Two", uvs=[(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)]).hemibake.atlas = "Other"
    assert bake() == {"Lightmap": 208, "Other": 208}


def test_objects_placed_side_by_side_get_it_too(settings):
    import bpy

    settings.texels_per_metre = 30.0
    objects = [square(f"Square {number}") for number in range(5)]
    for number, obj in enumerate(objects):
        obj.location.x = 2 * number
    bpy.context.view_layer.update()
    (width,) = bake().values()
    for obj in objects:
        assert 0.8 * width * obj.hemibake.uv_scale >= 30


def test_too_dense_lightmaps_are_refused_with_the_limit(settings):
    settings.texels_per_metre = 1e5
    furnace()
    with pytest.raises(RuntimeError, match=r"100000 texels per meter need .* Max Width is 4,096"):
        bake()


def test_panel_shows_what_it_comes_to(settings):
    square(uvs=[(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)])
    settings.texels_per_metre = 50.0
    shown = draw("HEMIBAKE_PT_bake")
    assert "208 texels" in shown and "texels_per_metre" in shown and "resolution" not in shown


def test_selected_objects_keep_the_width_of_their_lightmap(settings):
    settings.texels_per_metre = 50.0
    one = square("One", uvs=[(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)])
    two = square("Two", uvs=[(0.5, 0), (0.75, 0), (0.75, 0.25), (0.5, 0.25)])
    two.location.x = 2
    bake()
    settings.target = "SELECTED"
    one.select_set(True)
    assert bake() == {"Lightmap": 208} and report()["objects"] == 1


def test_command_line_chooses_a_size_or_a_density(settings):
    import argparse
    from pathlib import Path

    command = part("operators.command_line.command")
    command.apply_settings(argparse.Namespace(out=Path("/tmp"), resolution=64))
    assert (settings.size_mode, settings.resolution) == ("SIZE", 64)
    command.apply_settings(argparse.Namespace(out=Path("/tmp"), texels_per_metre=3.5))
    assert (settings.size_mode, settings.texels_per_metre) == ("DENSITY", 3.5)


def test_command_line_takes_all_that_new_lightmap_uvs_heed(settings):
    words = [
        "--out",
        "/tmp",
        "--largest-width",
        "333",
        "--lightmap-count",
        "3",
        "--padding",
        "5",
        "--mip-level",
        "1",
    ]
    options = part("operators.command_line.options")
    part("operators.command_line.command").apply_settings(
        options.parse(options.parser("hemibake", ""), words)
    )
    assert (settings.largest_width, settings.lightmap_count) == (333, 3)
    assert (settings.padding, settings.mip_level) == (5, 1)


def test_objects_that_need_more_than_the_largest_lightmap_get_several(settings):
    settings.texels_per_metre, settings.largest_width = 18.0, 64
    rooms = [furnace(f"Room {number}") for number in range(5)]
    for number, room in enumerate(rooms):
        room.location.x = 3 * number
    images = bake()
    assert len(images) > 1 and set(images.values()) == {64}
    for room in rooms:
        assert density(room, 64) >= 18


@pytest.fixture
def automatic(settings):
    settings.size_mode = "AUTOMATIC"
    return settings


def scaled(obj, factor):
    """Scale an object in place."""
    import bpy

    obj.scale = [factor] * 3
    bpy.context.view_layer.update()
    return obj


def needed(surface, covered, lightmaps=1, metres=1.0):
    density = part("operators.scene.density")
    return density.needed_width([density.ChartArea(surface, covered)], metres, lightmaps)


def test_automatic_is_the_default_and_a_width_that_is_set_is_fixed():
    import bpy

    scene = bpy.data.scenes.new("Other")
    assert scene.hemibake.size_mode == "AUTOMATIC"
    scene.hemibake.resolution = 77
    assert scene.hemibake.size_mode == "SIZE"


def test_texels_suit_the_size_of_the_scene():
    for surface, low, high in ((150, 0.02, 0.04), (1500, 0.03, 0.1), (30_000, 0.05, 0.3)):
        texel = np.sqrt(surface / 0.6) / needed(surface, 0.6)
        assert low < texel < high
    # Unpacked charts count as 60 % of each lightmap; a unit of a centimetre changes nothing.
    assert needed(900.0, 0.0, 4) == pytest.approx(needed(900.0, 0.6) / 2)
    assert needed(900e4, 0.3, metres=0.01) == pytest.approx(needed(900.0, 0.3))
    assert part("operators.scene.density").needed_width([], 1.0, 1) == 0


def test_the_first_bake_chooses_a_width_and_shows_the_size_of_a_texel(automatic):
    scaled(furnace(), 0.3)
    assert "Chosen at the first bake" in draw("HEMIBAKE_PT_bake")
    assert bake() == {"Lightmap": 128} and automatic.automatic_width == 128
    (shown,) = [text for text in draw("HEMIBAKE_PT_bake") if text.startswith("128, ")]
    assert shown.endswith((" mm/texel", " cm/texel")) and 0.0005 < automatic.lightmap_side / 128 < 0.02
    automatic.size_mode = "SIZE"
    fixed = draw("HEMIBAKE_PT_bake")
    (texel,) = fixed[fixed.index("Texel Size") + 1 :][:1]
    assert texel.endswith((" mm", " cm")) and "Width" not in fixed


def test_a_width_is_kept_until_the_need_has_doubled(automatic):
    import bpy

    room = scaled(furnace(), 0.1)
    assert bake() == {"Lightmap": 64}
    assert bake() == {"Lightmap": 64} and "raised" not in str(report()["warnings"])
    scaled(room, 0.15)
    assert bake() == {"Lightmap": 64}
    scaled(room, 0.8)
    automatic.target = "SELECTED"
    room.select_set(True)
    assert bake() == {"Lightmap": 64}
    automatic.target = "ALL"
    assert bake() == {"Lightmap": 256}
    assert any("raised from 64 to 256 texels" in warning for warning in report()["warnings"])
    scaled(room, 0.1)
    assert bake() == {"Lightmap": 256}
    assert bpy.ops.hemibake.choose_resolution() == {"FINISHED"} and automatic.automatic_width < 256


def test_parts_of_a_scene_get_the_width_of_the_whole(automatic):
    small, large = scaled(furnace("Small"), 0.1), scaled(furnace("Large"), 0.6)
    small.hemibake.atlas, large.location.x = "Other", 5
    automatic.target = "SELECTED"
    small.select_set(True)
    assert bake() == {"Other": 128}


def test_unwrap_chooses_a_width_and_its_failure_does_not(automatic):
    import bpy

    assert "CANCELLED" in bpy.ops.hemibake.unwrap() and automatic.automatic_width == 0
    scaled(furnace(), 0.1)
    assert bpy.ops.hemibake.unwrap() == {"FINISHED"} and automatic.automatic_width == 64


def test_check_and_cancelled_bakes_store_no_width(automatic):
    import bpy

    scaled(furnace(), 0.1)
    assert bpy.ops.hemibake.check() == {"FINISHED"} and automatic.automatic_width == 0
    run = part("operators.bake_run").BakeRun(bpy.context, lambda *_: iter(()), watched=False)
    while automatic.lightmap_side == 0:
        run.step()
    assert automatic.automatic_width == 64
    run.cancel()
    assert automatic.automatic_width == 0 and automatic.lightmap_side == 0


def test_memory_of_the_device_limits_the_width_with_a_note(automatic, monkeypatch):
    found = part("engine.device.device_info")
    device = found.DeviceInfo("OpenCL", "Small", memory=1 << 28, use="baking")
    monkeypatch.setattr(part("operators.devices").finder, "found", found.DeviceSurvey((device,)))
    size = part("operators.lightmap_size")
    areas = [part("operators.scene.density").ChartArea(1e6, 0.0)]
    width, notes, _ = size._automatic_choice(areas, automatic)
    assert width == 512 and "512 instead of 4,096 texels" in notes[0] and "0.2 GiB" in notes[0]
    monkeypatch.setattr(part("operators.devices").finder, "found", None)
    assert size._automatic_choice(areas, automatic)[:2] == (4096, ())


def test_small_models_of_many_triangles_get_texels_for_each():
    density = part("operators.scene.density")

    def width(surface, count):
        return density.needed_width([density.ChartArea(surface, 0.6, count)], 1.0, 1)

    assert width(0.9, 12) == width(0.9, 0) < 128
    assert width(0.9, 5003) == pytest.approx(np.sqrt(16 * 5003 / 0.6))
    assert width(0.9, 10**7) == 512 and width(900.0, 10**7) == width(900.0, 0) > 512


def test_a_first_width_that_new_charts_do_not_fill_is_raised_without_a_note(automatic):
    size = part("operators.lightmap_size")
    automatic.automatic_width = 64
    areas = [part("operators.scene.density").ChartArea(150.0, 0.6)]
    rollback = part("operators.rollback").Rollback()
    first = size._grown(areas, automatic, size.SizeChoice(64, is_new=True), rollback)
    assert (first.width, first.notes) == (512, ())
    automatic.automatic_width = 64
    later = size._grown(areas, automatic, size.SizeChoice(64), rollback)
    assert later.width == 512 and "raised from 64 to 512 texels" in later.notes[0]


def test_unwrap_of_check_stores_the_width(automatic):
    import bpy

    scaled(furnace(), 0.1)
    bpy.ops.hemibake.check()
    assert bpy.ops.hemibake.fix(fix="unwrap", names='["Furnace"]') == {"FINISHED"}
    assert automatic.automatic_width == 64
