"""Tests of the trace of one texel: its numbers are those of the bake."""

import dataclasses
import re

import numpy as np
import pytest

from engine import Light, Session, Settings, finished
from engine.device import devices
from engine.texel_trace import Texel, trace_texel
from tests.analytic.scenes import nine_quad_room
from tests.no_compute import NoCompute

SETTINGS = Settings(resolution=31, samples=64, light_samples=64, visibility="rays", margin=1)


def lamp(name: str, x: float, colour: tuple[float, float, float]) -> Light:
    """Return a point light without a size, whose shadow one ray determines."""
    return Light(name, "point", np.array([x, 2.0, 1.5]), np.eye(3), np.float32(colour))


def traced(choose, settings: Settings = SETTINGS) -> tuple[Texel, list[str], np.ndarray]:
    """Return the texel that a function of the state chooses, its trace, and its final value."""
    scene = dataclasses.replace(
        nine_quad_room(), lights=(lamp("Lamp", 1.0, (5, 4, 3)), lamp("Lamp", 2.0, (0, 0, 3)))
    )
    found: list = []

    def inspect(state) -> None:
        texel = choose(state)
        found.append((texel, list(trace_texel(state, texel))))

    session = Session()
    try:
        result = finished(session.bake(scene, settings, inspect=inspect))
    finally:
        session.close()
    ((texel, lines),) = found
    return texel, lines, result.display[texel.lightmap, texel.y, texel.x]


def texel_of(key: int, resolution: int) -> Texel:
    """Return the texel of a flat index."""
    return Texel(key // resolution**2, key % resolution, key // resolution % resolution)


def numbers(lines: list[str], label: str) -> np.ndarray:
    """Return the first three numbers of each line that begins with a label."""
    values = [re.findall(r"-?[\d.]+(?:e[-+]\d+)?", line)[:3] for line in lines if line.startswith(label)]
    return np.array(values, float)


def test_stages_of_a_texel_agree_with_the_bake():
    """Lights of one name are apart, their sum is the direct light, and the last line is the final value."""
    texel, lines, final = traced(lambda state: texel_of(int(state.patch_scene.patches.key[100]), 31))
    assert lines[0].startswith(f"texel            Lightmap, column {texel.x}, row {texel.y}")
    direct, reflected = numbers(lines, "not reflected"), numbers(lines, "reflected")
    lights = [line for line in lines if line.startswith("direct light")]
    assert [line.partition(" from ")[2] for line in lights] == [
        "0 'Lamp'", "1 'Lamp'", "(emissive faces)", "(bright sky)"
    ]  # fmt: skip
    each = numbers([line.partition(" from ")[0] for line in lights], "direct light")
    np.testing.assert_allclose(each.sum(axis=0), direct[0], rtol=0.1)
    np.testing.assert_allclose(direct + reflected, numbers(lines, "at the centre"), rtol=1e-4)
    np.testing.assert_allclose(numbers(lines[-1:], "combined")[0], final, rtol=1e-4)
    assert "validity         valid" in lines


def test_samples_of_a_texel_are_listed():
    """A supersampled texel shows the mean of its valid samples."""

    def choose(state) -> Texel:
        samples = state.samples.samples
        return texel_of(int(samples.keys(31)[len(samples) // 2]), 31)

    _, lines, final = traced(choose)
    samples = [line for line in lines if line.startswith("texel sample ")]
    assert len(samples) >= 4
    light = numbers([line.partition("combined ")[2] for line in samples if ", valid:" in line], "")
    assert light.min() <= final.max() and final.min() <= light.max()


def test_a_texel_without_a_surface_is_filled():
    """The trace names no patch and still has the final value."""

    def choose(state) -> Texel:
        empty = np.flatnonzero(state.patch_scene.patches.on_texels(1) == 0)
        return texel_of(int(empty[0]), 31)

    _, lines, final = traced(choose, dataclasses.replace(SETTINGS, texel_samples=1))
    assert lines[1].startswith("patch            none")
    assert "filled" in lines[-2]
    np.testing.assert_allclose(numbers(lines[-1:], "combined")[0], final, rtol=1e-4)


def test_without_opencl_the_same_stages_are_traced(monkeypatch):
    """Compute shaders cast the shadow rays of each light."""
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    _, lines, final = traced(lambda state: texel_of(int(state.patch_scene.patches.key[100]), 31))
    assert len([line for line in lines if line.startswith("direct light")]) == 4
    np.testing.assert_allclose(numbers(lines[-1:], "combined")[0], final, rtol=1e-4)


def test_a_texel_outside_is_refused():
    """The error names the texel and the range."""
    with pytest.raises(IndexError, match=r"Texel 3, 31: outside the lightmap. Use numbers from 0 to 30"):
        traced(lambda state: Texel(0, 3, 31))
