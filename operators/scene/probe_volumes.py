"""Reads Blender's Light Probe Volume objects as probe volumes of the engine."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...engine.scene.probe_volume import MAX_PROBES, ProbeVolume, volume_issue
from .light_probes import is_light_probe, matrix_from, visible_light_probes
from .scene_context import SceneContext


def is_probe_volume(obj: bpy.types.Object) -> bool:
    """Return True for a Light Probe Volume object."""
    return is_light_probe(obj, "VOLUME")


def read_probe_volumes(
    context: SceneContext, origin: np.ndarray, notes: list[str]
) -> tuple[ProbeVolume, ...]:
    """Return the volumes that renders show, if the scene's bake includes light probes.

    Volumes that cannot be baked are left out; a note names each with the remedy.

    origin:  (3,) float64, world space: the point to which positions are relative
    """
    if not context.scene.hemibake.light_probes:
        return ()
    found = [_volume(obj, origin) for obj in visible_light_probes(context, "VOLUME")]
    if not found:
        notes.append("Light Probes: the scene has no Light Probe Volume. Add one with Add Light Probes.")
    return tuple(_usable(found, notes))


def count_probes(context: SceneContext) -> int:
    """Return the number of light probes of a bake of the scene."""
    if not context.scene.hemibake.light_probes:
        return 0
    volumes = [_volume(obj, np.zeros(3)) for obj in visible_light_probes(context, "VOLUME")]
    return sum(volume.count for volume in _usable(volumes, []))


def _usable(volumes: Sequence[ProbeVolume], notes: list[str]) -> list[ProbeVolume]:
    """Return the volumes that can be baked; append a note about each of the others."""
    usable, count = list[ProbeVolume](), 0
    for volume in volumes:
        issue = volume_issue(volume)
        if issue is None and count + volume.count > MAX_PROBES:
            issue = f"all volumes together exceed {MAX_PROBES:,} probes. Lower their resolutions."
        if issue is None:
            usable.append(volume)
            count += volume.count
        else:
            notes.append(f"Light Probe Volume '{volume.name}': {issue}")
    return usable


def _volume(obj: bpy.types.Object, origin: np.ndarray) -> ProbeVolume:
    """Return the engine's volume of an object; its box reaches from -1 to 1 along the object's axes."""
    data = obj.data
    return ProbeVolume(
        obj.name, matrix_from(obj, origin), (data.resolution_x, data.resolution_y, data.resolution_z)
    )
