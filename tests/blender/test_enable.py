"""The extension comes and goes without a trace."""

from tools.headless import disable, enable


def registered() -> set[str]:
    import bpy

    names = {name for name in dir(bpy.types) if name.startswith(("HEMIBAKE_", "Hemibake"))}
    kinds = (bpy.types.Scene, bpy.types.Object)
    names |= {f"{kind.__name__}.hemibake" for kind in kinds if hasattr(kind, "hemibake")}
    return names | ({"operators"} if dir(bpy.ops.hemibake) else set())


def test_enabled_it_brings_operators_panels_and_properties():
    import bpy

    names = registered()
    assert {"HEMIBAKE_OT_bake", "HEMIBAKE_PT_bake", "Scene.hemibake", "Object.hemibake"} <= names
    assert {"bake", "unwrap", "preview"} <= set(dir(bpy.ops.hemibake))


def test_disabled_it_leaves_nothing_and_can_be_enabled_again():
    before = registered()
    disable()
    try:
        assert registered() == set()
    finally:
        enable()
    assert registered() == before


def test_blender_finds_no_violation_of_its_extension_policy():
    import addon_utils

    assert addon_utils._extensions_warnings_get() == {}


def test_hemicube_sizes_are_those_of_the_engine():
    import bpy

    from engine.settings import HEMICUBES

    items = bpy.context.scene.hemibake.bl_rna.properties["hemicube"].enum_items
    assert tuple(int(item.identifier) for item in items) == HEMICUBES
