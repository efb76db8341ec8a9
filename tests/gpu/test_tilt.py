"""The polynomials of kernels/visibility/irradiance_l1.cl are the least-squares fit that they stand for."""

import numpy as np
import pytest

from engine.device.buffers import download, upload_float4, zeros
from tests.analytic.tilts import fitted

_PROBE = """
__kernel void probe(__global const float4 *directions, __global const float4 *normals, __global float4 *tilts)
{
    const int i = get_global_id(0);
    tilts[i] = (float4)(l1_of_direction(directions[i].xyz, normals[i].xyz), 0.0f);
}
"""


def tilts(compute, directions, normals, monkeypatch):
    """Return `l1_of_direction` of kernels/visibility/irradiance_l1.cl, (n, 3)."""
    from engine.device import cl_device as module

    real = module.program_source
    monkeypatch.setattr(
        module, "program_source", lambda parts: real(parts) + _PROBE * ("irradiance_l1.cl" in parts)
    )
    (probe,) = compute.kernels("irradiance_l1.cl", "probe", options=("-DDIRECTIONAL",))
    result = zeros(compute, 16 * len(directions))
    arrays = (upload_float4(compute, values.astype(np.float32)) for values in (directions, normals))
    probe(compute.queue, (len(directions),), None, *arrays, result)
    return download(compute, result, (len(directions), 4))[:, :3]


def test_polynomials_are_the_fit(compute, monkeypatch):
    """Weighted as a gather does; lengths of directions do not count."""
    cosine = (np.arange(101) + 0.5) / 101
    light = np.stack([np.sqrt(1 - cosine**2), np.zeros(101), cosine], axis=1)
    normals = np.tile([0.0, 0, 1], (101, 1))
    made, exact = tilts(compute, 7 * light, normals, monkeypatch), fitted(light) / cosine[:, None]
    off = np.sqrt((cosine[:, None] * (made - exact) ** 2).sum(axis=0) / cosine.sum())
    assert off == pytest.approx(np.zeros(3), abs=0.01) and np.abs(made[50:] - exact[50:]).max() < 0.02


def test_tilts_turn_with_normal_and_light(compute, monkeypatch):
    random = np.random.default_rng(5)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    light = random.normal(size=(13, 3))
    light[:, 2] = np.abs(light[:, 2])
    normals = np.tile([0.0, 0, 1], (13, 1))
    plain = tilts(compute, light, normals, monkeypatch)
    turned = tilts(compute, light @ turn.T, normals @ turn.T, monkeypatch)
    assert turned == pytest.approx(plain @ turn.T, abs=1e-4)
