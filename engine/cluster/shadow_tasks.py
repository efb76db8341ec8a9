"""Shadow ray tasks for a block of patches: direct light, ambient occlusion and shadow masks."""

from __future__ import annotations

from collections.abc import Callable, Generator

import numpy as np

from ..direct.lighting import DirectLighting
from ..progress import Made, finished
from .patch_rows import SentRows
from .patch_table import SceneTable
from .prepared_scene import prepared
from .scene_payload import ScenePayload


def sampled(shipment: ScenePayload, table: SceneTable, rows: SentRows) -> np.ndarray:
    """Return E/pi of the light sampled by shadow rays, then its L1, (m, 3 or 12) float32."""

    def light(lighting: DirectLighting) -> Generator[float, None, np.ndarray]:
        rgb = yield from lighting.gather()
        return np.concatenate([rgb, lighting.l1.reshape(-1, 9)], axis=1) if len(lighting.l1) else rgb

    return _cast(shipment, table, rows, light)


def ambient_occlusion(shipment: ScenePayload, table: SceneTable, rows: SentRows) -> np.ndarray:
    """Return the unoccluded fraction of each patch's hemisphere, (m,) float32."""
    return _cast(shipment, table, rows, DirectLighting.ambient_occlusion)


def shadow_mask(shipment: ScenePayload, table: SceneTable, rows: SentRows, lamp: int) -> np.ndarray:
    """Return the visible fraction of a light for each patch, (m,) float32."""
    return _cast(shipment, table, rows, lambda lighting: lighting.shadow_mask(lamp))


def _cast(
    shipment: ScenePayload,
    table: SceneTable,
    rows: SentRows,
    cast: Callable[[DirectLighting], Generator[float, None, Made]],
) -> Made:
    patches = prepared(shipment).patches(table)
    with patches.working():
        points = patches.part(rows)
        return finished(cast(patches.lighting.of(points.rays, points.settings)))
