"""Files that an export writes for Godot 4.6: scene, lightmap data, textures and their import settings."""

import json
import re

import numpy as np
import pytest

from tests.blender.test_export import bake, by_collections, export, refusal
from tests.blender.test_light_probes import bake as bake_probes
from tests.blender.test_light_probes import probe_volume
from tests.blender.test_light_states import add_state, baked, lit, stage
from tests.blender.test_panels import Layout
from tests.blender.things import SQUARE_UVS, files_below, furnace, material, part, pixels, snapshot, square
from tests.json_schema import faults
from tools.headless import ROOT

__all__ = ["baked", "lit", "stage"]

#: A node with a mesh in a glTF file, and where Godot 4.6 puts it.
_NAMES = [
    ("Plain", "Plain"),
    ('a.b:c@d/e"f%', "a_b_c_d_e_f_"),
    ("a.b", "a_b"),
    ("a_b", "a_b2"),
    ("Box-col", "Box-col"),
    ("Box", "Box"),
    ("Crate-col", "Crate"),
    ("Fence-convcol.001", "Fence_001"),
    ("Wall-OCC", "Wall"),
    ("Ball-rigid", "Ball-rigid/Ball-rigid"),
    ("Car-vehicle", "Car/Car"),
    ("Gone-noimp", None),
    ("Hull-colonly", None),
    ("Path-navmesh", None),
    ("Not-column", "Not-column"),
    ("", "Mesh"),
]


def godot(path):
    """Export for Godot, and return text and users by the name of each LightmapGI's data."""
    file = export(path, engine="GODOT")
    texts = {name: path.parent.joinpath(name).read_text() for name in map(str, files_below(path.parent))
             if str(name).endswith(".tres")}  # fmt: skip
    users = {name: re.findall(r'NodePath\("(.*?)"\), Rect2\(0, 0, 1, 1\), (\d+), -1', text)
             for name, text in texts.items()}  # fmt: skip
    return file, texts, users


def test_names_as_godot_changes_them():
    nodes = [{"name": name, "mesh": 0} for name, _ in _NAMES]
    gltf = {"scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes}
    found = part("operators.gltf.godot_nodes").mesh_paths(gltf)
    wanted = {index: path for index, (_, path) in enumerate(_NAMES) if path is not None}
    assert found == wanted


def test_children_of_nodes_that_godot_replaces():
    """They move to the node that takes the place of their parent."""
    nodes = [{"name": "Ball-rigid", "mesh": 0, "children": [1]}, {"name": "Cap", "mesh": 0},
             {"name": "Off-noimp", "children": [3]}, {"name": "Lost", "mesh": 0}]  # fmt: skip
    gltf = {"scenes": [{"nodes": [0, 2]}], "nodes": nodes}
    found = part("operators.gltf.godot_nodes").mesh_paths(gltf)
    assert found == {0: "Ball-rigid/Ball-rigid", 1: "Ball-rigid/Cap"}


def test_sizes_have_a_lightmap_node_each(tmp_path):
    import bpy

    first, other = square("First", SQUARE_UVS, material()), square("Other", SQUARE_UVS, material())
    third = square("Third.001", SQUARE_UVS, material())
    other.hemibake.atlas, third.hemibake.atlas = "Other", "Third"
    for number, obj in enumerate((first, other, third)):
        obj.location.x = 100 * number
    settings = bpy.context.scene.hemibake
    settings.resolution = 16
    bake()
    for obj in (first, other, third):
        obj.select_set(obj == third)
    settings.target, settings.resolution = "SELECTED", 11
    bake()
    _, texts, users = godot(tmp_path / "room.glb")
    assert users == {
        "room.Lightmap 16.tres": [("../Objects/First", "0"), ("../Objects/Other", "1")],
        "room.Lightmap 11.tres": [("../Objects/Third_001", "0")],
    }
    files = re.findall(r'path="(.*?)"', texts["room.Lightmap 16.tres"])
    assert files == ["room.Lightmap.exr", "room.Other.exr"]
    box = re.search(r"AABB\((.*?)\)", texts["room.Lightmap 11.tres"])[1].split(",")
    np.testing.assert_allclose([float(number) for number in box], (0, 0, -1, 201, 0, 1), atol=1e-5)
    scene = (tmp_path / "room.tscn").read_text()
    assert scene.count('type="LightmapGI"') == 2 and 'path="room.glb"' in scene
    assert pixels(bpy.data.images.load(str(tmp_path / "room.Third.exr"))).shape[:2] == (11, 11)


def test_instances(tmp_path):
    source = square("Source", SQUARE_UVS, material())
    by_collections(source, [(3.0, 0, 0), (6.0, 0, 0)])
    import bpy

    bpy.context.scene.hemibake.resolution = 64
    bake()
    file, _, users = godot(tmp_path / "room.glb")
    (found,) = users.values()
    assert sorted(path for path, _ in found) == ["../Objects/Empty/Source", "../Objects/Empty_001/Source2"]
    assert len(file.nodes("Source")) == 2


def test_a_second_export_keeps_what_was_changed(tmp_path, capfd):
    """Settings that Godot has completed, and a scene that a user has saved; textures and data are new."""
    furnace()
    bake()
    path = tmp_path / "room.glb"
    godot(path)
    first = files_below(tmp_path)
    godot(path)
    assert files_below(tmp_path) == first
    settings, scene = tmp_path / "room.Lightmap.exr.import", tmp_path / "room.tscn"
    settings.write_text(settings.read_text().replace("mode=3", "mode=2") + "\nmipmaps/limit=-1\n")
    scene.write_text("[gd_scene format=3]\n")
    before = settings.read_text()
    capfd.readouterr()
    godot(path)
    assert settings.read_text() == before and scene.read_text() == "[gd_scene format=3]\n"
    assert "'room.tscn' was changed" in "".join(capfd.readouterr())
    settings.write_text('[remap]\nimporter="texture"\n')
    godot(path)
    assert 'importer="2d_array_texture"' in settings.read_text()
    assert "output" in json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]["room.Lightmap.exr"]


def normal_mapped(name):
    """Return a square whose material has a normal map."""
    import bpy

    surface = material(name)
    tree = surface.node_tree
    picture, normal = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeNormalMap")
    picture.image = bpy.data.images.new("Normals", 2, 2)
    picture.image.colorspace_settings.name = "Non-Color"
    tree.links.new(picture.outputs[0], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], tree.nodes["Principled BSDF"].inputs["Normal"])
    return square(name, SQUARE_UVS, surface)


def test_spherical_harmonics_are_for_normal_maps(tmp_path):
    """Four layers from top to bottom in Godot's axes; objects without a normal map keep the lightmap."""
    import bpy

    normal_mapped("Bumpy")
    flat = square("Flat", SQUARE_UVS, material("Glow", emission=2))
    flat.location, flat.rotation_euler.x = (0.2, 1, 0.5), np.pi
    settings = bpy.context.scene.hemibake
    settings.outputs, settings.resolution = {"combined", "spherical_harmonics"}, 32
    bake()
    _, texts, users = godot(tmp_path / "room.glb")
    assert users == {
        "room.Lightmap 32.tres": [("../Objects/Flat", "0")],
        "room.Lightmap 32 SH.tres": [("../Objects/Bumpy", "0")],
    }
    assert "_uses_packed_directional = true" in texts["room.Lightmap 32 SH.tres"]
    assert "slices/vertical=4" in (tmp_path / "room.Lightmap SH.exr.import").read_text()
    stacked = pixels(bpy.data.images.load(str(tmp_path / "room.Lightmap SH.exr")))[..., :3]
    names = (f"Lightmap SH {name}" for name in ("L0", "L1 x", "L1 y", "L1 z"))
    maps = [pixels(bpy.data.images[name])[..., :3] for name in names]
    l0, y, z, x = np.split(stacked, 4)[::-1]
    n = np.array((0.36, 0.48, -0.8))
    godots = l0 * (1 + 4 * sum((2 * v - 1) * c for v, c in zip((x, y, z), n, strict=True)))
    blender = maps[0] * (1 + 2 * (maps[1] * n[0] - maps[2] * n[2] + maps[3] * n[1]))
    assert maps[0].max() > 0.1
    np.testing.assert_allclose(godots, blender, atol=4e-3 * maps[0].max())


def test_notes(tmp_path, capfd):
    """Names with a meaning, normal maps without harmonics, and a narrow margin; the other objects are lit."""
    import bpy

    normal_mapped("Bumpy")
    square("Gone-noimp", SQUARE_UVS, material()).location.x = 5
    bpy.context.scene.hemibake.margin = 1
    bake()
    capfd.readouterr()
    _, _, users = godot(tmp_path / "room.glb")
    assert list(users.values()) == [[("../Objects/Bumpy", "0")]]
    told = "".join(capfd.readouterr())
    for part_of_note in ("no mesh of these objects", "Spherical Harmonics", "Margin is 1"):
        assert part_of_note in told


def test_shadow_mask_of_the_sun(tmp_path):
    import bpy

    square("Floor", SQUARE_UVS, material())
    light = bpy.data.objects.new("Evening", bpy.data.lights.new("Evening", "SUN"))
    bpy.context.scene.collection.objects.link(light)
    bpy.context.scene.hemibake.outputs = {"combined", "shadow_mask"}
    bake()
    _, texts, _ = godot(tmp_path / "room.glb")
    (text,) = texts.values()
    assert 'path="room.Lightmap shadow mask.exr"' in text and "shadowmask_textures" in text
    assert "shadowmask_mode = 1" in (tmp_path / "room.tscn").read_text()


def test_a_file_for_each_light_state(baked, tmp_path):
    """With the sum of factor x map, and names of their own also for states that differ in invalid letters."""
    import bpy

    add_state(baked, "A:B", Day=((0.5, 2.0, 0.25), 2.0), Night=((0, 0, 0), 1.0))
    add_state(baked, "A/B")
    folder = tmp_path / "export"
    folder.mkdir()
    _, texts, users = godot(folder / "room.glb")
    plain, first, second = (f"room{state}.Lightmap 16.tres" for state in ("", ".A_B", ".A_B.001"))
    assert set(texts) == {plain, first, second} and users[plain] == users[first] == users[second]
    (file,) = re.findall(r'path="(.*?)"', texts[first])
    mixed = pixels(bpy.data.images.load(str(folder / file)))[..., :3]
    day = pixels(baked.hemibake.lightmaps["Lightmap light group Day"].image)[..., :3]
    others = [
        pixels(entry.image)[..., :3]
        for entry in baked.hemibake.lightmaps
        if "light group" in entry.name and not entry.name.endswith(("Day", "Night"))
    ]
    np.testing.assert_allclose(mixed, day * (1, 4, 0.5) + sum(others), rtol=2e-3, atol=1e-5)
    assert day.max() > 0.01
    assert (folder / f"{file}.import").exists()
    assert first not in (folder / "room.tscn").read_text()
    assert faults(json.loads((folder / "hemibake.json").read_text())) == []


def test_light_probes_of_the_last_bake(tmp_path):
    """A node for each volume, y up, with radiance SH / pi, which is that of band 0 in a furnace of 2."""
    furnace()
    probe_volume("Vol/1", (2, 3, 1)).rotation_euler.z = np.pi / 2
    bake_probes(tmp_path)
    folder = tmp_path / "export"
    folder.mkdir()
    _, texts, _ = godot(folder / "room.glb")
    text = texts["room.Probes Vol_1.tres"]
    numbers = {
        key: np.array(
            [float(number) for number in re.search(rf"{key}\": Packed\w+\((.*?)\)", text)[1].split(",")]
        )
        for key in ("points", "sh", "tetrahedra", "bsp")
    }
    points, sh = numbers["points"].reshape(-1, 3), numbers["sh"].reshape(-1, 9, 4)[..., :3]
    assert len(points) == len(sh) == 4 * 5 * 3 and len(numbers["tetrahedra"]) == 4 * 6 * (3 * 4 * 2)
    assert len(numbers["bsp"]) % 6 == 0 and numbers["tetrahedra"].max() == len(points) - 1
    np.testing.assert_allclose(sh[:, 0], 2 * np.sqrt(4 * np.pi) / np.pi, rtol=0.02)
    assert np.abs(sh[:, 1:]).max() < 0.05
    spread = points.max(axis=0) - points.min(axis=0)
    np.testing.assert_allclose(spread[[0, 2]], (4 * 0.2, 3 * 0.4), rtol=1e-3)
    scene = (folder / "room.tscn").read_text()
    assert '[node name="Probes Vol_1" type="LightmapGI"' in scene
    for path in tmp_path.glob("*_Probes.exr"):
        path.unlink()
    (folder / "room.mine.tres").write_text("[resource]\n")
    _, texts, _ = godot(folder / "room.glb")
    assert "room.Probes Vol_1.tres" not in texts and "room.mine.tres" in texts


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_everything_is_as_before(tmp_path, ending):
    furnace()
    bake()
    before = snapshot()
    godot(tmp_path / f"room{ending}")
    assert snapshot() == before


def test_names_that_godot_cannot_read_are_refused(tmp_path):
    furnace()
    bake()
    assert "quotation marks" in refusal(tmp_path / 'the "room".glb', engine="GODOT")
    assert not files_below(tmp_path)


def test_engine_of_the_last_export_is_remembered(tmp_path):
    """Also without a window, if a script chooses it; the engine decides on format and files."""
    import bpy

    furnace()
    bake()
    settings = bpy.context.scene.hemibake
    assert settings.export_engine == "THREE"
    export(tmp_path / "files.glb")
    assert settings.export_engine == "THREE"
    for engine, files in (("BEVY", 3), ("THREE", 1)):
        folder = tmp_path / engine
        folder.mkdir()
        file = export(folder / "room.glb", engine=engine, lightmaps="PNG")
        assert settings.export_engine == engine and len(files_below(folder)) == files
        assert ("MOZ_lightmap" in file.json.get("extensionsUsed", ())) == (engine == "THREE")


def test_dialog_shows_the_options_of_files_alone():
    """And buttons for the engine's page and, where the package has one, the folder of its add-on."""
    from types import SimpleNamespace

    import bpy

    panel = next(cls for cls in part("panels").CLASSES if cls.__name__ == "HEMIBAKE_PT_export")
    engines = part("operators.export_engines").ENGINES
    assert list(engines)[-1] == "FILES"
    for name, engine in engines.items():
        kind = bpy.ops.hemibake.export_for_engine.get_rna_type()
        operator = SimpleNamespace(bl_idname=kind.identifier, bl_rna=kind, engine=name)
        context = SimpleNamespace(
            space_data=SimpleNamespace(active_operator=operator),
            region=SimpleNamespace(width=300),
            preferences=bpy.context.preferences,
        )
        assert panel.poll(context)
        shown = []
        panel.draw(SimpleNamespace(layout=Layout(shown)), context)
        assert ("use_files" in shown) == (name == "FILES")
        assert shown.count("wm.path_open") == bool(engine.page) + (engine.folder is not None)
        assert (ROOT / "docs" / "engines" / engine.page).exists() and bool(engine.page) == (name != "FILES")


def test_transmission_becomes_alpha(tmp_path, capfd):
    """In Godot's export alone; with a texture it stays, and is named. Nothing in Blender changes."""
    import bpy

    for number, color in enumerate([(0.25, 0.64, 1.0), None]):
        surface = material(f"Glass {number}")
        sockets = surface.node_tree.nodes["Principled BSDF"].inputs
        sockets["Transmission Weight"].default_value = 0.75
        if color is None:
            picture = surface.node_tree.nodes.new("ShaderNodeTexImage")
            picture.image = bpy.data.images.new("Stained", 4, 4)
            surface.node_tree.links.new(picture.outputs["Color"], sockets["Base Color"])
        else:
            sockets["Base Color"].default_value = (*color, 1)
        square(f"Pane {number}", surface=surface).location.x = 2 * number
    bake()
    before = snapshot()
    other = {known["name"]: known for known in export(tmp_path / "web.glb").json["materials"]}
    made = {known["name"]: known for known in export(tmp_path / "room.glb", engine="GODOT").json["materials"]}
    assert snapshot() == before
    assert not any("alphaMode" in known for known in other.values()) and "alphaMode" not in made["Glass 1"]
    assert "transmission and textures are opaque in Godot: 'Glass 1'" in capfd.readouterr().out
    through = 0.75 * 0.96 * np.sqrt((0.25, 0.64, 1.0))
    *color, alpha = made["Glass 0"]["pbrMetallicRoughness"]["baseColorFactor"]
    assert made["Glass 0"]["alphaMode"] == "BLEND" and alpha == pytest.approx(1 - through[0], abs=1e-5)
    # In front of a surface as bright as its light, glass is as bright as what passes, with its diffuse part.
    assert 1 - alpha + alpha * np.array(color) == pytest.approx(
        through + 0.25 * np.array((0.25, 0.64, 1.0)), abs=1e-5
    )
