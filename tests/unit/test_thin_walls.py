"""Thin walls part light from dark only if the two sides differ, not if their feet are in shadow."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine.postprocess import thin_walls
from engine.postprocess.texel_samples import TexelSamples
from engine.postprocess.thin_walls import in_thin_walls
from engine.validity.push_off import PushOffs

#: Width of the square floor, texels and metres, and samples along a texel.
WIDTH, SIDE = 7, 4

#: Where the wall across the floor begins and ends along x, m.
WALL = (3.2, 3.6)


#: Light of samples that back faces enclose.
POCKET = 0.01


def floor_and_wall():
    """Return a floor of two triangles and the two long sides of a wall across it."""
    low, high = (0, 0, 0), (WIDTH, WIDTH, 0)
    floor = [[low, (WIDTH, 0, 0), high], [low, high, (0, WIDTH, 0)]]
    sides = [[(x, 0, 0), (x, WIDTH, 0), (x, 0, 3)] for x in WALL]
    positions = np.array([*floor, *sides], np.float32)
    normals = np.array([(0, 0, 1), (0, 0, 1), (-1, 0, 0), (1, 0, 0)], np.float32)
    return SimpleNamespace(
        triangles=SimpleNamespace(positions=positions),
        patches=SimpleNamespace(resolution=WIDTH),
        geometry=SimpleNamespace(steps=SimpleNamespace(geometric=normals, area=np.ones(4, np.float32))),
    )


def samples_of_floor():
    """Return a grid of samples, sorted by texel."""
    at = (np.arange(WIDTH * SIDE) + 0.5) / SIDE
    x, y = (axis.ravel() for axis in np.meshgrid(at, at))
    texel = (y.astype(int) * WIDTH + x.astype(int)).astype(np.int32)
    order = np.argsort(texel, kind="stable")
    x, y, texel = x[order], y[order], texel[order]
    is_first = x >= y
    longer, shorter = np.maximum(x, y) / WIDTH, np.minimum(x, y) / WIDTH
    first = np.stack([1 - longer, longer - shorter, shorter], axis=1)
    second = np.stack([1 - longer, shorter, longer - shorter], axis=1)
    barycentric = np.where(is_first[:, None], first, second).astype(np.float32)
    position, count = np.stack([x, y], axis=1).astype(np.float32), len(x)
    triangle = np.where(is_first, 0, 1).astype(np.int32)
    weight = np.full(count, 1 / SIDE**2, np.float32)
    return TexelSamples(np.zeros(count, np.int32), texel, position, weight, triangle, barycentric)


def push_offs_of(inside, wall, enclosed):
    """Return the push-offs of samples inside a wall, (s,) bool, and of enclosed samples, (s,) bool."""
    rows = np.flatnonzero(inside)
    count = len(rows)
    offset, thickness = np.zeros((count, 3), np.float32), np.full(count, 0.4, np.float32)
    return PushOffs(rows, offset, thickness, np.full(count, wall, np.int32), inside, enclosed)


@pytest.mark.parametrize(
    ("left", "right", "foot", "found"),
    [
        (1.0, 0.0, 1.0, True),
        (0.2, 1.0, 1.0, True),
        (1.0, 1.0, 0.05, False),
        (1.0, 0.9, 1.0, False),
        (1.0, POCKET, 1.0, False),
        (POCKET, 1.0, 1.0, False),
    ],
)
@pytest.mark.parametrize("wall", [2, 3])
@pytest.mark.parametrize("at_once", [2, 100])
def test_a_wall_counts_if_one_side_is_darker_as_a_whole(left, right, foot, found, wall, at_once, monkeypatch):
    """Light at the foot of the wall is `foot` times that of its side; a pocket is no dark side."""
    monkeypatch.setattr(thin_walls, "_AT_ONCE", at_once)
    samples = samples_of_floor()
    x = samples.position[:, 0]
    inside = (x > WALL[0]) & (x < WALL[1])
    light = np.where(x < WALL[0], left, right)
    light[np.abs(x - np.mean(WALL)) < 0.5] *= foot
    push_offs = push_offs_of(inside, wall, ~inside & (light == POCKET))
    thin = in_thin_walls(floor_and_wall(), samples, push_offs, ~inside, light.astype(np.float32))
    assert list(thin) == list(np.flatnonzero(inside) if found else [])
