"""Receiver records on the device."""

import pyopencl as cl
import pytest

from engine import Settings
from engine.patches.patch_scene import make_patch_scene
from engine.visibility.rays import receiver_records
from engine.visibility.rays.ray_tracer import SOURCE, RayTracer
from engine.visibility.rays.receiver_records import RECEIVER, pack_receivers
from tests.analytic.scenes import sphere


def records(compute, patch_scene):
    """Return the records of all patches."""
    (pack,) = RayTracer(compute, patch_scene.triangles, patch_scene.cutouts).kernels(SOURCE, "pack_receivers")
    buffer = pack_receivers(compute, pack, patch_scene.patches, patch_scene.geometry)
    packed = RECEIVER.array(len(patch_scene.patches))
    cl.enqueue_copy(compute.queue, packed, buffer)
    return packed


@pytest.mark.parametrize("resolution", [3, 61])
def test_records_do_not_depend_on_the_triangles_that_are_uploaded(graphics, compute, resolution, monkeypatch):
    patch_scene = make_patch_scene(graphics, compute, sphere(), Settings(resolution=resolution))
    used = len(set(patch_scene.geometry.triangle.tolist()))
    assert 0 < used < len(patch_scene.triangles.mesh)
    of_all = records(compute, patch_scene)
    shared = len(compute.shared._made)
    monkeypatch.setattr(receiver_records, "_MANY", 0)
    monkeypatch.setattr(receiver_records, "_FEW", 1.0)
    assert records(compute, patch_scene).tobytes() == of_all.tobytes()
    assert len(compute.shared._made) == shared
