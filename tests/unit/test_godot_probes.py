"""Probes for Godot: the tree finds the tetrahedron of any point, which interpolates linearly."""

import numpy as np
import pytest

from engine.probes.godot_probes import Y_UP, godot_probes
from engine.scene.probe_volume import ProbeVolume

RANDOM = np.random.default_rng(9)


def found(probes, point):
    """Return the tetrahedron that Godot finds for a point (LightStorage::lightmap_tap_sh_light)."""
    planes = probes.bsp[:, :4].copy().view(np.float32)
    node = 0
    while node >= 0:
        over = planes[node, :3] @ point > planes[node, 3]
        child = int(probes.bsp[node, 4 if over else 5])
        assert child < 0 or child > node
        node = child
    return probes.tetrahedra[-node - 1]


def weights(corners, point):
    """Return the barycentric coordinates of a point in a tetrahedron."""
    system = np.concatenate([corners.T, np.ones((1, 4))])
    return np.linalg.solve(system, np.append(point, 1))


@pytest.mark.parametrize("resolution", [(4, 3, 5), (2, 1, 3), (1, 1, 1)])
def test_the_tree_finds_the_tetrahedron_of_each_point(resolution):
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(RANDOM.normal(size=(3, 3)))[0] @ np.diag([2.0, 1.0, 0.5])
    matrix[:3, 3] = [5, -7, 3]
    volume = ProbeVolume("Volume", matrix, resolution)
    slope = RANDOM.random(3) * (np.array(resolution) > 1)
    along = volume.points() @ np.linalg.inv(matrix[:3, :3]).T @ slope
    coefficients = np.zeros((volume.count, 9, 3), np.float32)
    coefficients[:, 0] = along[:, None]
    probes = godot_probes(coefficients, resolution, matrix)
    assert len(probes.sh) == 9 * len(probes.points)
    low, high = probes.bounds[0], probes.bounds.sum(axis=0)
    box = np.array(list(np.ndindex(2, 2, 2))) * 2 - 1
    corners = (box @ matrix[:3, :3].T + matrix[:3, 3]) @ Y_UP.T
    assert low == pytest.approx(corners.min(axis=0)) and high == pytest.approx(corners.max(axis=0))
    outermost = 1 - 1 / np.array(resolution)
    for unit in RANDOM.uniform(-0.98, 0.98, (60, 3)):
        blender = matrix[:3, :3] @ unit + matrix[:3, 3]
        corners = found(probes, Y_UP @ blender)
        mix = weights(probes.points[corners].astype(np.float64), Y_UP @ blender)
        assert mix.min() > -1e-3
        value = mix @ probes.sh.reshape(-1, 9, 3)[corners, 0, 0]
        nearest = matrix[:3, :3] @ np.clip(unit, -outermost, outermost) + matrix[:3, 3]
        expected = nearest @ np.linalg.inv(matrix[:3, :3]).T @ slope / np.pi
        assert value == pytest.approx(expected, abs=2e-3)


def test_each_cell_has_its_nodes_and_tetrahedra_once():
    """All tetrahedra fill the box, and all nodes but the first are the child of one node."""
    probes = godot_probes(np.ones((5 * 7 * 3, 9, 3), np.float32), (5, 7, 3), np.diag([2.5, 3.5, 1.5, 1.0]))
    cells = 6 * 8 * 4
    assert probes.bsp.shape == (cells - 1 + 5 * cells, 6) and probes.tetrahedra.shape == (6 * cells, 4)
    children = np.sort(probes.bsp[:, 4:].ravel())
    assert (children == [n for n in range(-6 * cells, 6 * cells - 1) if n]).all()
    corners = probes.points[probes.tetrahedra].astype(np.float64)
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    assert volumes == pytest.approx(np.full(6 * cells, 1 / 6))
