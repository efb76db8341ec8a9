"""Tasks that gather once from light that has settled: for a block of patches, and at points of texels."""

from __future__ import annotations

import numpy as np

from ..finish.display_samples import DisplaySamples
from ..gather.final_gather import FinalGather
from ..gather.half_light import HalfLight
from ..plan.choice import Choice
from ..plan.display_light import light_at
from ..plan.lit_samples import LitSamples
from ..plan.receivers import Receivers, final_gather
from ..plan.trial import untried_visibility
from ..progress import finished
from ..settings import Settings
from .prepared_scene import PreparedScene, prepared
from .shipment import Shipment
from .squares import Squares


def final(shipment: Shipment, first: int, last: int, squares: Squares, light: HalfLight) -> np.ndarray:
    """Gather for patches from the light of groups; see `RemoteGather.final`."""
    scene = prepared(shipment)
    with scene.working():
        return _gathered(scene, squares, (first, last), light)[1]


def final_l1(shipment: Shipment, first: int, last: int, squares: Squares, light: HalfLight) -> np.ndarray:
    """Return the L1 of the same light; see `RemoteGather.final_l1`."""
    scene = prepared(shipment)
    with scene.working():
        gather, _ = _gathered(scene, squares, (first, last), light)
        return np.asarray(finished(gather.gather_l1()))


def _gathered(
    scene: PreparedScene, squares: Squares, span: tuple[int, int], light: HalfLight
) -> tuple[FinalGather, np.ndarray]:
    """Return what has gathered for patches, and what."""
    lookers, groups = scene.part(*span), scene.sources(squares)
    receivers = Receivers(lookers.parts, lookers.rays, np.zeros((lookers.count, 3), np.float32))
    visibility = untried_visibility(lookers.settings)
    gather, _ = final_gather(groups.job, visibility, receivers, lookers.settings)
    return gather, finished(gather.gather_from(groups.table(light)))


def light_at_samples(
    shipment: Shipment,
    samples: DisplaySamples,
    squares: Squares | None,
    light: HalfLight,
    how: tuple[Choice, Settings],
) -> LitSamples:
    """Return what samples gather from the light of all sources; see `display_light.light_at`.

    how: the way that was chosen for patches, and the settings of samples
    """
    (choice, settings), scene = how, prepared(shipment)
    with scene.working():
        radiance = scene.sources(squares).table(light)
        return finished(light_at(scene.display(squares, choice), radiance, samples, settings))
