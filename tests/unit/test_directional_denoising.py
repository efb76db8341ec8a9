"""Directional maps go through a filter of light as differences of lights."""

import numpy as np
import pytest

from engine.postprocess.directional_denoising import encode_signed_maps, restored_maps
from engine.postprocess.directional_maps import directional_maps, dominant_direction, projected_maps

RANDOM = np.random.default_rng(8)
SHAPE = (2, 7, 11)


def unit(shape=SHAPE) -> np.ndarray:
    """Return random directions."""
    vectors = RANDOM.normal(size=(*shape, 3)).astype(np.float32)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def maps(projected: bool) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return combined and directional maps of random light, some of it black, and the normals."""
    normals, light = unit(), RANDOM.uniform(0, 3, (*SHAPE, 3)).astype(np.float32)
    light[0, 2] = 0
    sums = unit()[..., None] * light[..., None, :] * (0.6 if projected else 2.0)
    make = projected_maps if projected else directional_maps
    if projected:
        sums += normals[..., None] * light[..., None, :]
    flat = (light.reshape(-1, 3), sums.reshape(-1, 3, 3), normals.reshape(-1, 3))
    made = make(*flat)
    if not projected:
        made["dominant_direction"] = dominant_direction(*flat[:2])
    return {"combined": light, **{name: values.reshape(*SHAPE, 3) for name, values in made.items()}}, normals


@pytest.mark.parametrize("projected", [False, True])
@pytest.mark.parametrize("exposure", [1.0, 0.37])
def test_maps_are_restored_as_the_filter_leaves_light(projected, exposure):
    """A filter that only makes light darker: what is in parts of light stays, all else gets darker, too."""
    known, normals = maps(projected)
    light = {"combined": known["combined"], **encode_signed_maps(known)}
    assert all((image >= 0).all() for image in light.values())
    restored = restored_maps(known, {name: exposure * image for name, image in light.items()}, normals)
    assert restored.keys() == known.keys() - {"combined"}
    for name, values in restored.items():
        in_parts = name == "dominant_direction" or name.startswith("SH L1")
        expected = known[name] * (1 if in_parts else exposure)
        expected = np.where(known["combined"].any(axis=-1, keepdims=True), expected, 0)
        assert values == pytest.approx(expected, abs=2e-5), name


def test_light_alone_has_nothing_to_carry():
    image = np.ones((*SHAPE, 3), np.float32)
    assert encode_signed_maps({"combined": image, "direct": image}) == {}
    assert restored_maps({"combined": image}, {"combined": image}, image) == {}
