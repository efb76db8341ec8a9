"""Radiance in half floats with a common exponent, for any brightness."""

import numpy as np
import pytest

from engine.device.buffers import download, upload_float4
from engine.gather.half_radiance import HalfRadiance


@pytest.mark.parametrize("brightest", [1e-25, 3e-7, 1.0, 7e4, 1e30])
def test_rounding_is_relative(compute, brightest):
    steps = np.geomspace(1e-8, 1, 997).astype(np.float32)
    radiance = np.float32(brightest) * np.stack([steps, steps[::-1], np.zeros_like(steps)], axis=1)
    sent = HalfRadiance.of(compute, upload_float4(compute, radiance, first=1, last=1), len(radiance))
    assert sent.parts.nbytes == 6 * len(radiance)
    table = download(compute, sent.table(compute), (len(radiance) + 2, 4))
    assert not table[0].any() and not table[-1].any() and not table[:, 3].any()
    assert np.allclose(table[1:-1, :3], radiance, rtol=2**-11, atol=1e-11 * brightest)


def test_no_light_stays_none(compute):
    dark = HalfRadiance.of(compute, upload_float4(compute, np.zeros((5, 3), np.float32), first=1, last=1), 5)
    assert not download(compute, dark.table(compute), (7, 4)).any()
