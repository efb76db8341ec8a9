"""Bakes without OpenCL: compute shaders cast all rays, and give the light of OpenCL."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Light, Settings, bake, finished
from engine.device import devices
from engine.gather import shader_gather
from engine.scene.transmission import Transmission, Transmittance
from tests.analytic import scenes
from tests.no_compute import NoCompute

SETTINGS = Settings(
    resolution=53, hemicube=8, samples=64, light_samples=9, max_bounces=3, tolerance=0, denoise=False,
    hide_seams=False, texel_samples=1, adaptive=False, patch_groups=1, visibility="rays",
)  # fmt: skip

LAMP = Light("Lamp", "point", np.array([1.1, 0.9, 1.6]), np.eye(3), np.float32([9, 7, 5]), radius=0.1)

GLASS = Transmission(*2 * [Transmittance(offset=np.float32([0.8, 0.5, 0.1]))])


def room(world=None, glass=False):
    """Return the paper's room with a lamp; perhaps with a gradient of a sky, or surfaces of tinted glass."""
    made = scenes.nine_quad_room()
    materials = list(made.materials)
    if glass:
        number = int(made.meshes[0].material[-1])
        materials[number] = replace(materials[number], transmission=GLASS)
    sky = np.zeros(3, np.float32) if world is None else world
    return replace(made, lights=(LAMP,), materials=tuple(materials), world=sky)


def with_and_without(scene, settings, monkeypatch):
    """Return a bake by OpenCL and one without."""
    theirs = finished(bake(scene, settings))
    with monkeypatch.context() as patched:
        patched.setattr(devices, "ComputeDevice", NoCompute)
        ours = finished(bake(scene, settings))
    assert "cl" in theirs.report.devices and "cl" not in ours.report.devices
    assert (ours.report.visibility, ours.report.integrator) == ("rays", "glsl")
    return ours, theirs


SKY = np.linspace(0.2, 2.0, 5 * 9 * 3, dtype=np.float32).reshape(5, 9, 3)


#: Scenes, and the mean difference that is allowed, in parts of the mean. Rays pass glass by lots that depend
#: on rounding: noise of other samples is left.
SCENES = {"room": (room(), 1e-3), "sky": (room(SKY), 1e-3), "glass": (room(SKY, glass=True), 2e-2)}


@pytest.mark.parametrize("name", SCENES)
def test_light_and_its_directions_are_those_of_opencl(name, monkeypatch):
    scene, allowed = SCENES[name]
    settings = replace(SETTINGS, outputs=("combined", "direct", "indirect", "directional"))
    ours, theirs = with_and_without(scene, settings, monkeypatch)
    assert set(ours.passes) == set(theirs.passes)
    for output, other in theirs.passes.items():
        difference, scale = (ours.passes[output] - other)[theirs.has_patch], np.abs(other).mean()
        assert np.abs(difference).mean() < allowed * scale
        assert np.abs(difference.mean(axis=0)).max() < 5e-3 * scale


def test_samples_that_are_not_kept_give_the_same_light(monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    settings = replace(SETTINGS, resolution=37, samples=16, outputs=("combined", "directional"))
    kept = finished(bake(room(SKY), settings))
    monkeypatch.setattr(shader_gather, "_MAX_KEPT", 4 * 16 * 101)
    again = finished(bake(room(SKY), settings))
    assert (kept.report.method, again.report.method) == ("cached", "stream")
    for name, light in kept.passes.items():
        assert (again.passes[name] == light).all()


def test_a_sealed_room_stays_dark(monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    dark = replace(scenes.furnace(0.5, 0.0), world=np.float32([9, 9, 9]))
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.float32([9, 9, 9]), half_angle=0.1)
    lamp = replace(LAMP, position=np.array([5.0, 4.0, 3.0]))
    baked = finished(bake(replace(dark, lights=(sun, lamp)), replace(SETTINGS, resolution=32)))
    assert np.abs(baked.image).max() < 1e-6
