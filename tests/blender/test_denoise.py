"""Denoise in Blender: in a bake, in the panel, and where there is no Open Image Denoise."""

from pathlib import Path

import numpy as np
import pytest

from tests.blender.test_panels import draw
from tests.blender.things import furnace, part, pixels, report


@pytest.fixture
def settings():
    """The settings of a noisy bake."""
    import bpy

    group = bpy.context.scene.hemibake
    group.visibility, group.samples, group.denoise = "rays", 16, True
    return group


@pytest.fixture
def no_library(monkeypatch):
    """A Blender that brings no Open Image Denoise along, and a Python without a package of it."""
    monkeypatch.setattr(part("operators.bake_settings"), "denoise_library", lambda: None)
    monkeypatch.setattr(part("panels.bake"), "denoise_library", lambda: None)
    monkeypatch.setattr(part("operators.worker_manager").owner, "_bake_without_window", bake_here)
    monkeypatch.setattr(part("engine.postprocess.denoising"), "library_of_packages", lambda: None)


def bake_here(scene, settings):
    return part("engine.session").bake(scene, settings)


def bake():
    import bpy

    return bpy.ops.hemibake.bake()


def warnings() -> list[str]:
    """Return the warnings of a bake, except the one on the unsaved file."""
    return [text for text in report()["warnings"] if "not saved" not in text]


def denoises() -> bool:
    return part("operators.denoise_library").denoise_library() is not None


def libraries_in_this_process() -> int:
    """Return the number of device libraries of Open Image Denoise that this process has loaded."""
    maps = Path("/proc/self/maps")
    return maps.read_text().count("OpenImageDenoise_device") if maps.exists() else 0


def test_a_bake_denoises_in_the_worker(settings):
    import bpy

    if not denoises():
        pytest.skip("This Blender has no Open Image Denoise.")
    furnace()
    before = libraries_in_this_process()
    assert bake() == {"FINISHED"}
    assert not warnings()
    assert any("Open Image Denoise 2" in reason for reason in report()["reasons"])
    assert report()["seconds"]["denoising"] > 0
    assert part("operators.worker_manager").owner.worker().alive and libraries_in_this_process() == before
    values = pixels(bpy.data.images["Lightmap"])[..., :3]
    np.testing.assert_allclose(values[values[..., 0] > 0], 2.0, rtol=0.05)


def test_the_panel_gives_a_reason_where_it_does_not_denoise_and_else_none(settings):
    shown = draw("HEMIBAKE_PT_bake")
    assert "denoise" in shown
    assert ("No Open Image Denoise in this Blender" in shown) != denoises()


def test_without_a_library_a_bake_warns_and_the_panel_does_not(settings, no_library):
    furnace()
    assert not any("Open Image Denoise" in text for text in draw("HEMIBAKE_PT_bake"))
    assert bake() == {"FINISHED"}
    (warning,) = warnings()
    assert warning.startswith("The lightmaps were not denoised. There is no Open Image Denoise.")
    assert "blender.org" in warning


def test_a_bake_that_does_not_denoise_is_done_in_this_process(settings):
    settings.denoise = False
    part("operators.worker_manager").owner.stop()
    furnace()
    assert bake() == {"FINISHED"}
    assert not part("operators.worker_manager").owner.worker().alive
