"""Tasks for light probes: the values of consecutive probes of a volume."""

from __future__ import annotations

from ..plan.solver_choice import SolverChoice
from ..probes.probe_blocks import ProbePart
from ..probes.sent_light import SentRadiance
from ..progress import finished
from .blocks import Span
from .patch_table import SceneTable
from .prepared_scene import prepared
from .scene_payload import ScenePayload


def light_at_probes(
    shipment: ScenePayload,
    table: SceneTable,
    light: SentRadiance,
    choice: SolverChoice,
    volume: int,
    span: Span,
) -> ProbePart:
    """Gather light at consecutive probes of a volume.

    volume:  index into `Scene.probe_volumes`
    span:    first probe, and the end
    """
    scene = prepared(shipment)
    patches = scene.patches(table)
    with patches.working():
        gather = patches.probes(light, choice)
        return finished(gather.part(volume, *span))
