"""The gallery's scenes have what their page promises, and no empty faces."""

import sys
from importlib import import_module

import numpy as np
import pytest

from tools.headless import ROOT

pytestmark = pytest.mark.one_version


@pytest.mark.parametrize(
    ("name", "least", "shared", "states"),
    [("interior", 200, 0, 0), ("level", 180, 9, 0), ("street", 400, 3, 3)],
)
def test_scenes_of_the_gallery(name, least, shared, states, monkeypatch):
    import bpy

    monkeypatch.setattr(sys, "path", [str(ROOT / "examples"), *sys.path])
    import_module(f"gallery_scenes.{name}").build()
    scene = bpy.context.scene
    objects = [obj for obj in scene.objects if obj.type == "MESH"]
    meshes = {obj.data for obj in objects}
    assert len(objects) >= least and sum(mesh.users > 1 for mesh in meshes) >= shared
    assert scene.camera is not None and any(obj.type == "LIGHT" for obj in scene.objects)
    assert all(smallest_face(mesh) > 1e-9 for mesh in meshes)
    groups = {group.name for group in scene.view_layers[0].lightgroups}
    named = {entry.name for state in scene.hemibake.light_states for entry in state.groups}
    assert len(scene.hemibake.light_states) == states and named <= groups


def smallest_face(mesh):
    """Return the area of the smallest face, m²."""
    areas = np.empty(len(mesh.polygons), np.float32)
    mesh.polygons.foreach_get("area", areas)
    return areas.min()
