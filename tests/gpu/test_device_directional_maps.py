"""Maps of directions of the OpenCL device are those of NumPy."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Settings
from engine.device.buffers import upload
from engine.device.cl_device import ComputeDevice
from engine.device.device_array import DeviceArray
from engine.gather.device_l1 import DeviceL1
from engine.postprocess.directional_maps import maps_of_directions
from engine.visibility.rays.receiver_records import RECEIVER


class Geometry:
    """Normals alone."""

    def __init__(self, normal: np.ndarray) -> None:
        self.normal = normal


@pytest.mark.parametrize("outputs", [("directional", "dominant_direction"), ("spherical_harmonics",)])
@pytest.mark.parametrize("count", [1, 613])
def test_maps_of_directions(compute: ComputeDevice, outputs: tuple[str, ...], count: int) -> None:
    """Some points are black, others lit on one channel or from behind; light is three of four columns."""
    random = np.random.default_rng(count)
    normal = random.normal(size=(count, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    gathered = random.lognormal(0, 2, (count, 4)).astype(np.float32)
    sampled, other = random.normal(0, 0.5, (2, count, 3, 3)).astype(np.float32)
    dark = random.random(count) < 0.2
    gathered[dark], sampled[dark], other[dark] = 0, 0, 0
    gathered[::7, 1:] = 0
    records, wide = RECEIVER.array(count), np.zeros((count, 3, 4), np.float32)
    records["normal"], wide[..., :3] = normal, other
    on_device = DeviceL1(compute, upload(compute, wide), upload(compute, records), count)
    np.testing.assert_array_equal(np.asarray(on_device), other)
    settings = replace(Settings(), outputs=("combined", *outputs))
    given = settings, gathered[:, :3], sampled
    made = maps_of_directions(*given, on_device, Geometry(normal))
    expected = maps_of_directions(*given, other, Geometry(normal))
    assert list(made) == list(expected) and all(isinstance(light, DeviceArray) for light in made.values())
    for name, light in made.items():
        np.testing.assert_allclose(np.asarray(light), expected[name], rtol=2e-5, atol=2e-5, err_msg=name)
        assert not np.asarray(light)[dark].any() and np.asarray(light).any()
