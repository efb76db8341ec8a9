"""Visibility is reused between bakes of one file, through the add-on, and not longer."""

import pytest

from tests.blender.things import bpy_link, furnace, part, report

pytestmark = pytest.mark.one_version


@pytest.fixture
def lit_room():
    """Return a lamp in a closed room, and bake it for the first time."""
    import bpy

    furnace()
    lamp = bpy_link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT")))
    lamp.location, lamp.data.energy = (0.3, 0.5, 0.6), 10
    part("operators.worker_manager").owner.forget()
    assert not bakes_from_kept()
    return lamp


def bakes_from_kept() -> bool:
    """Bake; return True if the report says that visibility was kept."""
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    return "Visibility was kept" in report()["reasons"][0]


def test_a_lamp_that_moves_keeps_visibility_and_a_wall_that_moves_does_not(lit_room):
    import bpy

    lit_room.location.x = 0.7
    assert bakes_from_kept()
    bpy.data.objects["Furnace"].scale.z = 1.5
    assert not bakes_from_kept()
    assert bakes_from_kept()


def test_another_file_frees_what_is_kept(lit_room):
    import bpy

    session = part("engine.session")._session
    assert session._kept is not None and session._kept.samples is not None
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert session._kept is None and session._devices is not None


def test_the_worker_is_not_started_ahead_without_a_window():
    import bpy

    warm_up, owner = part("operators.warm_up"), part("operators.worker_manager").owner
    owner.stop()
    warm_up.warm_up_soon()
    assert not bpy.app.timers.is_registered(warm_up.warm_up)
    assert not owner.warm
