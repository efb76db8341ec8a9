"""Irradiance caching over hemicubes of a wall whose light is known."""

import numpy as np
import pytest

from engine.visibility.views.hemicube import face_axes, face_rows, frames
from tests.reference.irradiance_caching import IrradianceCache, Records, records

WIDTH = 64


def seen(points: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return radiance and distance of what hemicubes see: a ceiling 1.3 m above with soft stripes."""
    axes, ways = face_axes(frame), []
    for face, (_, rows) in enumerate(face_rows(WIDTH)):
        u = (np.arange(WIDTH) + 0.5) * 2 / WIDTH - 1
        v = (np.arange(rows) + 0.5) * 2 / WIDTH - (1 if face == 0 else 0)
        grid = np.stack([*np.meshgrid(u, v), np.ones((rows, WIDTH))], axis=-1)
        ways.append(np.einsum("yxk,nkd->nyxd", grid, axes[:, face]))
    way = np.concatenate(ways, axis=1)
    way /= np.linalg.norm(way, axis=3, keepdims=True)
    distance = np.where(way[..., 2] > 1e-3, (1.3 - points[:, None, None, 2]) / way[..., 2], np.inf)
    place = points[:, None, None] + np.where(np.isfinite(distance), distance, 0)[..., None] * way
    radiance = (1 + np.sin(place[..., 0]) * np.cos(0.5 * place[..., 1])) * np.isfinite(distance)
    return radiance, distance


def light_at(point: np.ndarray, normal: np.ndarray, turn: float = 0.4) -> float:
    """Return E/pi of one point."""
    frame = frames(normal[None], np.array([turn]))
    return float(records(WIDTH, frame, *seen(point[None], frame)).light[0])


@pytest.mark.parametrize("lean", [0.0, 0.3])
def test_gradients_are_those_of_light_at_points_beside(lean):
    point, normal = np.array([0.3, -0.2, 0.1]), np.array([np.sin(lean), 0, np.cos(lean)])
    frame = frames(normal[None], np.array([0.4]))
    found = records(WIDTH, frame, *seen(point[None], frame))
    for axis in np.eye(3):
        step = 0.15 * axis
        true = (light_at(point + step, normal) - light_at(point - step, normal)) / 0.3
        assert found.translation[0] @ axis == pytest.approx(true, abs=0.03)
    side = np.cross(normal, [0, 1, 0])
    turned = [normal * np.cos(angle) + side * np.sin(angle) for angle in (-0.1, 0.1)]
    true = (light_at(point, turned[1]) - light_at(point, turned[0])) / 0.2
    assert found.rotation[0] @ side == pytest.approx(true, abs=0.03)


def test_records_serve_what_is_near_and_alike():
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-1, 1, 17), np.linspace(-1, 1, 13)))
    points, normals = np.stack([x, y, 0 * x], axis=1), np.tile([0.0, 0, 1], (len(x), 1))
    frame = frames(normals, np.zeros(len(x)))
    found = records(WIDTH, frame, *seen(points, frame))
    order = np.random.default_rng(3).permutation(len(x))
    counts = []
    for error in (0.05, 0.2, 0.4):
        cache = IrradianceCache(points, normals, found, error, (0.0, np.inf))
        recorded = cache.fill(order)
        light = cache.light(recorded)
        counts.append(recorded.sum())
        assert np.array_equal(light[recorded], found.light[recorded])
        assert np.abs(light - found.light).max() < 0.15 * error * found.light.mean() + 0.01
    assert counts[0] > counts[1] > counts[2]
    away = normals * [1, 1, -1]
    other = IrradianceCache(
        np.concatenate([points, points]), np.concatenate([normals, away]),
        Records(*(np.concatenate([values, values]) for values in vars(found).values())), 0.4, (0.0, np.inf),
    )  # fmt: skip
    both = other.fill(np.arange(2 * len(x)))
    assert both[: len(x)].any() and both[len(x) :].any()
