"""Pixels of Godot 3 against Blender's preview."""

import numpy as np
import pytest

from tools.engines import cornell, godot

_WIDTH = 240


@pytest.fixture(scope="module")
def engine():
    if missing := godot.missing():
        pytest.skip(f"{missing}: exports are not shown with Godot")
    return godot


def test_godot_shows_the_preview(hemibake, engine, tmp_path):
    cornell.bake()
    wanted = cornell.preview(_WIDTH, tmp_path)
    shown = engine.render(cornell.export(tmp_path, "NONE"), _WIDTH, _WIDTH, cornell.HIDDEN)
    assert shown.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(cornell.differences(shown, wanted), 99) < 0.02


def test_godot_shades_a_normal_map_with_directional_maps(hemibake, engine, tmp_path):
    """As the preview does; without the directional maps the picture is another one."""
    cornell.bake(directional="directional")
    wanted = cornell.preview(_WIDTH, tmp_path)
    path = cornell.export(tmp_path, "NONE")
    shaded, flat = (
        cornell.differences(engine.render(path, _WIDTH, _WIDTH, cornell.HIDDEN, on), wanted)
        for on in (True, False)
    )
    assert np.percentile(shaded, 99) < 0.02
    assert np.median(flat) > 0.03
