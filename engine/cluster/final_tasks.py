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
from .patch_rows import SentRows
from .patch_table import PatchTable, SceneTable
from .prepared_scene import prepared
from .shipment import Shipment

#: The patches of a scene, and groups of them.
Both = tuple[SceneTable, PatchTable]


def both(table: SceneTable, groups: PatchTable) -> Both:
    """Return patches and groups as one value."""
    return table, groups


def final(shipment: Shipment, tables: Both, rows: SentRows, light: HalfLight) -> np.ndarray:
    """Gather for patches from the light of groups; see `RemoteGather.final`."""
    with prepared(shipment).patches(tables[0]).working():
        return _gathered(shipment, tables, rows, light)[1]


def final_l1(shipment: Shipment, tables: Both, rows: SentRows, light: HalfLight) -> np.ndarray:
    """Return the L1 of the same light; see `RemoteGather.final_l1`."""
    with prepared(shipment).patches(tables[0]).working():
        gather, _ = _gathered(shipment, tables, rows, light)
        return np.asarray(finished(gather.gather_l1()))


def _gathered(
    shipment: Shipment, tables: Both, rows: SentRows, light: HalfLight
) -> tuple[FinalGather, np.ndarray]:
    """Return what has gathered for patches, and what."""
    scene, (table, seen) = prepared(shipment), tables
    lookers, groups = scene.patches(table).part(rows), scene.sources(seen)
    receivers = Receivers(lookers.parts, lookers.rays, np.zeros((lookers.count, 3), np.float32))
    visibility = untried_visibility(lookers.settings)
    gather, _ = final_gather(groups.job, visibility, receivers, lookers.settings)
    return gather, finished(gather.gather_from(groups.table(light)))


def light_at_samples(
    shipment: Shipment,
    table: SceneTable,
    samples: DisplaySamples,
    solved: PatchTable,
    light: HalfLight,
    how: tuple[Choice, Settings],
) -> LitSamples:
    """Return what samples gather from the light of all sources; see `display_light.light_at`.

    solved  the patches, or the groups of them, that send light out
    how     the way that was chosen for patches, and the settings of samples
    """
    (choice, settings), scene = how, prepared(shipment)
    patches, sources = scene.patches(table), scene.sources(solved)
    with patches.working():
        what = scene.display(patches, sources, choice)
        return finished(light_at(what, sources.table(light), samples, settings))
