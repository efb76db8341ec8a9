"""Light states and maps of a sun path: a state for each time of day."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import bpy
import numpy as np

from ...engine.object_message import counted
from ...engine.postprocess.reduced_groups import ReducedGroups
from ..scene.sun_path import SunPath
from .images import MARK
from .light_states import Mix, set_state_mix, state_mix


def store_sun_states(
    scene: bpy.types.Scene, path: SunPath, reduced: ReducedGroups, others: Collection[str]
) -> None:
    """Store a light state for each time of a sun path, and remove states of earlier paths.

    States of the same times keep their names, and the colors and strengths of other light groups.

    others:  names of the baked light groups that are not of the path
    """
    states = scene.hemibake.light_states
    kept = {state.sun_time: (state.name, state_mix(state)) for state in states if state.sun_time}
    for index in reversed([number for number, state in enumerate(states) if state.sun_time]):
        states.remove(index)
    for time, sun in path.groups.items():
        name, before = kept.get(time, (time, {}))
        mix = {group: before[group] for group in others if group in before}
        factors = reduced.factors[sun] if sun is not None else {}
        mix |= {each: _mix(factors.get(each, (0.0, 0.0, 0.0)), len(path.names)) for each in reduced.kept}
        state = states.add()
        state.name, state.sun_time = name, time
        set_state_mix(state, mix)
    scene.hemibake.active_light_state = max(0, min(scene.hemibake.active_light_state, len(states) - 1))


def mark_sun_maps(
    scene: bpy.types.Scene, atlases: Sequence[str], written: Collection[str], maps: Collection[str]
) -> None:
    """Mark the maps of the sun path of a bake, and remove maps of earlier paths of the same lightmaps.

    Images that the user has put in their place, and images that something else uses, stay in the .blend.

    written:  names of all maps of this bake
    maps:     names of the maps of its path; empty without a path
    """
    settings = scene.hemibake
    entries, active = settings.lightmaps, settings.active_lightmap
    chosen = entries[active].name if 0 <= active < len(entries) else ""
    for index in reversed(range(len(entries))):
        entry = entries[index]
        if entry.name in written:
            entry.of_sun_path = entry.name in maps
        elif entry.of_sun_path and entry.companion_of in atlases:
            name, image = entry.name, entry.image
            entries.remove(index)
            if image is not None and image.users == 0 and image.get(MARK) == name:
                bpy.data.images.remove(image)
    settings.active_lightmap = max(entries.find(chosen), 0)


def path_report(path: SunPath, reduced: ReducedGroups) -> str:
    """Return a sentence on the maps of a sun path for the report."""
    return (
        f"Sun path: {counted(len(path.names), 'position')} in {counted(len(reduced.kept), 'map')}, "
        f"error up to {reduced.error:.2%} of the mean light of a position."
    )


def _mix(factor: tuple[float, float, float], count: int) -> Mix:
    """Return color and strength of a group in one state.

    The maps of a path share the light of all positions, so one position needs `count` times its factor.

    factor:  scene-linear factor of the map from `ReducedGroups`
    count:   number of sun positions
    """
    values = np.array(factor, np.float64) * count
    strength = float(values.max())
    red, green, blue = (float(value) / strength for value in values) if strength > 0 else (1.0, 1.0, 1.0)
    return (red, green, blue), strength
