"""Used area of new lightmap UVs, and the cost of unwrapping many objects."""

import pytest

from tests.blender.things import snapshot
from tests.rows import long
from tools.unwrapping import processor_time, seconds_to_cancel, unwrapping, used_texels

pytestmark = pytest.mark.one_version


def build(name):
    """Make a scene of tools/unwrapping.py and return its meshes."""
    import bpy

    from tools.verification.unwrap_scenes import SCENES

    bpy.context.scene.hemibake.resolution = SCENES[name]()
    bpy.context.view_layer.update()
    return [obj for obj in bpy.context.scene.objects if obj.type == "MESH"]


@pytest.mark.parametrize(("name", "least"), [("demo", 0.7), ("cubes", 0.6), long("level", 0.6)])
def test_scenes_use_their_lightmap(name, least):
    objects = build(name)
    unwrapping().run_to_end()
    (used,) = used_texels(objects).values()
    assert least <= used < 1


@pytest.mark.long
def test_crowd_is_unwrapped_in_two_minutes_of_two_processors_and_cancelled_at_once():
    """100 objects of 10,000 faces: processor time counts, which other work on the machine hardly changes."""
    objects = build("crowd")
    assert len(objects) == 100 and min(len(obj.data.polygons) for obj in objects) > 9000
    before = snapshot()
    assert seconds_to_cancel(after=5) < 2
    assert snapshot() == before
    began = processor_time()
    unwrapping().run_to_end()
    assert processor_time() - began < 240
    used = used_texels(objects)
    assert list(used) == ["Lightmap"] and used["Lightmap"] >= 0.6
