"""Light states of a scene: named sets of a color and a strength for each light group.

A group that a state leaves out has color white and strength 1.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

import bpy
import numpy as np

from ...engine.errors import EngineError
from ..working_space import to_rec709
from .destination import Destination
from .manifest import read_manifest
from .object_files import is_own

#: Color, linear RGB in the working space, and strength of a light group.
Mix = tuple[tuple[float, float, float], float]

#: Color and strength of a group that a state leaves out.
UNCHANGED: Mix = ((1.0, 1.0, 1.0), 1.0)

_MISSING = (
    "State '{}': the last bake has no light group '{}'. Rename it, remove it from the state, or bake it."
)


def baked_groups(scene: bpy.types.Scene) -> list[str]:
    """Return the light groups that the last bakes of the scene's lightmaps wrote, in their order."""
    listed = [entry.light_groups for entry in scene.hemibake.lightmaps if entry.light_groups]
    return list(dict.fromkeys(name for names in listed for name in json.loads(names)))


def find_state(scene: bpy.types.Scene, name: str) -> bpy.types.PropertyGroup:
    """Return the light state with a name, or of a time of the sun path; raises EngineError."""
    states = scene.hemibake.light_states
    state = states.get(name) or next((other for other in states if name and other.sun_time == name), None)
    if state is None:
        known = ", ".join(f"'{other.name}'" for other in states) or "none"
        raise EngineError(f"Scene '{scene.name}': no light state '{name}'. Choose one of: {known}.")
    return state


def active_state(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """Return the light state that is chosen in the list; None in an empty one."""
    settings = scene.hemibake
    if 0 <= settings.active_light_state < len(settings.light_states):
        return settings.light_states[settings.active_light_state]
    return None


def state_mix(state: bpy.types.PropertyGroup) -> dict[str, Mix]:
    """Return color and strength of each group of a state."""
    return {group.name: (tuple(group.color), group.strength) for group in state.groups}


def set_state_mix(state: bpy.types.PropertyGroup, mix: Mapping[str, Mix]) -> None:
    """Replace the groups of a state; negative colors and strengths become 0."""
    state.groups.clear()
    for name, (color, strength) in mix.items():
        group = state.groups.add()
        group.name, group.color, group.strength = name, color, strength


def missing_groups(scene: bpy.types.Scene, state: bpy.types.PropertyGroup) -> list[str]:
    """Return a message for each group of a state without maps in the last bake."""
    known = baked_groups(scene)
    return [_MISSING.format(state.name, group.name) for group in state.groups if group.name not in known]


def factors(state: bpy.types.PropertyGroup) -> dict[str, list[float]]:
    """Return strength x color of each group of a state, scene-linear, 7 digits."""
    return {group.name: _digits(np.array(group.color, np.float64) * group.strength) for group in state.groups}


def _digits(values: np.ndarray) -> list[float]:
    return [float(f"{max(0.0, value):.7g}") for value in values]


def manifest_states(scene: bpy.types.Scene) -> dict[str, dict[str, list[float]]]:
    """Return the factors of all states of a scene by name, linear Rec.709, not negative, for the manifest.

    In another working space, a factor with color has the right product only for white light.
    """
    return {
        state.name: {name: _digits(to_rec709(np.array(values))) for name, values in factors(state).items()}
        for state in scene.hemibake.light_states
    }


def states_section(states: Mapping[str, dict], destination: Destination) -> dict[str, dict]:
    """Return the section of the manifest for the light states of a scene that is written to a folder.

    It is empty, which keeps the states in the manifest, for a scene without states beside files of others.
    """
    known = {} if destination.folder is None else read_manifest(destination.folder)
    is_shared = any(not is_own(entry, destination) for entry in known.values())
    return {} if is_shared and not states else {"states": dict(states)}


def mixed_light(maps: Mapping[str, np.ndarray], weights: Mapping[str, Iterable[float]]) -> np.ndarray:
    """Return the sum of factor x map of light groups, (h, w, 3) float32, E/pi.

    maps:     map of each group, (h, w, 3) float32
    weights:  linear RGB factor of each group; groups without one have 1, and others are ignored
    """
    total = np.zeros(next(iter(maps.values())).shape, np.float64)
    for name, light in maps.items():
        total += light * np.array([*weights.get(name, (1.0, 1.0, 1.0))], np.float64)
    return total.astype(np.float32)


def rename_groups(scene: bpy.types.Scene, names: Mapping[str, str]) -> None:
    """Rename light groups in all states of a scene.

    names:  new name of each renamed group
    """
    for state in scene.hemibake.light_states:
        for group in state.groups:
            group.name = names.get(group.name, group.name)
