"""Keeps few of many similar light group maps, as of a sun path; the others become weighted sums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..bake_result import BakeResult, ProbeGrid
from ..outputs import LIGHT_GROUP, is_of_light_group
from .map_basis import MapBasis, choose_maps

#: Largest root mean square error of a reduced map, relative to its mean light.
TOLERANCE = 0.01


@dataclass(frozen=True)
class ReducedGroups:
    """A result with fewer maps of light groups.

    result:   lightmaps and probes; the sum of all groups still is the first output
    kept:     names of the light groups that are left
    factors:  linear RGB factor of each kept group that gives the light of each group, by group
    error:    largest root mean square error of a group, relative to its mean light
    """

    result: BakeResult
    kept: tuple[str, ...]
    factors: dict[str, dict[str, tuple[float, float, float]]]
    error: float


def reduce_groups(result: BakeResult, groups: Sequence[str]) -> ReducedGroups:
    """Keep few of some light groups, scaled such that their sum is the sum of all within the tolerance.

    groups:  names of light groups; the result has the map of each
    """
    if not groups:
        return ReducedGroups(result, (), {}, 0.0)
    basis = choose_maps([_map_block(result, groups), *_probe_blocks(result.probes, groups)], TOLERANCE)
    # A chosen map has weight 1 for itself, so its scale is at least 1; a map without light may have scale 0.
    scales = basis.weights.sum(axis=0)
    kept = tuple(groups[number] for number in basis.chosen)
    factors = {
        name: {
            other: _rgb(np.divide(weight, scale, out=np.zeros(3), where=scale > 0))
            for other, weight, scale in zip(kept, weights, scales, strict=True)
        }
        for name, weights in zip(groups, basis.weights, strict=True)
    }
    if len(kept) < len(groups):
        result = _kept_only(result, groups, basis, scales.astype(np.float32))
    return ReducedGroups(result, kept, factors, float(basis.errors.max()))


def _map_block(result: BakeResult, groups: Sequence[str]) -> np.ndarray:
    """Return the texels of charts in the maps of the light groups, (groups, n, 3) float32."""
    return np.stack([result.passes[f"{LIGHT_GROUP}{name}"][result.has_patch] for name in groups])


def _probe_blocks(probes: Sequence[ProbeGrid], groups: Sequence[str]) -> list[np.ndarray]:
    """Return the coefficients of the light groups of each volume, (groups, n 9, 3) float32."""
    grids = [grid.groups for grid in probes if all(name in grid.groups for name in groups)]
    return [np.stack([grid[name].reshape(-1, 3) for name in groups]) for grid in grids]


def _kept_only(result: BakeResult, groups: Sequence[str], basis: MapBasis, scales: np.ndarray) -> BakeResult:
    """Return the result with the chosen groups alone, multiplied by scales, (k, 3)."""
    scale = {groups[number]: factor for number, factor in zip(basis.chosen, scales, strict=True)}
    dropped = set(groups) - scale.keys()
    passes = {
        name: image * scale.get(name.removeprefix(LIGHT_GROUP), 1) if is_of_light_group(name) else image
        for name, image in result.passes.items()
        if not is_of_light_group(name) or name.removeprefix(LIGHT_GROUP) not in dropped
    }
    first = next(iter(passes))
    combined = np.zeros_like(result.display)
    for name, image in passes.items():
        if is_of_light_group(name):
            combined += image
    passes["combined"] = combined
    probes = tuple(
        replace(
            grid,
            groups={
                name: values * scale.get(name, 1)
                for name, values in grid.groups.items()
                if name not in dropped
            },
        )
        for grid in result.probes
    )
    return replace(result, display=passes[first], passes=passes, probes=probes)


def _rgb(values: np.ndarray) -> tuple[float, float, float]:
    """Return three numbers of an array."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue
