"""Light of probe grids in three.js against the formula of their coefficients."""

import json
from functools import partial

import numpy as np
import pytest

from tests.blender.things import part
from tools.engines.web import THREE_PROBES

#: Probes of the volume along its axes.
RESOLUTION = (2, 3, 4)

#: Blender's axes (x, y, z) in three.js: rows are x, z, -y.
Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture
def volume(hemibake, engine, tmp_path):
    """Return the coefficients of random probes, (n, 9, 3), whose file and manifest are in a folder."""
    random = np.random.default_rng(11)
    coefficients = random.uniform(-0.1, 0.1, (24, 9, 3)).astype(np.float32)
    coefficients[:, 0] += 2.0
    grid = part("engine.bake_result").ProbeGrid(
        "Volume", RESOLUTION, matrix(), coefficients, np.ones(24, np.float32), np.zeros((24, 3), np.float32)
    )
    probe_files = part("operators.result.probe_files")
    owner = part("operators.result.destination").Destination(tmp_path, (), "")
    entry = probe_files._entry("box_Probes", grid, np.zeros(3), owner)
    content = partial(probe_files.probe_atlas, grid)
    probe_files.ProbeFile("box_Probes.exr", content, entry).write(tmp_path / "box_Probes.exr")
    turned = {**entry, "name": "Turned", "matrix": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    lost = {**entry, "name": "Lost", "file": "lost.exr"}
    manifest = {"version": 2, "lightmaps": {}, "objects": [], "probes": [entry, turned, lost]}
    (tmp_path / "hemibake.json").write_text(json.dumps(manifest))
    return coefficients


def matrix() -> np.ndarray:
    """Return the transform of a box of 2 x 3 x 6 m around (5, -7, 2)."""
    made = np.diag([1.0, 1.5, 3.0, 1.0])
    made[:3, 3] = (5, -7, 2)
    return made


def test_three_shows_probe_grids(volume, tmp_path):
    """On surfaces half a cell below each probe, where three.js reads that probe alone."""
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
    problems, data = THREE_PROBES.answer(tmp_path, {"surfaces": surfaces})
    shown = np.frombuffer(data, np.float32).reshape(-1, 4)[:, :3]
    assert shown == pytest.approx(np.array(wanted), rel=0.01)
    assert len(problems) == 2
    assert "Probe volume 'Turned': three.js shows no rotated grids" in problems[0]
    assert "Probe volume 'Lost': 'lost.exr' is not readable" in problems[1]
