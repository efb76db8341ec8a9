"""Bakes from a shell: tools/bake.py, and the command that the add-on brings."""

import importlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import weakref
from pathlib import Path

import pytest

from tests.blender.gltf_file import GltfFile
from tests.blender.things import SQUARE_UVS, furnace, part, pixels, square
from tools.headless import ROOT, disable, enable

#: A closed tent: two triangles are enough for a wavefront file that is lit by the world.
OBJ = """o Roof
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
f 1 2 3 4
"""


def command(*arguments, folder=None) -> subprocess.CompletedProcess:
    words = [sys.executable, str(ROOT / "tools" / "bake.py"), *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=folder)


@pytest.fixture
def signals_as_before():
    """A command leaves signals ignored, since its process ends."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.one_version
def test_json_is_the_last_line_even_if_blender_prints_when_it_exits(tmp_path):
    script = (
        "import atexit, os, runpy, sys\n"
        "atexit.register(os.write, 1, b'Blender quit\\n')\n"
        "path, *sys.argv = sys.argv[1:]\n"
        "sys.path.insert(0, os.path.dirname(path))\n"
        "runpy.run_path(path, run_name='__main__')\n"
    )
    bake = str(ROOT / "tools" / "bake.py")
    words = [sys.executable, "-c", script, bake, "bake.py", "no.blend", "--out", str(tmp_path), "--json"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert done.returncode == 1
    assert "error" in json.loads(done.stdout.splitlines()[-1])
    assert "Blender quit" in done.stderr


def test_scene_is_baked_and_told_as_one_json_object(tmp_path):
    import bpy

    (tmp_path / "scene.obj").write_text(OBJ)
    out, blend, exported = tmp_path / "out", tmp_path / "saved.blend", tmp_path / "for web" / "saved.glb"
    done = command(
        tmp_path / "scene.obj",
        "--out",
        out,
        "--resolution",
        32,
        "--hemicube",
        16,
        "--world",
        "1,2,3",
        "--save-blend",
        blend,
        "--export",
        exported,
        "--json",
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    facts = json.loads(line)
    assert facts["objects"] == 1 and facts["patches"] > 100
    files = (out / "Lightmap.exr", out / "Lightmap.png", exported, blend)
    assert set(facts["files"]) == set(map(str, files))
    assert GltfFile(exported).json["materials"][0]["extensions"]["MOZ_lightmap"]["texCoord"] == 1
    assert blend.is_file() and (out / "Lightmap.png").is_file()
    image = bpy.data.images.load(str(out / "Lightmap.exr"))
    image.colorspace_settings.name = "Linear Rec.709"
    assert tuple(pixels(image).reshape(-1, 4).max(axis=0)) == pytest.approx((1, 2, 3, 1), rel=0.01)


@pytest.mark.one_version
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("missing.obj", "--out", "out"), "There is no file"),
        (("scene.xyz", "--out", "out"), "use .blend, .glb, .gltf, .obj"),
        (("scene.obj",), "--out"),
        ((".", "--out", "out"), "is a folder"),
        (("scene.obj", "--out", "out", "--resolution", 99999999999), "resolution is 99999999999"),
        (("scene.obj", "--out", "out", "--seed", 99999999999), "seed is 99999999999"),
        (("scene.obj", "--out", "out", "--tolerance", "nan"), "tolerance is nan"),
        (("scene.obj", "--out", "out", "--world", "nan,1,1"), "'nan,1,1' is no radiance"),
        (("scene.obj", "--out", "out", "--world", "-1,1,1"), "'-1,1,1' is no radiance"),
        (("scene.obj", "--out", "out", "--world", "1,1"), "'1,1' is no radiance"),
        (("scene.obj", "--out", "out", "--js"), "unrecognized arguments: --js"),
        (("scene.obj", "--out", "out", "--save-blend", "."), "is a folder. Choose another path"),
        (("scene.obj", "--out", "out", "--save-blend", "scene.obj/a.blend"), "Choose another path"),
        (("scene.obj", "--out", "scene.obj"), "Choose another folder"),
        (("scene.obj", "--out", "out", "--visibility", "sight"), "visibility is sight; choose one of auto,"),
        (
            ("scene.obj", "--out", "out", "--outputs", "direct,foo"),
            "outputs is direct, foo; choose one of comb",
        ),
        (("scene.obj", "--out", "out", "--outputs", ""), "outputs is empty"),
        (
            ("scene.obj", "--out", "out", "--outputs", "direct", "--verify"),
            "let 'combined' be among the outputs",
        ),
    ],
)
def test_error_is_one_json_object_and_exit_code_1(tmp_path, arguments, words):
    (tmp_path / "scene.obj").write_text(OBJ)
    done = command(*arguments, "--json", folder=tmp_path)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    (line,) = done.stdout.splitlines()
    assert words in json.loads(line)["error"]


@pytest.mark.one_version
def test_outputs_that_are_asked_for_are_written(tmp_path):
    (tmp_path / "scene.obj").write_text(OBJ)
    out = tmp_path / "out"
    sizes = ("--resolution", 16, "--hemicube", 8, "--ao-samples", 4, "--world", "1,1,1")
    done = command(
        tmp_path / "scene.obj", "--out", out, *sizes, "--outputs", "Direct, ambient_occlusion", "--json"
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["images"] == ["Lightmap", "Lightmap ambient occlusion"] and facts["iterations"] == 1
    assert set(facts["files"]) == {str(path) for path in out.iterdir()} - {str(out / "hemibake.json")}
    assert len(facts["files"]) == 4


@pytest.mark.one_version
def test_all_devices_of_the_machine_share_a_bake(tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "scene.obj").write_text(OBJ)
    sizes = ("--resolution", 16, "--samples", 16, "--world", "1,1,1")
    done = command(tmp_path / "scene.obj", "--out", tmp_path / "out", *sizes, "--devices", "all", "--json")
    assert done.returncode == 0, done.stderr
    reasons = json.loads(done.stdout)["reasons"]
    assert any(re.match(r"\d+ Dask workers? computes? visibility", reason) for reason in reasons)


@pytest.mark.parametrize("option", ["method", "visibility"])
def test_choice_is_taken_as_the_help_spells_it(option, capsys, monkeypatch):
    """Every value that the help of an option names is one that the setting takes, in any case."""
    import bpy

    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import bake

    options = bake.options
    with pytest.raises(SystemExit):
        options.parse(bake.parser(), ["--help"])
    told = " ".join(capsys.readouterr().out.split())
    for item in bpy.context.scene.hemibake.bl_rna.properties[option].enum_items:
        choice = item.identifier
        assert choice in told
        for word in (choice, choice.upper()):
            words = ["scene.obj", "--out", "out", f"--{option}", word]
            bake.command.apply_settings(options.parse(bake.parser(), words))
            assert getattr(bpy.context.scene.hemibake, option) == choice


@pytest.mark.one_version
def test_setting_out_of_range_is_told(tmp_path):
    (tmp_path / "scene.obj").write_text(OBJ)
    done = command(tmp_path / "scene.obj", "--out", tmp_path, "--resolution", 0, "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["error"] == "resolution is 0; choose 8 to 16384 texels."


@pytest.mark.usefixtures("signals_as_before")
def test_bug_is_told_as_json_with_its_traceback_on_standard_error(capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import bake

    def broken(options, signals):
        raise KeyError("lost")

    monkeypatch.setattr(bake, "run", broken)
    assert bake.main(["scene.obj", "--out", "out", "--json"]) == 1
    told = capsys.readouterr()
    assert "KeyError: 'lost'" in json.loads(told.out)["error"]
    assert "Traceback" in told.err


#: Many rays of many texels: a bake that is far from its end when a signal comes.
LONG = (
    "--resolution",
    1024,
    "--hemicube",
    128,
    "--visibility",
    "rays",
    "--method",
    "stream",
    "--world",
    "1,1,1",
)


@pytest.mark.one_version
@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("moment", ["Blender starts", "the scene is baked"])
def test_signal_ends_a_bake_without_a_trace(tmp_path, number, code, moment):
    (tmp_path / "scene.obj").write_text(OBJ)
    temporary, out = tmp_path / "temporary", tmp_path / "out"
    temporary.mkdir()
    words = [sys.executable, str(ROOT / "tools" / "bake.py"), tmp_path / "scene.obj", "--out", out, "--json"]
    process = subprocess.Popen(
        [str(word) for word in (*words, *LONG)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
    )
    begun = (lambda: any(temporary.iterdir())) if moment == "Blender starts" else out.exists
    limit = time.monotonic() + 60
    while not begun() and time.monotonic() < limit:
        time.sleep(0.01)
    time.sleep(0.2)
    process.send_signal(number)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert json.loads(output) == {"error": f"Interrupted by {number.name}."}
    assert "Traceback" not in errors
    assert not list(temporary.iterdir()) and not out.exists()


@pytest.mark.usefixtures("signals_as_before")
@pytest.mark.parametrize("where", ["callback", "handler"])
def test_signal_that_is_lost_comes_again(where):
    """Python ignores what callbacks of weak references raise, Blender prints what handlers do."""
    signals = part("operators.command_line.signals")
    hooks = sys.unraisablehook, sys.excepthook
    with pytest.raises(signals.Stopped, match="SIGTERM"):
        lose_a_signal(signals, lost_in_callback if where == "callback" else lost_in_handler)
    assert (sys.unraisablehook, sys.excepthook) == hooks


def lose_a_signal(signals, lose):
    """Lose a signal, then wait; what `listening` raises at its end is none of that."""
    with signals.Signals() as listening, listening.listening():
        lose()
        time.sleep(10)
        listening._received = None


def test_signal_during_an_import_is_raised_after_it(tmp_path, monkeypatch):
    """An exception in the import system left a lock taken, for which a thread that imports waited forever."""
    signals = part("operators.command_line.signals")
    source = "import signal, time\nsignal.raise_signal(signal.SIGINT)\ntime.sleep(0.1)\ncomplete = True\n"
    (tmp_path / "interrupted_module.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(signals.Stopped, match="SIGINT"):
        lose_a_signal(signals, lambda: importlib.import_module("interrupted_module"))
    assert sys.modules.pop("interrupted_module").complete


def lost_in_callback():
    referent = type("Referent", (), {})()
    known = weakref.ref(referent, lambda _: signal.raise_signal(signal.SIGTERM))
    del referent
    assert known() is None


def lost_in_handler():
    import bpy

    def handler(*_):
        handlers.remove(handler)
        signal.raise_signal(signal.SIGTERM)

    handlers = bpy.app.handlers.depsgraph_update_post
    handlers.append(handler)
    square("Square")
    bpy.context.view_layer.update()


def installed(capfd, *arguments) -> tuple[int, list[str]]:
    """Run the add-on's own command in this Blender; return its exit code and what it printed."""
    capfd.readouterr()
    code = part("operators.command_line").main([str(word) for word in arguments])
    return code, capfd.readouterr().out.splitlines()


@pytest.mark.usefixtures("signals_as_before")
def test_installed_command_bakes_the_open_file(tmp_path, capfd):
    import bpy

    furnace()
    code, lines = installed(
        capfd,
        "--out",
        tmp_path,
        "--resolution",
        53,
        "--hemicube",
        16,
        "--save-blend",
        tmp_path / "a.blend",
        "--json",
    )
    facts = json.loads(lines[-1])
    assert code == 0 and facts["objects"] == 1 and bpy.context.scene.hemibake.resolution == 53
    assert {str(tmp_path / name) for name in ("Lightmap.exr", "Lightmap.png", "a.blend")} == set(
        facts["files"]
    )
    assert all((tmp_path / name).is_file() for name in facts["files"])


@pytest.mark.usefixtures("signals_as_before")
def test_pictures_replace_those_of_the_last_bake_and_no_others(tmp_path, capfd):
    """Then the same name in a format that is a PNG itself: the picture's place is its own."""
    furnace()
    (tmp_path / "Lightmap.png").write_text("mine")
    sizes = ("--out", tmp_path, "--resolution", 16, "--hemicube", 8, "--json")
    for _ in range(2):
        code, lines = installed(capfd, *sizes)
        names = {Path(path).name for path in json.loads(lines[-1])["files"]}
        assert code == 0 and names == {"Lightmap.exr", "Lightmap.001.png"}
    assert (tmp_path / "Lightmap.png").read_text() == "mine"
    (tmp_path / "Lightmap.png").unlink()
    installed(capfd, *sizes)
    words = ("--file-format", "RGBM", "--light-range", 8, "--file-name", "{lightmap}")
    code, lines = installed(capfd, *sizes, *words)
    names = {Path(path).name for path in json.loads(lines[-1])["files"]}
    assert code == 0 and names == {"Lightmap.exr", "Lightmap.png"}
    known = json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]["Lightmap.png"]
    assert (known["format"], known["range"]) == ("rgbm", 8)


@pytest.mark.usefixtures("signals_as_before")
def test_installed_command_takes_settings_of_the_machine(tmp_path, capfd):
    furnace()
    preferences = part("operators.preferences").machine_properties()
    sizes = ("--out", tmp_path, "--resolution", 16, "--hemicube", 8, "--json")
    try:
        code, lines = installed(capfd, *sizes, "--memory-budget", 3, "--opencl-device", "Card C")
        assert code == 1 and "There is no OpenCL device 'Card C'" in json.loads(lines[-1])["error"]
        assert preferences.memory_budget == 3
    finally:
        for name in ("memory_budget", "opencl_device"):
            preferences.property_unset(name)


@pytest.mark.usefixtures("signals_as_before")
def test_installed_command_tells_the_same_as_the_tool(tmp_path, capfd):
    """Of a named scene, which is baked alone: what was open before is left."""
    square("Left")
    (tmp_path / "scene.obj").write_text(OBJ)
    words = [
        tmp_path / "scene.obj",
        "--out",
        tmp_path / "out",
        "--resolution",
        31,
        "--hemicube",
        16,
        "--world",
        "1,2,3",
        "--visibility",
        "rays",
        "--json",
    ]
    code, lines = installed(capfd, *words)
    here, there = json.loads(lines[-1]), json.loads(command(*words).stdout)
    assert code == 0 and here.keys() == there.keys()
    for facts in (here, there):
        del facts["seconds"], facts["reasons"]
    assert here == there


@pytest.mark.usefixtures("signals_as_before")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--json",), "--out"),
        (("--out", "out", "--resolution", 0, "--json"), "resolution is 0; choose 8 to 16384 texels."),
        (("missing.obj", "--out", "out", "--json"), "There is no file"),
        (("--out", "out", "--verify", "--json"), "unrecognized arguments: --verify"),
        (("--out", "out", "--file-format", "tiff", "--json"), "file_format is tiff; choose one of exr, hdr"),
        (("--out", "out", "--file-name", "{map}", "--json"), "has an unknown field {map}"),
    ],
)
def test_error_of_the_installed_command_is_one_json_object_and_exit_code_1(
    tmp_path, capfd, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    square(uvs=SQUARE_UVS)
    code, lines = installed(capfd, *arguments)
    assert code == 1 and words in json.loads(lines[-1])["error"]


def test_commands_come_and_go_with_the_add_on(monkeypatch):
    import bpy

    there = []

    def register(name, function):
        there.append((name, function))
        return name

    disable()
    monkeypatch.setattr(bpy.utils, "register_cli_command", register)
    monkeypatch.setattr(bpy.utils, "unregister_cli_command", lambda handle: there.pop())
    enable()
    commands = part("operators.command_line")
    assert there == [
        ("hemibake", commands.main),
        ("hemibake_merge", commands.main_of_merge),
        ("hemibake_worker", commands.main_of_worker),
    ]
    disable()
    assert there == []
    monkeypatch.undo()
    enable()
