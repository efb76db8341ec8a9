"""Converts results of the engine from Blender's working space to linear Rec.709."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...engine.bake_result import BakeResult, ProbeGrid, ReflectionCube
from ...engine.outputs import PROJECTED_MAPS, RATIO_MAPS, is_fraction
from ..working_space import is_rec709, to_rec709


def in_rec709(result: BakeResult) -> BakeResult:
    """Return a result in linear Rec.709; may return the same object.

    Colors outside the Rec.709 gamut get negative channels.
    """
    if is_rec709():
        return result
    passes = _maps(result.passes)
    return replace(
        result,
        image=to_rec709(result.image),
        display=next(iter(passes.values())),
        passes=passes,
        probes=tuple(_probes(grid) for grid in result.probes),
        reflections=tuple(_cube(cube) for cube in result.reflections),
    )


def _maps(maps: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert all output maps that hold light; fractions and the dominant direction have no color."""
    converted = {}
    for name, pixels in maps.items():
        if name in PROJECTED_MAPS[1:]:
            converted[name] = _ratio(pixels, maps[PROJECTED_MAPS[0]])
        else:
            is_light = not is_fraction(name) and name not in RATIO_MAPS
            converted[name] = to_rec709(pixels) if is_light else pixels
    return converted


def _ratio(l1: np.ndarray, l0: np.ndarray) -> np.ndarray:
    """Return a map of SH L1 / SH L0 for converted colors, clamped to [-1, 1].

    l1, l0:  maps "SH L1" of an axis and "SH L0" in the working space, (..., 3) float32
    """
    below = to_rec709(l0)
    ratio = np.divide(to_rec709(l1 * l0), below, out=np.zeros_like(l0), where=below != 0)
    return np.clip(ratio, -1, 1)


def _probes(grid: ProbeGrid) -> ProbeGrid:
    groups = {name: to_rec709(coefficients) for name, coefficients in grid.groups.items()}
    return replace(grid, coefficients=to_rec709(grid.coefficients), groups=groups)


def _cube(cube: ReflectionCube) -> ReflectionCube:
    return replace(cube, levels=tuple(to_rec709(level) for level in cube.levels))
