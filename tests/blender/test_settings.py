from dataclasses import asdict, replace

import pytest

from tests.blender.things import furnace, part


def read():
    import bpy

    settings = part("operators.bake_settings").read_settings(bpy.context.scene.hemibake)
    return replace(settings, cache_dir=None, denoise_library=None)


def unset_all():
    import bpy

    group = bpy.context.scene.hemibake
    for name in part("engine.settings").kept_with_scene():
        group.property_unset(name)
    return group


def test_properties_start_with_the_defaults_of_the_engine_but_the_quality_of_a_preview():
    group, quality = unset_all(), part("engine.quality").QUALITIES["preview"]
    assert group.quality == "preview"
    for name, value in {**asdict(part("engine.settings").Settings()), **quality.values}.items():
        assert getattr(read(), name) == (pytest.approx(value) if isinstance(value, float) else value)


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [("resolution", 17, 17), ("hemicube", "128", 128), ("tolerance", 0.25, 0.25),
     ("method", "stream", "stream"), ("directions", "hemicube", "hemicube"),
     ("outputs", {"shadow_mask", "direct"}, ("direct", "shadow_mask")), ("patch_groups", "4", 4),
     ("rotate", False, False),
     ("array_size", (97, 193, 5), (97, 193, 5)), ("patch_file", "", None)],
)  # fmt: skip
def test_properties_become_settings_of_the_engine(name, given, taken):
    import bpy

    setattr(bpy.context.scene.hemibake, name, given)
    assert getattr(read(), name) == taken


@pytest.fixture
def preferences():
    """The add-on's preferences, with their defaults again at the end."""
    group = part("operators.preferences").machine_properties()
    yield group
    for name in MACHINE:
        group.property_unset(name)


MACHINE = {
    "memory_budget",
    "batch_bytes",
    "opencl_device",
    "denoise_device",
    "scheduler",
    "cache_budget",
    "checkpoint_space",
    "checkpoint_interval",
}


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [("memory_budget", 3, 3 << 20), ("batch_bytes", 1, 1 << 20), ("denoise_device", "cuda", "cuda"),
     ("opencl_device", "CUDA: Card B", "CUDA: Card B"), ("opencl_device", "", None)],
)  # fmt: skip
def test_preferences_become_settings_of_every_scene(preferences, name, given, taken):
    setattr(preferences, name, given)
    assert getattr(read(), name) == getattr(part("operators.bake_settings").machine_defaults(), name) == taken


def test_scene_holds_nothing_of_the_machine_and_the_preferences_nothing_of_the_scene(preferences):
    import bpy

    scene = set(bpy.context.scene.hemibake.bl_rna.properties.keys())
    machine = set(preferences.bl_rna.properties.keys())
    people = {name for name, known in part("engine.settings").descriptions().items() if known.panel}
    assert machine & people == MACHINE and scene & people == people - MACHINE


def test_chosen_device_that_is_not_there_is_told_by_the_bake(preferences):
    import bpy

    furnace()
    preferences.opencl_device = "CUDA: Card C"
    with pytest.raises(RuntimeError, match="There is no OpenCL device 'CUDA: Card C'. Choose one of '"):
        bpy.ops.hemibake.bake()


@pytest.mark.parametrize(
    ("scheduler", "refused"),
    [
        ("tcp://farm:8786", True),
        ("tls://10.0.0.7:8786", True),
        ("all", False),
        ("tcp://localhost:8786", False),
    ],
)
def test_a_scheduler_on_the_network_needs_online_access(preferences, scheduler, refused):
    """Blender's preferences give it, to all extensions at once."""
    import bpy

    preferences.scheduler = scheduler
    system = bpy.context.preferences.system
    system.use_online_access = False
    if refused:
        with pytest.raises(part("engine.errors").SettingsError, match=f"'{scheduler}'.*--online-mode"):
            read()
    else:
        assert read().scheduler == scheduler
    system.use_online_access = True
    try:
        assert read().scheduler == scheduler
    finally:
        system.use_online_access = False


def test_every_setting_for_people_is_a_property_with_name_and_tooltip():
    import bpy

    groups = (bpy.context.scene.hemibake, part("operators.preferences").machine_properties())
    properties = {name: known for group in groups for name, known in group.bl_rna.properties.items()}
    for name, description in part("engine.settings").descriptions().items():
        assert (name in properties) == (description.panel is not None)
        if name in properties:
            assert properties[name].name.removesuffix(" (MiB)").removesuffix(" (m)") == description.label
            assert properties[name].description.startswith(description.text)


@pytest.mark.parametrize("name", ["draft", "preview", "high", "very_high"])
def test_quality_stands_for_settings(name):
    import bpy

    group, values = bpy.context.scene.hemibake, part("engine.quality").QUALITIES[name].values
    group.quality = name
    assert {key: getattr(read(), key) for key in values} == values and group.quality == name


def test_quality_is_custom_once_a_setting_of_it_differs():
    import bpy

    group = bpy.context.scene.hemibake
    group.quality = "draft"
    with pytest.raises(TypeError):
        group.quality = "custom"
    group.light_samples += 1
    assert group.quality == "custom"
    group.quality = "custom"
    assert (group.samples, group.light_samples) == (64, 33)


def test_rays_follow_a_hemicube_that_is_chosen():
    import bpy

    group = bpy.context.scene.hemibake
    group.quality = "draft"
    group.hemicube = "64"
    assert read().samples == 0


def test_high_quality_is_what_the_engine_does_by_itself():
    settings = part("engine.settings").Settings()
    assert part("engine.quality").quality_of(asdict(settings)) == "high"


def test_command_line_takes_a_quality_and_settings_of_it_that_differ(tmp_path):
    options, command = part("operators.command_line.options"), part("operators.command_line.command")
    words = ["--out", str(tmp_path), "--light-samples", "5", "--quality", "very_high", "--samples", "12"]
    command.apply_settings(options.parse(options.parser("bake", "Bakes."), words))
    settings = read()
    assert (settings.hemicube, settings.samples, settings.light_samples) == (64, 12, 5)
    with pytest.raises(options.CommandError, match="invalid choice: 'best'"):
        options.parse(options.parser("bake", "Bakes."), ["--out", "x", "--quality", "best"])
