"""Final gather tasks: from a converged solution, for a block of patches or for texel samples."""

from __future__ import annotations

import numpy as np

from ..device.device_array import rows_of
from ..gather.gather_pass import GatherPass
from ..gather.half_radiance import HalfRadiance
from ..plan.gathered_samples import GatheredSamples
from ..plan.receivers import Receivers, final_gather
from ..plan.solver_choice import SolverChoice
from ..plan.visibility_trial import untried_visibility
from ..postprocess.texel_samples import TexelSamples
from ..progress import finished
from ..settings import Settings
from ..texel_gather.texel_sample_gather import gather_at
from .patch_rows import SentRows
from .patch_table import PatchTable, SceneTable
from .prepared_scene import prepared
from .scene_payload import ScenePayload

#: Table of the scene's patches, and table of the solved patches or groups.
Both = tuple[SceneTable, PatchTable]


def both(table: SceneTable, groups: PatchTable) -> Both:
    """Return both tables as one value."""
    return table, groups


def final(shipment: ScenePayload, tables: Both, rows: SentRows, light: HalfRadiance) -> np.ndarray:
    """Return the final gather of a block of patches from the radiance of groups, (m, 4) float32."""
    with prepared(shipment).patches(tables[0]).working():
        return _gathered(shipment, tables, rows, light)[1]


def final_l1(shipment: ScenePayload, tables: Both, rows: SentRows, light: HalfRadiance) -> np.ndarray:
    """Return the irradiance gradients (L1) of the final gather of a block, (m, 3, 3) float32."""
    with prepared(shipment).patches(tables[0]).working():
        gather, _ = _gathered(shipment, tables, rows, light)
        return np.asarray(finished(gather.gather_l1()))


def _gathered(
    shipment: ScenePayload, tables: Both, rows: SentRows, light: HalfRadiance
) -> tuple[GatherPass, np.ndarray]:
    """Return the gather pass of a block, and the light that it gathered."""
    scene, (table, seen) = prepared(shipment), tables
    receivers_job, groups = scene.patches(table).part(rows), scene.sources(seen)
    receivers = Receivers(
        receivers_job.patch_scene, receivers_job.rays, np.zeros((receivers_job.count, 3), np.float32)
    )
    visibility = untried_visibility(receivers_job.settings)
    gather, _ = final_gather(groups.job, visibility, receivers, receivers_job.settings)
    return gather, rows_of(finished(gather.gather_from(groups.table(light))))


def light_at_samples(
    shipment: ScenePayload,
    table: SceneTable,
    samples: TexelSamples,
    solved: PatchTable,
    light: HalfRadiance,
    how: tuple[SolverChoice, Settings],
) -> GatheredSamples:
    """Gather light at texel samples from all sources.

    solved:  table of the sources: patches or patch groups
    how:     tuple of the solver choice for the patches and the settings for the samples
    """
    (choice, settings), scene = how, prepared(shipment)
    patches, sources = scene.patches(table), scene.sources(solved)
    with patches.working():
        texel_job = scene.display(patches, sources, choice)
        return finished(gather_at(texel_job, sources.table(light), samples, settings))
