"""Enabling and disabling the extension leaves no trace."""

import os
import subprocess
import sys
from pathlib import Path

from tests.blender.things import furnace, part
from tools.headless import disable, enable

ROOT = Path(__file__).parents[2]


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


def test_disabled_with_the_preview_on_it_restores_materials():
    """In all scenes, since nothing could restore them afterwards."""
    import bpy

    obj = furnace()
    bpy.context.scene.hemibake.resolution = 16
    bpy.ops.hemibake.bake()
    before = [slot.material.name for slot in obj.material_slots]
    bpy.ops.hemibake.preview()
    assert [slot.material.name for slot in obj.material_slots] != before
    disable()
    try:
        assert [slot.material.name for slot in bpy.data.objects[obj.name].material_slots] == before
    finally:
        enable()


def test_blender_finds_no_violation_of_its_extension_policy():
    import addon_utils

    assert addon_utils._extensions_warnings_get() == {}


WINDOWED = """
import sys
from types import SimpleNamespace
from tools.headless import blender
with blender():
    import bpy
    from tests.blender.things import SQUARE_UVS, part, report, square
    names = {"moderngl", "glcontext", "pyopencl"}
    print("register", sorted(names & sys.modules.keys()))
    part("operators.worker_manager").bpy = SimpleNamespace(app=SimpleNamespace(background=False))
    square()
    bpy.context.scene.hemibake.resolution = 16
    bpy.context.scene.world = bpy.data.worlds.new("White")
    bpy.ops.hemibake.bake()
    print("bake", report()["patches"] > 0, sorted(names & sys.modules.keys()))
"""


def test_nothing_gpu_is_imported_at_register_nor_by_a_windowed_bake():
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", WINDOWED]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    lines = result.stdout.splitlines()
    assert "register []" in lines and "bake True []" in lines


def test_disabled_it_has_freed_the_devices_of_this_process():
    import bpy

    furnace()
    bpy.ops.hemibake.bake()
    session = part("engine.session")._session
    context = session._devices.graphics.context
    disable()
    try:
        assert session._devices is None and not hasattr(context.mglo, "info")
    finally:
        enable()
