import numpy as np
import pytest

from engine.visibility.views.hemicube import face_axes, face_rows, frames, matrices, multiplier_map, rotations


@pytest.mark.parametrize("n", [8, 16, 32, 64, 128, 256])
def test_multiplier_map_sums_to_one_in_float32(n):
    weights = multiplier_map(n)
    assert weights.shape == (3 * n, n) and weights.dtype == np.float32
    assert abs(float(weights.sum(dtype=np.float64)) - 1) < 1e-6
    assert (weights > 0).all()


def test_multiplier_map_sums_over_the_faces():
    weights = multiplier_map(64).astype(np.float64)
    weights_of_faces = [weights[row : row + rows].sum() for row, rows in face_rows(64)]
    np.testing.assert_allclose(weights_of_faces, [0.5541264240] + 4 * [0.1114683940], rtol=1e-6)


def test_multiplier_map_is_close_to_delta_form_factors():
    n = 128
    x = (np.arange(n) + 0.5) / n * 2 - 1
    delta = (2 / n) ** 2 / (np.pi * (x[None] ** 2 + x[:, None] ** 2 + 1) ** 2)
    np.testing.assert_allclose(multiplier_map(n)[:n], delta, rtol=3e-4)


def test_rotations_are_constant_and_uniform():
    angles = rotations(7, np.arange(20000))
    assert (angles == rotations(7, np.arange(20000))).all()
    assert (angles != rotations(8, np.arange(20000))).any()
    assert angles.min() >= -np.pi and angles.max() < np.pi
    counts, _ = np.histogram(angles, bins=16, range=(-np.pi, np.pi))
    assert abs(counts / 1250 - 1).max() < 0.12


def test_frames_are_right_handed_and_keep_the_normal():
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(500, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[0], normal[1] = (0, 0, 1), (0, 0, -1)
    frame = frames(normal, rng.uniform(-np.pi, np.pi, 500))
    products = np.einsum("nij,nkj->nik", frame, frame)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), (500, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame), 1, atol=1e-12)
    np.testing.assert_allclose(frame[:, 2], normal, atol=1e-12)


def test_every_face_has_the_same_handedness():
    axes = face_axes(frames(np.array([[0.6, 0.0, 0.8]]), np.array([0.3])))[0]
    np.testing.assert_allclose(np.cross(axes[:, 0], axes[:, 1]), axes[:, 2], atol=1e-12)


def test_matrices_project_directions_onto_their_faces():
    frame = frames(np.array([[0.0, 0.0, 1.0]]), np.zeros(1))
    eye = np.array([[1.0, 2.0, 3.0]])
    clip = matrices(frame, eye, np.array([0.01]), True)[0]
    right, up, normal = frame[0]

    # The horizon is the lower border of a side face, 45 degrees its upper border and the top's border.
    horizon, corner = eye[0] + 5 * right, eye[0] + 5 * right + 5 * normal
    x, y, z, w = clip[1] @ np.append(horizon, 1)
    assert (x, y / w, w) == pytest.approx((0, -1, 5), abs=1e-5) and z / w == pytest.approx(0.01 / 5)
    assert (clip[1] @ np.append(corner, 1))[1] == pytest.approx(5, abs=1e-5)
    top = clip[0] @ np.append(corner, 1)
    assert (top[0] / top[3], top[1] / top[3]) == pytest.approx((1, 0), abs=1e-5)
    assert (clip[0] @ np.append(eye[0] + 2 * normal + up, 1))[1] == pytest.approx(1, abs=1e-5)
