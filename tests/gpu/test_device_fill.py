"""One kernel fills small images at all scales, with the bits of a kernel for each scale."""

import numpy as np
import pytest

from engine.device.buffers import download, upload
from engine.postprocess import device_fill
from engine.postprocess.device_fill import DeviceFill


def filled(compute, monkeypatch, shape, small, known_part):
    """Return filled images of three outputs, (3, *shape, 4) float32.

    small:  see `_SMALL`; None for a CPU, which has a kernel for each scale
    """
    monkeypatch.setattr(type(compute), "processor", small is None)
    monkeypatch.setattr(device_fill, "_SMALL", small)
    random = np.random.default_rng(shape[1])
    known = random.random(shape) < known_part
    surface, inside = known & (random.random(shape) < 0.5), known | (random.random(shape) < 0.2)
    masks = (upload(compute, mask) for mask in (known, surface, inside))
    fill = DeviceFill(compute, shape, *masks, 2, 11)
    images = random.random((3, *shape, 4)).astype(np.float32)
    buffer = upload(compute, images)
    for outputs in (1, 3):
        fill.fill(buffer, outputs)
    return download(compute, buffer, images.shape)


@pytest.mark.parametrize(
    "shape", [(2, 67, 67), (1, 131, 131), (3, 19, 19), (1, 64, 64), (2, 33, 33), (1, 1, 1)]
)
@pytest.mark.parametrize("known_part", [0.0, 0.03, 0.5])
def test_small_images_are_filled_at_once(compute, monkeypatch, shape, known_part):
    single = filled(compute, monkeypatch, shape, None, known_part)
    for small in (1, 5, 32, 200):
        assert np.array_equal(filled(compute, monkeypatch, shape, small, known_part), single)
