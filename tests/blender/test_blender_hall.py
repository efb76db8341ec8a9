"""The benchmark's hall is the same in Blender as in the arrays of the engine."""

import numpy as np
import pytest

from benchmarks.halls import hall
from tests.blender.things import read_scene


def test_a_bake_reads_what_the_hall_was_built_of():
    import bpy

    from benchmarks.blender_hall import build_hall

    build_hall(211, 1500)
    bpy.context.scene.hemibake.resolution = 211
    read, built = read_scene().scene, hall(211, 1500)
    (mesh,), (of_arrays,) = read.meshes, built.meshes
    assert mesh.positions + read.origin == pytest.approx(of_arrays.positions, abs=1e-6)
    assert np.array_equal(mesh.uvs, of_arrays.uvs) and np.array_equal(mesh.material, of_arrays.material)
    for surface, other in zip(read.materials, built.materials, strict=True):
        assert surface.reflectance == pytest.approx(other.reflectance)
    for light, other in zip(read.lights, built.lights, strict=True):
        assert (light.name, light.kind) == (other.name, other.kind)
        assert light.strength == pytest.approx(other.strength, rel=1e-5)
        assert (light.radius, light.half_angle) == pytest.approx((other.radius, other.half_angle), rel=1e-4)
        assert light.axes[2] == pytest.approx(other.axes[2], abs=1e-6)
        here = light.position + read.origin if light.kind == "point" else other.position
        assert here == pytest.approx(other.position, abs=1e-6)
    assert read.world == pytest.approx(built.world)
