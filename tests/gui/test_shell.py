"""Bakes from a shell by the Blender of the window tests, with the command of the documentation."""

import json


def test_command_bakes_a_file_that_blender_has_opened(window):
    """No window exists then; files are written, and JSON is the last line of the output."""
    scene, out = window.folder / "shell.blend", window.folder / "shell"
    window.run(f"bpy.ops.wm.save_as_mainfile(filepath={str(scene)!r}, copy=True)")
    options = ("--out", str(out), "--resolution", "16", "--json")
    printed = window.command("blender", "-b", str(scene), "-c", "hemibake", *options)
    report = json.loads(printed.splitlines()[-1])
    assert f"{out}/Lightmap.exr" in report["files"] and report["objects"] > 0
