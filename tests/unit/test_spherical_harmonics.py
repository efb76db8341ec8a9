"""Spherical harmonics of probes: exact quadrature, change of axes, windowing, cubes, and the fill."""

import numpy as np
import pytest

from engine import finished
from engine.errors import SceneError
from engine.probes.sphere_directions import direction_count, random_rotations, sphere_directions
from engine.probes.spherical_harmonics import (
    ambient_cube,
    basis,
    irradiance,
    windowed,
    with_axes,
)
from engine.scene.checks import check_probe_volumes
from engine.scene.probe_volume import ProbeVolume, volume_issue
from engine.validity import probe_repair
from engine.validity.probe_repair import filled, moved_out

RANDOM = np.random.default_rng(5)


def directions(count):
    found = RANDOM.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def light_from(direction):
    """Return the coefficients of light of unit power from a direction, (1, 9, 3) float32."""
    return np.repeat(basis(direction[None])[..., None], 3, axis=2).astype(np.float32)


@pytest.mark.parametrize("samples", [1, 60, 61, 300])
def test_directions_integrate_products_of_two_harmonics_exactly(samples):
    found = sphere_directions(samples)
    assert len(found) == direction_count(samples) >= samples
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(len(found)))
    products = 4 * np.pi / len(found) * basis(found).T @ basis(found)
    assert products == pytest.approx(np.eye(9), abs=1e-12)


def test_directions_cover_the_sphere_evenly():
    nearest = (directions(2000) @ sphere_directions(300).T).max(axis=1)
    assert np.degrees(np.arccos(nearest)).max() < 13


def test_rotations_are_unit_and_repeatable():
    found = random_rotations(1001, 3)
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(1001), rel=1e-6)
    assert (found == random_rotations(1001, 3)).all() and (found != random_rotations(1001, 4)).any()
    assert np.abs(found.mean(axis=0)).max() < 0.1


def test_irradiance_is_the_mean_of_a_constant_and_the_cosine_of_a_lobe():
    normals = directions(11)
    constant = np.zeros((1, 9, 3), np.float32)
    constant[:, 0] = np.sqrt(4 * np.pi) * np.array([1, 2, 3])
    assert irradiance(constant, normals)[0] == pytest.approx(np.tile([1.0, 2, 3], (11, 1)))
    found = irradiance(light_from(normals[0]), normals)[0, :, 0]
    cosine = normals @ normals[0]
    expected = (1 / 4 + cosine / 2 + 5 / 16 * (3 * cosine**2 - 1) / 2) / np.pi
    assert found == pytest.approx(expected, abs=1e-6)


def test_axes_change_like_directions():
    """The y-up axes of engines: x, z, -y."""
    axes, way = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), directions(1)[0]
    assert with_axes(light_from(way), axes) == pytest.approx(light_from(axes @ way), abs=1e-6)


def test_windows_remove_negative_irradiance_only_where_it_is():
    sun, soft = light_from(directions(1)[0]), light_from(directions(1)[0])
    soft[:, 0] += 1
    both = np.concatenate([soft, sun])
    found = windowed(both)
    assert (found[0] == soft[0]).all() and (found[1, 0] == sun[0, 0]).all()
    normals = sphere_directions(6000)
    assert irradiance(both, normals)[1].min() < -0.01
    assert irradiance(found, normals).min() > -1e-3 * irradiance(found, normals).max()
    assert np.abs(found[1, 4:]).sum() > 0.1 * np.abs(sun[0, 4:]).sum()


def test_cubes_and_one_band_follow_from_two_bands():
    way = directions(1)[0]
    cube = ambient_cube(light_from(way))
    normals = np.concatenate([np.eye(3)[[i, i]] * [[1], [-1]] for i in range(3)])
    assert cube[0, :, 0] == pytest.approx(
        np.maximum(irradiance(light_from(way), normals)[0, :, 0], 0), abs=1e-6
    )


def test_a_fill_reaches_all_probes_and_keeps_valid_ones():
    volume = ProbeVolume("Volume", np.diag([3.0, 2.0, 1.0, 1.0]), (3, 5, 2))
    light, valid = RANDOM.random((30, 9, 3)).astype(np.float32), np.zeros(30, bool)
    valid[[7, 29]] = True
    found = finished(filled(light, valid, volume))
    assert (found[valid] == light[valid]).all()
    assert (found >= light[valid].min(axis=0)).all() and (found <= light[valid].max(axis=0)).all()
    assert (finished(filled(light, np.zeros(30, bool), volume)) == light).all()


def test_a_fill_is_the_mean_of_nearest_neighbours_ring_by_ring(monkeypatch):
    """Against a plain loop over all probes, with a few filled at once, which progress is reported after."""
    monkeypatch.setattr(probe_repair, "_AT_ONCE", 7)
    volume = ProbeVolume("Volume", np.diag([3.0, 2.0, 1.0, 1.0]), (5, 7, 3))
    light = RANDOM.random((105, 9, 3)).astype(np.float32)
    valid = np.zeros(105, bool)
    valid[[0, 52, 53, 104]] = True
    cells = np.stack(np.unravel_index(np.arange(105), (3, 7, 5))[::-1], axis=1)
    expected, known = light.astype(np.float64), valid.copy()
    while not known.all():
        ring = {}
        for probe in np.flatnonzero(~known):
            steps = np.abs(cells - cells[probe])
            beside = np.flatnonzero((steps.max(axis=1) == 1) & known)
            if len(beside):
                distances = np.square((cells[beside] - cells[probe]) @ volume.steps).sum(axis=1)
                ring[probe] = np.average(expected[beside], axis=0, weights=1 / distances)
        for probe, value in ring.items():
            expected[probe], known[probe] = value, True
    steps = filled(light, valid, volume)
    progress = []
    while True:
        try:
            progress.append(next(steps))
        except StopIteration as end:
            found = end.value
            break
    assert found == pytest.approx(expected, rel=1e-5)
    assert len(progress) > 101 / 7 and progress == sorted(progress) and progress[-1] <= 1


def test_probes_move_only_within_their_cells():
    turn = np.eye(4)
    turn[:2, :2] = [[0, -2], [2, 0]]
    volume = ProbeVolume("Volume", turn, (2, 2, 4))
    ways = np.array([[0.4, 0, 0], [0, 1.2, 0], [0, 0, 0.3], [0, 0, 0]], np.float32)
    offsets, stays = moved_out(volume, ways, np.array([0.4, 1.2, 0.3, np.inf], np.float32))
    assert stays.tolist() == [True, False, False, False]
    assert offsets[0] == pytest.approx([0.4 + 0.05 * 0.5, 0, 0])


@pytest.mark.parametrize(
    ("scale", "resolution", "words"),
    [
        ((1, 1, 1), (4, 0, 4), "at least 1"),
        ((1, 0, 1), (4, 4, 4), "flat"),
        ((1, -1, 1), (4, 4, 4), "mirrored"),
        ((1, 1, 1), (500, 500, 400), "Lower its resolution"),
        ((1, np.nan, 1), (4, 4, 4), "Clear"),
    ],
)
def test_bad_volumes_are_errors_with_a_remedy(scale, resolution, words):
    volume = ProbeVolume("Grid", np.diag([*scale, 1.0]), resolution)
    assert words in volume_issue(volume)
    with pytest.raises(SceneError, match="Light Probe Volume 'Grid': "):
        check_probe_volumes([volume])


def test_a_rotated_and_scaled_volume_is_good():
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0]
    matrix[:3, 0] *= np.sign(np.linalg.det(matrix[:3, :3])) * 0.01
    volume = ProbeVolume("Grid", matrix, (7, 1, 3))
    assert volume_issue(volume) is None
    inside = (volume.points() - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    assert len(inside) == 21 and np.abs(inside).max() < 1
    assert inside[1] - inside[0] == pytest.approx([2 / 7, 0, 0])
