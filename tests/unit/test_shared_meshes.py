"""Meshes in shared memory: one copy for both processes, removed after use."""

import gc
from dataclasses import replace
from multiprocessing.shared_memory import SharedMemory

import numpy as np
import pytest

from engine.array_ops import JoinedRows, joined_rows
from engine.patches.geometry import texel_steps
from engine.scene.model import Mesh, Scene
from engine.scene.triangles import join_meshes
from engine.worker import child, messages
from engine.worker.shared_arrays import place_of
from engine.worker.shared_meshes import SharedMeshes

_ARRAYS = "positions", "normals", "uvs", "face", "subface", "material"


def _mesh(triangles, seed):
    random = np.random.default_rng(seed)
    corners = [random.random((triangles, 3, size), np.float32) for size in (3, 3, 2, 2)]
    numbers = [random.integers(0, 9, triangles, np.int32) for _ in range(3)]
    return Mesh("Mesh", *corners[:3], *numbers, texture_uvs={"UVMap": corners[3]})


def _shared(meshes):
    counts = [len(mesh.face) for mesh in meshes]
    room = SharedMeshes(sum(counts), sum(counts), len(counts))
    return [room.moved(mesh) for mesh in meshes]


def _sent(value):
    parcel = messages.PackedMessage(value)
    memory = memoryview(bytearray(parcel.size))
    parcel.write(memory)
    return messages.read(memory), parcel.size


def test_a_message_of_shared_meshes_holds_no_arrays_and_keeps_their_values():
    meshes = [_mesh(700, 1), _mesh(301, 2)]
    received, size = _sent(_shared(meshes))
    assert size < 2000
    for mesh, other in zip(meshes, received, strict=True):
        assert all(np.array_equal(getattr(mesh, name), getattr(other, name)) for name in _ARRAYS)
        assert np.array_equal(mesh.texture_uvs["UVMap"], other.texture_uvs["UVMap"])


def test_both_sides_map_the_same_memory_until_the_last_array_is_freed():
    shared = _shared([_mesh(50, 3)])
    (received,), _ = _sent(shared)
    name = place_of(shared[0].positions)[0]
    shared[0].positions[7] = 5
    assert (received.positions[7] == 5).all()
    del shared
    gc.collect()
    with pytest.raises(FileNotFoundError):
        SharedMemory(name)
    assert (received.positions[7] == 5).all()


def test_arrays_with_gaps_and_private_ones_have_no_place():
    (mesh,) = _shared([_mesh(50, 4)])
    assert place_of(mesh.positions) is not None
    assert place_of(mesh.positions[::2]) is None
    assert place_of(np.zeros(3)) is None


def test_adjacent_arrays_are_joined_without_a_copy():
    meshes = [_mesh(20, 5), _mesh(31, 6)]
    shared = _shared(meshes)
    joined = joined_rows([mesh.normals for mesh in shared])
    assert np.array_equal(joined, np.concatenate([mesh.normals for mesh in meshes]))
    assert np.shares_memory(joined, shared[1].normals)
    turned = joined_rows([mesh.normals for mesh in shared[::-1]])
    assert np.array_equal(turned, np.concatenate([mesh.normals for mesh in meshes[::-1]]))


def test_normals_with_back_faces_are_looked_up_without_a_copy_of_the_fronts():
    meshes = [_mesh(20, 7), _mesh(31, 8)]
    backs = replace(_mesh(9, 9), front=np.arange(9, dtype=np.int32))
    private, shared = (join_meshes(Scene((*some, backs), ())) for some in (meshes, _shared(meshes)))
    assert isinstance(shared.normals, JoinedRows)
    for numbers in (np.array([55, 3, 50, 51]), np.array([3, 50]), np.array([51, 59]), np.zeros(0, int)):
        assert np.array_equal(shared.normals.take(numbers), private.normals[numbers])
    assert np.array_equal(shared.all_normals, private.normals)


def test_texel_steps_at_use_equal_stored_ones():
    triangles = join_meshes(Scene((_mesh(400, 10),), ()))
    stored = texel_steps(triangles, 64)
    at_use = replace(stored, edges=None)
    chosen = np.array([399, 0, 17])
    for one, other in zip(stored.of(chosen), at_use.of(chosen), strict=True):
        assert np.array_equal(one, other) and one.any()
    assert np.array_equal(stored.longer, at_use.longer)


def test_a_bake_that_returns_free_memory_keeps_its_steps_and_result(monkeypatch):
    trims = []
    monkeypatch.setattr(child, "give_back_freed_memory", lambda: trims.append(1))

    def job():
        first = yield messages.Progress("a", 0.0)
        second = yield messages.Progress("a", 0.5)
        third = yield messages.Progress("b", 0.0)
        return first, second, third

    work = child._trimmed(job())
    stages = [next(work).stage, work.send([1]).stage, work.send(None).stage]
    with pytest.raises(StopIteration) as end:
        work.send([2])
    assert stages == ["a", "a", "b"] and end.value.value == ([1], None, [2]) and len(trims) == 2
