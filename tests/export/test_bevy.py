"""Pixels of Bevy against Blender's preview."""

import numpy as np
import pytest

from tools.engines import bevy, cornell

_WIDTH = 240


@pytest.fixture(scope="module")
def engine():
    if missing := bevy.missing():
        pytest.skip(f"{missing}: exports are not shown with Bevy")
    bevy.install()
    return bevy


@pytest.mark.parametrize("output", [None, "directional"])
def test_bevy_shows_the_preview(hemibake, engine, tmp_path, output):
    """With a normal map by directional maps, too; without these the picture is another one."""
    cornell.bake(directional=output)
    wanted = cornell.preview(_WIDTH, tmp_path)
    path = cornell.export(tmp_path, "NONE")
    shown = engine.render(path, _WIDTH, _WIDTH, cornell.HIDDEN, output is not None)
    assert shown.mean() == pytest.approx(wanted.mean(), rel=0.01)
    assert np.percentile(cornell.differences(shown, wanted), 99) < 0.02
    if output is not None:
        flat = cornell.differences(engine.render(path, _WIDTH, _WIDTH, cornell.HIDDEN), wanted)
        assert np.median(flat) > 0.03
