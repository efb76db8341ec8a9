"""Files of lightmaps in the formats that engines read."""

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from tests.blender.things import (
    files_below,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    report,
    snapshot,
    square,
)
from tests.json_schema import faults
from tools.headless import ROOT

#: Names and endings of the files of each format: the one that Blender shows, and the one for engines.
FORMATS = {
    "exr": (".exr",),
    "hdr": (".hdr",),
    "ktx2": (".exr", ".ktx2"),
    "png": (".exr", ".png"),
    "rgbm": (".exr", ".png"),
    "rgbd": (".exr", ".png"),
    "logluv": (".exr", ".png"),
}


@pytest.fixture
def settings(tmp_path):
    """Settings of a saved scene with a folder."""
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "house.blend"))
    return bpy.context.scene.hemibake


def bake():
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def glow(strength: float):
    """Return a closed cube seen from inside, whose E/pi is twice a strength everywhere."""
    room = furnace()
    node = room.data.materials[0].node_tree.nodes["Principled BSDF"]
    node.inputs["Emission Strength"].default_value = strength
    return room


def loaded(path: Path, colours: str = "Non-Color") -> np.ndarray:
    """Return the pixels that Blender reads from a file, (h, w, 4)."""
    import bpy

    image = bpy.data.images.load(str(path), check_existing=False)
    image.alpha_mode, image.colorspace_settings.name = "CHANNEL_PACKED", colours
    try:
        return pixels(image)
    finally:
        bpy.data.images.remove(image)


def manifest(folder: Path) -> dict:
    manifest = json.loads((folder / "lightmaps" / "hemibake.json").read_text())
    assert faults(manifest) == []
    return manifest


def noise(seed=4, shape=(61, 97)) -> np.ndarray:
    """Return colours over five decades."""
    generator = np.random.default_rng(seed)
    return (10 ** generator.uniform(-3, 2, (*shape, 3))).astype(np.float32)


def assert_ktx2_holds(data, light):
    """Fail unless a file holds light, (h, w, 3), with its first row at the bottom."""
    (scheme,) = struct.unpack_from("<I", data, 44)
    start, stored = struct.unpack_from("<2Q", data, 80)
    texels = data[start : start + stored]
    if scheme == 2:
        texels = pytest.importorskip("zstandard").ZstdDecompressor().decompress(texels)
    packed = np.frombuffer(texels, "<u4").reshape(light.shape[:2])[::-1]
    assert part("engine.encoding.ktx2").from_rgb9e5(packed) == pytest.approx(light, rel=0.01, abs=1e-6)


@pytest.mark.parametrize("name", FORMATS)
def test_each_format_holds_the_light_as_the_manifest_says(settings, tmp_path, name):
    import bpy

    settings.file_format = name
    settings.exposure = -3.0
    glow(2.5)
    bake()
    image = bpy.data.images["Lightmap"]
    folder = tmp_path / "lightmaps"
    files = [folder / f"house_Lightmap{ending}" for ending in FORMATS[name]]
    assert report()["files"] == [str(path) for path in files]
    assert Path(bpy.path.abspath(image.filepath)) == files[0]
    assert np.median(pixels(image)[..., :3]) == pytest.approx(5, rel=0.01)

    entry = manifest(tmp_path)["lightmaps"][files[-1].name]
    assert entry["format"] == name and entry["output"] == "combined"
    if name == "ktx2":
        assert_ktx2_holds(files[-1].read_bytes(), pixels(image)[..., :3])
        return
    read = loaded(files[-1], "Linear Rec.709" if name in ("exr", "hdr") else "Non-Color")
    if name == "exr":
        assert read[..., :3] == pytest.approx(pixels(image)[..., :3], rel=1e-6)
    elif name == "hdr":
        assert np.median(read[..., :3]) == pytest.approx(5, rel=0.01)
    else:
        format = part("operators.file_format").chosen_format(settings)
        encoding = format.encoding("combined", float(pixels(image)[..., :3].max()))
        texels = np.rint(255 * read).astype(np.uint8)[..., : 3 if name == "png" else 4]
        assert encoding.decode(texels) == pytest.approx(pixels(image)[..., :3], rel=0.03)
        assert (entry["intensity"], entry["decode_texel"]) == (
            pytest.approx(encoding.intensity),
            encoding.formula,
        )
    assert report()["warnings"] == []


@pytest.mark.parametrize("ending", [".hdr", ".png"])
def test_blender_reads_what_is_written_texel_for_texel(tmp_path, ending):
    """Rows, columns and channels are where they belong, in alpha 0, too."""
    light, path = noise(), tmp_path / f"map{ending}"
    rgbe, rgbm = part("engine.encoding.rgbe").Rgbe(), part("engine.encoding.rgbm").Rgbm(100.0)
    if ending == ".hdr":
        path.write_bytes(part("engine.encoding.radiance").radiance_bytes(rgbe.encode(light)))
        read = loaded(path, "Linear Rec.709")[..., :3]
        assert read == pytest.approx(rgbe.decode(rgbe.encode(light)), rel=1e-6)
        return
    texels = rgbm.encode(light)
    texels[5, 7] = (1, 200, 3, 0)
    path.write_bytes(part("engine.encoding.png").png_bytes(texels, srgb=False))
    assert (np.rint(255 * loaded(path)) == texels).all()


@pytest.mark.parametrize("codec", ["zip", "piz", "none", "dwaa", "dwab"])
@pytest.mark.parametrize("depth", [16, 32])
def test_depths_and_codecs_of_openexr(tmp_path, depth, codec):
    import bpy

    file_format = part("operators.file_format")
    format = file_format.FileFormat("exr", depth, codec)
    light = np.linspace(0.1, 30, 61 * 97 * 3, dtype=np.float32).reshape(61, 97, 3)
    light[3, 5] = 1e6
    before = snapshot(), [scene.name for scene in bpy.data.scenes]
    part("operators.result.exr").write_exr(tmp_path / "map.exr", light, format)
    assert (snapshot(), [scene.name for scene in bpy.data.scenes]) == before
    read = loaded(tmp_path / "map.exr", "Linear Rec.709")[..., :3]
    half = depth == 16 or codec in ("dwaa", "dwab")
    assert format.stores_half is half and np.isfinite(read).all()
    if not half:
        assert (read == light).all()
        return
    lossy = codec in ("dwaa", "dwab")
    assert read[3, 5] == pytest.approx([65504] * 3, rel=0.1 if lossy else 0)
    assert read[40:] == pytest.approx(light[40:], rel=0.02 if lossy else 5e-4)


@pytest.mark.parametrize("name", FORMATS)
def test_signed_maps_keep_their_sign_in_every_format(settings, tmp_path, name):
    """As OpenEXR where the format holds floats, else as biased PNG, which the manifest tells to decode."""
    import bpy

    settings.file_format, settings.outputs = name, {"combined", "directional"}
    settings.exposure = -2.0
    glow(1.0)
    bake()
    assert report()["warnings"] == []
    known, signs = manifest(tmp_path)["lightmaps"], set()
    for output in ("L0", "L1 x", "L1 y", "L1 z"):
        shown = pixels(bpy.data.images[f"Lightmap {output}"])[..., :3]
        (file,) = (
            file for file, entry in known.items() if entry["output"] == output and "shown_for" not in entry
        )
        entry, read = known[file], loaded(tmp_path / "lightmaps" / file)[..., :3]
        assert entry["format"] == ("exr" if name in ("exr", "hdr", "ktx2") else "png")
        if entry["format"] == "png":
            assert entry["decode_texel"] == "light = intensity * (2.0 * rgb - 1.0)"
            read = entry["intensity"] * (2 * read - 1)
        assert read == pytest.approx(shown, abs=2e-5 * float(np.abs(shown).max()))
        signs |= set(np.sign(shown).ravel())
    assert {-1, 1} < signs


@pytest.mark.parametrize("outputs", [{"combined"}, {"combined", "spherical_harmonics"}])
def test_png_of_16_bits(settings, tmp_path, outputs):
    """SH L1 has the fixed range that engines expect, the others have 16 bits because they were asked for."""
    import bpy

    settings.file_format, settings.png_depth, settings.exposure = "png", "16", -2.0
    settings.outputs = outputs
    glow(1.5)
    bake()
    known = manifest(tmp_path)["lightmaps"]
    image = pixels(bpy.data.images["Lightmap"])[..., :3]
    entry = known["house_Lightmap.png"]
    assert entry["encoding"] == "PNG, 16-bit sRGB" and entry["intensity"] == 4
    read = loaded(tmp_path / "lightmaps" / "house_Lightmap.png", "sRGB")[..., :3]
    assert 4 * read == pytest.approx(image, rel=5e-4, abs=1e-4)
    ranges = {entry["intensity"] for entry in known.values() if entry["output"].startswith("SH L1")}
    assert ranges == ({1} if len(outputs) > 1 else set())


def test_exposure_and_range_leave_fractions_alone(settings, tmp_path):
    settings.file_format, settings.exposure = "png", 4.0
    settings.outputs = {"combined", "ambient_occlusion"}
    glow(0.01)
    bake()
    known = manifest(tmp_path)["lightmaps"]
    intensities = {
        entry["output"]: entry["intensity"] for entry in known.values() if entry["format"] == "png"
    }
    assert intensities == {"combined": 1 / 16, "ambient_occlusion": 1}


def test_range_is_that_of_the_brightest_lightmap_of_an_output(settings, tmp_path):
    """An engine has one range for all lightmaps."""
    settings.file_format = "rgbm"
    glow(1.0)
    other = square("Dim", surface=material("Dim", emission=0.1))
    other.location, other.hemibake.atlas = (50, 0, 0), "Other"
    bake()
    ranges = {entry["range"] for entry in manifest(tmp_path)["lightmaps"].values() if "range" in entry}
    assert list(ranges) == [pytest.approx(2, rel=0.02)]


@pytest.mark.one_version
def test_manifest_lists_the_maps_of_each_object(settings, tmp_path):
    settings.file_format = "rgbm"
    settings.outputs = {"combined", "direct"}
    glow(1.0)
    bake()
    (entry,) = manifest(tmp_path)["objects"]
    assert entry["object"] == "Furnace" and entry["blend"] == "../house.blend"
    assert entry["maps"] == {"combined": "house_Lightmap.png", "direct": "house_Lightmap direct.png"}
    assert {"uv_layer", "scale", "offset"} < entry.keys()
    settings.file_format = "exr"
    bake()
    (entry,) = manifest(tmp_path)["objects"]
    assert entry["maps"] == {"combined": "house_Lightmap.exr", "direct": "house_Lightmap direct.exr"}


def documented_keys() -> set[str]:
    """Return the keys of the table of the manifest in docs/reference/report_and_manifest.md."""
    page = (ROOT / "docs" / "reference" / "report_and_manifest.md").read_text(encoding="utf-8")
    rows = [line for line in page.partition("| Key | Meaning |")[2].splitlines() if line.startswith("| `")]
    return {key for row in rows for key in re.findall(r"`(\w+)`", row.split("|")[1])}


def keys(value) -> set[str]:
    """Return the keys in a value of JSON but names of files and of outputs."""
    if isinstance(value, list):
        return set().union(*map(keys, value))
    if not isinstance(value, dict):
        return set()
    named = {"lightmaps", "maps"} & value.keys()
    inner = [each for name in named for each in value[name].values()]
    return set(value).union(*map(keys, [*inner, *(value[name] for name in value.keys() - named)]))


@pytest.mark.one_version
def test_every_key_of_manifests_is_documented(settings, tmp_path):
    """Of bakes with encoded and signed maps and with instances, of exports, and of pictures."""
    import bpy

    source = glow(1.0)
    parent = mesh_object("Points", [(0, 0, 0), (5, 0, 0)], [])
    source.parent, parent.instance_type = parent, "VERTS"
    settings.outputs, found = {"combined", "directional"}, set()
    for name in ("rgbm", "png", "exr"):
        settings.file_format = name
        bake()
        found |= keys(manifest(tmp_path))
    folder = tmp_path / "lightmaps"
    part("operators.result.pictures").write_pictures([bpy.data.images["Lightmap instances"]], folder)
    assert bpy.ops.hemibake.export_for_engine(filepath=str(folder / "room.glb")) == {"FINISHED"}
    found |= keys(manifest(tmp_path))
    # Of linked objects: test_destination.py. Of light groups, also removed ones, states and probes:
    # test_manifest.py.
    others = {"library", "groups", "states", "probes", "reflections", "superseded"}
    assert found | others == documented_keys()


# What a format cannot hold.


@pytest.mark.one_version
@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("png", {}, "Choose an Exposure of -2.4"),
        ("rgbm", {"light_range": 1.5}, "Choose a Range of 5"),
        ("rgbd", {"light_range": 1.5}, "Choose a Range of 5"),
    ],
)
def test_light_that_is_clipped_is_told(settings, name, values, words):
    settings.file_format = name
    for key, value in values.items():
        setattr(settings, key, value)
    glow(2.5)
    bake()
    (warning,) = report()["warnings"]
    limit = values.get("light_range", 1)
    clipped = f"100.0% of its texels (on 'Furnace') were clipped to {limit}."
    assert warning.startswith(f"'house_Lightmap.png': {clipped}")
    assert "texel " in warning and "UV 0." in warning and words in warning
    assert report()["objects_of_warnings"] == [["Furnace"]]
    settings.exposure, settings.light_range = -2.4, 0
    bake()
    assert report()["warnings"] == []


def test_clipped_texels_are_those_of_the_bright_object(settings):
    """Two objects of one lightmap: only one of them is named, with the share of all texels."""
    bright, dim = material("Bright", emission=3.0), material("Dim", emission=0.2)
    left = square("Left", [(0, 0), (0.5, 0), (0.5, 1), (0, 1)], bright)
    right = square("Right", [(0.5, 0), (1, 0), (1, 1), (0.5, 1)], dim)
    for index, obj in enumerate((left, right)):
        obj.location = (9 * index, 0, 0)
        lid = square(f"Lid {index}", None, obj.data.materials[0])
        lid.location, lid.rotation_euler = (9 * index, 1, 0.2), (np.pi, 0, 0)
        lid.hemibake.role = "NO_LIGHTMAP"
    settings.file_format = "png"
    bake()
    (warning,) = report()["warnings"]
    assert report()["objects_of_warnings"] == [["Left"]]
    share = float(warning.partition(": ")[2].partition("%")[0])
    assert 25 < share <= 50.1


def test_light_that_becomes_black_is_told(settings):
    settings.file_format = "png"
    glow(1e-5)
    bake()
    (warning,) = report()["warnings"]
    assert "100.0% of its texels (on" in warning and "Raise the Exposure" in warning


def test_half_floats_that_are_clipped_are_told(settings):
    settings.exr_depth = "16"
    glow(1e5)
    bake()
    (warning,) = report()["warnings"]
    assert "clipped to 65504" in warning and "Choose OpenEXR with 32-bit floats" in warning


# Names.


@pytest.mark.one_version
def test_template_names_the_files(settings, tmp_path):
    import bpy

    settings.file_name = "{file}-{scene}-{lightmap}-{output}-{format}-{resolution}"
    settings.outputs = {"combined", "ambient_occlusion"}
    settings.file_format = "rgbd"
    glow(1.0)
    bake()
    outputs, start = ("combined", "ambient_occlusion"), f"house-{bpy.context.scene.name}-Lightmap"
    names = {f"{start}-{name}-rgbd-32{ending}" for name in outputs for ending in (".exr", ".png")}
    assert set(files_below(tmp_path / "lightmaps")) == names | {"hemibake.json"}
    before = files_below(tmp_path / "lightmaps")
    bake()
    assert files_below(tmp_path / "lightmaps") == before


@pytest.mark.one_version
@pytest.mark.parametrize(
    ("template", "words"),
    [
        ("{file}_{map}", "has an unknown field {map}. Fields are {file}, {scene}, {lightmap}"),
        ("{}", "has an unknown field {}."),
        ("{lightmap.__class__}", "has an unknown field {lightmap.__class__}."),
        ("{lightmap!r}", "has an unknown field {lightmap!r}."),
        ("{resolution:5}", "has an unknown field {resolution:5}."),
        ("{lightmap", "has an unpaired brace"),
        ("a/{lightmap}", "names a folder. Choose it under Folder"),
        ("{lightmap}", "gives the same file, 'Lightmap', to 'Lightmap' (combined) and 'Lightmap' (direct). "
         "Add {output} to it."),
        ("fixed", "Add {output} to it."),
    ],
)  # fmt: skip
def test_template_that_cannot_be_used_is_refused(settings, tmp_path, template, words):
    import bpy

    settings.file_name, settings.outputs = template, {"combined", "direct"}
    furnace()
    before = snapshot()
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.hemibake.bake()
    assert words in str(caught.value)
    assert snapshot() == before and not (tmp_path / "lightmaps").exists()


@pytest.mark.one_version
@pytest.mark.parametrize("ending", [".exr", ".png"])
def test_template_never_replaces_files_of_others(settings, tmp_path, ending):
    import bpy

    settings.file_name, settings.file_format = "light", "rgbm"
    own = tmp_path / "lightmaps" / f"light{ending}"
    own.parent.mkdir()
    own.write_text("mine")
    furnace()
    before = snapshot()
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.hemibake.bake()
    assert str(own) in str(caught.value) and "or move that file away" in str(caught.value)
    assert files_below(own.parent) == {own.name: b"mine"} and snapshot() == before
    own.rename(tmp_path / "away")
    bake()
    own.write_bytes(own.read_bytes() + b"painted")
    with pytest.raises(RuntimeError, match="or move that file away"):
        bpy.ops.hemibake.bake()


@pytest.mark.one_version
def test_names_of_scenes_of_one_file_must_differ(settings, tmp_path):
    import bpy

    settings.file_name = "{lightmap}"
    furnace()
    bake()
    other = bpy.data.scenes.new("Night")
    bpy.context.window.scene = other
    other.hemibake.resolution, other.hemibake.hemicube = 32, "16"
    other.hemibake.file_name, other.hemibake.file_format = "{lightmap}", "hdr"
    furnace("Night")
    with pytest.raises(RuntimeError, match="of another scene is in .* Add {scene}"):
        bpy.ops.hemibake.bake()
    other.hemibake.file_name = "{scene} {lightmap}"
    bake()
    assert {"Lightmap.exr", "Night Lightmap.hdr"} < set(files_below(tmp_path / "lightmaps"))


@pytest.mark.one_version
def test_automatic_names_leave_files_of_others_in_every_format(settings, tmp_path):
    settings.file_format = "logluv"
    own = tmp_path / "lightmaps" / "house_Lightmap.png"
    own.parent.mkdir()
    own.write_text("mine")
    furnace()
    bake()
    assert own.read_text() == "mine"
    assert [Path(path).name for path in report()["files"]] == [
        "house_Lightmap.001.exr",
        "house_Lightmap.001.png",
    ]


# What fails, and what follows.


@pytest.mark.one_version
@pytest.mark.parametrize("name", ["hdr", "rgbm"])
def test_write_error_of_the_last_file_leaves_all_old_ones(settings, tmp_path, monkeypatch, name):
    import bpy

    settings.file_format = name
    glow(1.0)
    bake()
    before = files_below(tmp_path / "lightmaps")
    write = Path.write_bytes

    def full(path, data):
        write(path, data[: len(data) // 2])
        raise OSError(28, "No space left on device")

    settings.seed = 5
    bpy.data.materials["Glow"].node_tree.nodes["Principled BSDF"].inputs[
        "Emission Strength"
    ].default_value = 3
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(RuntimeError, match="the disk is full. They are packed into the .blend instead"):
        bpy.ops.hemibake.bake()
    assert files_below(tmp_path / "lightmaps") == before
    image = bpy.data.images["Lightmap"]
    assert image.packed_file is not None and pixels(image)[..., :3].max() == pytest.approx(6, rel=0.01)


def test_bake_of_changed_objects_keeps_the_others_in_full(settings, tmp_path):
    """The texels that stay come from Blender's copy, not from the file for engines."""
    import bpy

    settings.file_format = "png"
    square("First", [(0, 0), (0.5, 0), (0.5, 1), (0, 1)], material("Clay"))
    second = square("Second", [(0.5, 0), (1, 0), (1, 1), (0.5, 1)], material("Slate"))
    second.location = (40, 0, 0)
    bpy.data.worlds.new("Sky")
    bpy.context.scene.world = bpy.data.worlds["Sky"]
    part("operators.compat").new_node_tree(bpy.context.scene.world)
    background = bpy.context.scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (9, 5, 2, 1)
    bake()
    before = pixels(bpy.data.images["Lightmap"]).copy()
    assert before.max() > 5
    second.location = (40, 0, 1)
    settings.target = "CHANGED"
    bake()
    after = pixels(bpy.data.images["Lightmap"])
    assert (after[:, :12] == before[:, :12]).all()
    assert len(files_below(tmp_path / "lightmaps")) == 3


def test_unsaved_file_packs_the_light_whatever_the_format():
    import bpy

    bpy.context.scene.hemibake.file_format = "rgbm"
    glow(2.5)
    bake()
    image = bpy.data.images["Lightmap"]
    assert image.packed_file is not None and report()["files"] == []
    assert np.median(pixels(image)[..., :3]) == pytest.approx(5, rel=0.01)


@pytest.mark.one_version
def test_table_of_the_documentation_holds_for_openexr(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import formats

    told = formats.told()
    for name, loss in formats.losses_of_openexr(part("operators.result.exr"), part("operators.file_format")):
        assert [loss.mean, loss.p99, loss.dark] == pytest.approx(told[name], rel=0.06), name
