"""Light of probe grids in three.js: the formula of their coefficients, and Blender's preview on a path."""

import json
from functools import partial

import numpy as np
import pytest

from tests.blender.things import part
from tests.export.states import WIDTH
from tools.engines import cornell, path
from tools.engines.web import THREE_PROBES, THREE_PROBES_WEBGPU

#: Probes of the volume along its axes.
RESOLUTION = (2, 3, 4)

#: Blender's axes (x, y, z) in three.js: rows are x, z, -y.
Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


#: Light states. Only lightmaps have the light group Moon.
STATES = {"Night": {"Lamps": [0.25, 0.5, 1.0], "Moon": [1.0, 1.0, 0.5]}}


@pytest.fixture
def volume(hemibake, engine, tmp_path):
    """Return random probes whose manifest is in a folder: a fifth of their light is of Sky.

    The file of all light is in a folder of its own.
    """
    random = np.random.default_rng(11)
    coefficients = random.uniform(-0.1, 0.1, (24, 9, 3)).astype(np.float32)
    coefficients[:, 0] += 2.0
    groups = {"Lamps": 0.8 * coefficients, "Sky": 0.2 * coefficients}
    grid = part("engine.bake_result").ProbeGrid(
        "Volume", RESOLUTION, matrix(), coefficients, np.ones(24, np.float32), np.zeros((24, 3), np.float32),
        groups,
    )  # fmt: skip
    probe_files = part("operators.result.probe_files")
    owner = part("operators.result.destination").Destination(tmp_path, (), "")
    entry = probe_files._entry("box_Probes", grid, np.zeros(3), owner)
    for group in (None, *groups):
        file = next((item["file"] for item in entry["groups"] if item["name"] == group), entry["file"])
        content = partial(probe_files.probe_atlas, grid, group)
        probe_files.ProbeFile(file, content, entry).write(tmp_path / file)
    (tmp_path / "part").mkdir()
    (tmp_path / entry["file"]).rename(tmp_path / "part" / entry["file"])
    entry["file"] = f"part/{entry['file']}"
    turned = {**entry, "name": "Turned", "matrix": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    lost = {**entry, "name": "Lost", "file": "lost.exr"}
    manifest = {"version": 2, "lightmaps": {}, "objects": [], "states": STATES}
    manifest["groups"] = [{"name": "Moon", "output": "light_group Moon"}]
    manifest["probes"] = [entry, turned, lost]
    (tmp_path / "hemibake.json").write_text(json.dumps(manifest))
    return coefficients


def matrix() -> np.ndarray:
    """Return the transform of a box of 2 x 3 x 6 m around (5, -7, 2)."""
    made = np.diag([1.0, 1.5, 3.0, 1.0])
    made[:3, 3] = (5, -7, 2)
    return made


def places_of_probes(volume):
    """Return surfaces half a cell below each probe, where three.js reads that probe alone, and their E/pi."""
    normals = np.array([(1, 0, 0), (0, -1, 0), (0, 0, 1), (-0.6, 0.0, 0.8), (0.48, 0.6, -0.64)])
    cell = 2 * np.array([1.0, 1.5, 3.0]) / RESOLUTION
    indices = np.stack(np.unravel_index(np.arange(24), RESOLUTION[::-1])[::-1], axis=1)
    centres = np.array([5, -7, 2]) + cell * (indices + 0.5) - np.array([1.0, 1.5, 3.0])
    surfaces, wanted = [], []
    for probe, centre in enumerate(centres):
        normal = normals[probe % len(normals)]
        surfaces.append(
            {"position": (Y_UP @ (centre - 0.5 * cell * normal)).tolist(), "normal": (Y_UP @ normal).tolist()}
        )
        wanted.append(
            part("engine.probes.spherical_harmonics").irradiance(volume[probe : probe + 1], normal[None])[
                0, 0
            ]
        )
    return surfaces, np.array(wanted)


def shown_light(folder, page=THREE_PROBES, **asked):
    """Return the pixels that three.js shows, (24, 3), and the problems."""
    problems, data = page.answer(folder, asked)
    return np.frombuffer(data, np.float32).reshape(-1, 4)[:, :3], problems


def test_three_shows_probe_grids(volume, tmp_path):
    surfaces, wanted = places_of_probes(volume)
    shown, problems = shown_light(tmp_path, surfaces=surfaces)
    assert shown == pytest.approx(wanted, rel=0.01)
    assert len(problems) == 2
    assert "Probe volume 'Turned': three.js shows no rotated grids" in problems[0]
    assert "Probe volume 'Lost': 'lost.exr' is not readable" in problems[1]


@pytest.mark.parametrize("intensity", [1.0, 0.5])
def test_webgpu_shows_probe_grids(volume, tmp_path, intensity):
    surfaces, wanted = places_of_probes(volume)
    shown, problems = shown_light(tmp_path, THREE_PROBES_WEBGPU, surfaces=surfaces, intensity=intensity)
    assert shown == pytest.approx(intensity * wanted, rel=0.01)
    assert len(problems) == 2


def test_copies_of_materials_look_up_grids_as_the_originals(volume, tmp_path):
    surfaces, _ = places_of_probes(volume)
    plain, applied, copied = (shown_light(tmp_path, surfaces=surfaces, copies=count)[0] for count in range(3))
    assert np.array_equal(copied, applied)
    assert np.abs(applied - plain).max() > 0.01


@pytest.mark.parametrize(
    ("asked", "factors"),
    [
        ({"state": "Night"}, ([0.25, 0.5, 1.0], [1, 1, 1])),
        ({"groups": [["Lamps", [0, 0, 0], 1.0], ["Sky", [1, 0.5, 0.25], 3.0]]}, ([0, 0, 0], [3, 1.5, 0.75])),
        ({"intensity": 0.5}, ([0.5, 0.5, 0.5], [0.5, 0.5, 0.5])),
    ],
)
def test_three_mixes_light_groups_of_probes(volume, tmp_path, asked, factors):
    surfaces, wanted = places_of_probes(volume)
    shown, _ = shown_light(tmp_path, surfaces=surfaces, **asked)
    lamps, sky = factors
    assert shown == pytest.approx(0.8 * wanted * lamps + 0.2 * wanted * sky, rel=0.01)


@pytest.mark.parametrize("state", ["", "Night"])
def test_three_shows_a_ball_on_a_path_as_the_preview(hemibake, engine, tmp_path, state):
    """99 % of its pixels are within 2 %, and walls have the light of their lightmaps alone."""
    import bpy

    path.bake(tmp_path, states=bool(state))
    if state:
        bpy.ops.hemibake.light_state_apply(name=state)
    wanted = path.previews(WIDTH, tmp_path)
    bpy.ops.hemibake.export_for_engine(filepath=str(tmp_path / "room.glb"))
    places = [(Y_UP @ place).tolist() for place in path.PLACES]
    shown = engine.show_path(tmp_path / "room.glb", WIDTH, WIDTH, path.BALL, places, cornell.HIDDEN, state)
    assert shown.problems == []
    on_ball = path.ball_pixels(WIDTH)
    for picture, preview, ball in zip(shown.pixels, wanted, on_ball, strict=True):
        assert ball.sum() > 100
        assert np.percentile(cornell.differences(picture[ball], preview[ball]), 99) < 0.02
        assert np.percentile(cornell.differences(picture, preview), 98) < 0.02
