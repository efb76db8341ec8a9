"""Light probes that an export writes for Unity."""

import base64
import json

import numpy as np
import pytest

from tests.blender.test_export import export
from tests.blender.test_light_probes import bake, probe_volume
from tests.blender.things import bpy_link, furnace, part, snapshot
from tools.headless import ROOT


def numbers(text, kind):
    """Return the array of a base64 text."""
    return np.frombuffer(base64.b64decode(text), kind)


def test_light_probes_of_the_last_bake(tmp_path):
    """In a furnace of 2 both kinds show 2; a sheared volume has no textures, and nothing changes."""
    import bpy

    furnace()
    obj = probe_volume("Vol/1", (2, 3, 1))
    obj.rotation_euler.z = 0.3
    parent = bpy_link(bpy.data.objects.new("Parent", None))
    parent.scale = (1, 0.5, 1)
    sheared = probe_volume("Sheared", (1, 1, 2), scale=(0.1, 0.1, 0.1))
    sheared.rotation_euler.z, sheared.parent = 0.5, parent
    bake(tmp_path)
    before = snapshot()
    folder = tmp_path / "export"
    folder.mkdir()
    export(folder / "room.glb", engine="UNITY")
    assert snapshot() == before
    written = json.loads((folder / "room.Probes.json").read_text())
    first, second = sorted(written["volumes"], key=lambda volume: volume["name"])[::-1]
    assert first["name"] == "Probes Vol_1" and first["resolution"] == [2, 1, 3]
    harmonics = numbers(first["harmonics"], "<f4").reshape(6, 3, 9)
    assert harmonics[:, :, 0] == pytest.approx(np.full((6, 3), 2), rel=0.02)
    assert np.abs(harmonics[:, :, 1:]).max() < 0.05
    textures = [numbers(text, "<f2").reshape(6, 4) for text in first["textures"]]
    assert textures[0][:, :3] == pytest.approx(np.full((6, 3), 2), rel=0.02) and len(textures) == 3
    assert first["position"] == pytest.approx([-0.5, 0.5, -0.5]) and first["size"] == pytest.approx(
        [0.8, 0.4, 0.6]
    )
    local = np.array(first["worldToLocal"]).reshape(3, 4)
    assert local @ [*first["position"], 1] == pytest.approx(np.zeros(3), abs=1e-6)
    _, y, _, w = first["rotation"]
    assert np.hypot(y, w) == pytest.approx(1) and 2 * np.arctan2(abs(y), w) == pytest.approx(0.3, abs=1e-5)
    assert "textures" not in second and "harmonics" in second


def test_changed_files_stay_and_old_ones_go(tmp_path):
    furnace()
    probe_volume("Grid", (1, 1, 1))
    bake(tmp_path)
    folder = tmp_path / "export"
    folder.mkdir()
    path = folder / "room.Probes.json"
    export(folder / "room.glb", engine="UNITY")
    first = path.read_text()
    export(folder / "room.glb", engine="UNITY")
    assert path.read_text() == first
    path.write_text("{}")
    export(folder / "room.glb", engine="UNITY")
    assert path.read_text() == "{}"
    path.write_text(first)
    for atlas in tmp_path.glob("*_Probes.exr"):
        atlas.unlink()
    export(folder / "room.glb", engine="UNITY")
    assert not path.exists()


def test_the_component_names_the_members_of_the_file():
    """JsonUtility ignores members that a class does not have."""
    text, notes = part("operators.gltf.unity_files").unity_probes(
        {"Probes A": (np.ones((1, 9, 3), np.float32), (1, 1, 1), np.eye(4))}
    )
    (volume,) = json.loads(text)["volumes"]
    source = (ROOT / "clients" / "unity" / "HemibakeProbes.cs").read_text(encoding="utf-8")
    record = source[source.index("class Volume") : source.index("SphericalHarmonicsL2[] probes")]
    assert notes == [] and all(f" {name}" in record for name in volume)
