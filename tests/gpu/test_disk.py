"""The disk mapping on the device equals sine and cosine."""

import numpy as np

from engine.device import cl_device as module
from engine.device.buffers import download, upload, zeros
from engine.device.cl_device import ComputeDevice
from engine.visibility.rays.receiver_records import RECEIVER

_PROBE = """
__kernel void probe(__global const float2 *square, __global float2 *points)
{
    points[get_global_id(0)] = disk(square[get_global_id(0)]);
}
"""


def test_points_of_the_square_lie_on_the_disk_by_area(compute: ComputeDevice, monkeypatch) -> None:
    """Also at whole quarters and eighths of a turn, several turns on, in the middle and on the rim."""
    real = module.program_source
    monkeypatch.setattr(
        module, "program_source", lambda parts: real(parts) + _PROBE * ("receiver.cl" in parts)
    )
    random = np.random.default_rng(3)
    square = random.random((10_007, 2), np.float32)
    square[:800, 1] = np.arange(800) / 16
    square[::7, 0], square[::11, 0] = 0, 1
    (probe,) = compute.kernels((RECEIVER, "receiver.cl"), "probe")
    points = zeros(compute, 8 * len(square))
    probe(compute.queue, (len(square),), None, upload(compute, square), points)
    angle, radius = 2 * np.pi * square[:, 1].astype(float), np.sqrt(square[:, 0].astype(float))
    expected = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(download(compute, points, (len(square), 2)), expected, atol=2e-7)
