"""Tasks that cast rays to light, or to what is near, from a block of patches."""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np

from ..direct.lighting import DirectLighting
from ..progress import Made, finished
from .prepared_scene import prepared
from .shipment import Shipment


def sampled(shipment: Shipment, first: int, last: int) -> np.ndarray:
    """Return E/pi of the light that shadow rays sample, then its L1, (last - first, 3 or 12) float32."""

    def light(lighting: DirectLighting) -> Generator[float, None, np.ndarray]:
        rgb = yield from lighting.gather()
        return np.concatenate([rgb, lighting.l1.reshape(-1, 9)], axis=1) if len(lighting.l1) else rgb

    return _cast(shipment, first, last, light)


def ambient_occlusion(shipment: Shipment, first: int, last: int) -> np.ndarray:
    """Return the open fraction of each patch's hemisphere, (last - first,) float32."""
    return _cast(shipment, first, last, DirectLighting.ambient_occlusion)


def shadow_mask(shipment: Shipment, first: int, last: int, lamp: int) -> np.ndarray:
    """Return how much of a shining lamp each patch sees, (last - first,) float32."""
    return _cast(shipment, first, last, lambda lighting: lighting.shadow_mask(lamp))


def _cast(
    shipment: Shipment, first: int, last: int, cast: Callable[[DirectLighting], Generator[float, None, Made]]
) -> Made:
    scene = prepared(shipment)
    with scene.working():
        points = scene.part(first, last)
        return finished(cast(scene.lighting.of(points.rays, points.settings)))
