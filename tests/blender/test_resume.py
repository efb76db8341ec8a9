"""A bake that is interrupted in Blender goes on when it is started again."""

import numpy as np
import pytest

from tests.blender.things import furnace, part, pixels, report

pytestmark = pytest.mark.one_version


@pytest.fixture
def checkpoints():
    """Let every slice of work be written; return the folder."""
    preferences = part("operators.preferences").machine_properties()
    preferences.checkpoint_interval = 0
    part("operators.worker_manager").owner.forget()
    part("operators.user_files").clear_cache()
    yield part("operators.user_files").cache_folder() / "resume"
    preferences.property_unset("checkpoint_interval")


def test_an_interrupted_bake_goes_on_from_its_checkpoint(checkpoints, monkeypatch):
    import bpy

    furnace()
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.visibility, settings.max_bounces, settings.tolerance = 37, "rays", 6, 0
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    whole = pixels(bpy.data.images["Lightmap"]).copy()
    part("operators.worker_manager").owner.forget()
    bake = part("engine.session").bake

    def interrupted(*arguments):
        for progress in bake(*arguments):
            if progress.iteration == 4:
                raise KeyboardInterrupt
            yield progress

    monkeypatch.setattr(part("engine.session"), "bake", interrupted)
    with pytest.raises(RuntimeError, match="interrupted"):
        bpy.ops.hemibake.bake()
    monkeypatch.undo()
    assert any(checkpoints.iterdir())
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    light, seen = report()["resumed"]
    assert "was restored from an interrupted bake" in seen
    assert "Light was restored from bounce" in light
    assert np.array_equal(pixels(bpy.data.images["Lightmap"]), whole)
    assert not any(checkpoints.iterdir())
