"""What the nodes of lamps make of their strength, packed for the device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..scene.model import Light

#: Floats of a lamp: matrix from world to lamp, start of its profile, power and smoothing of its falloff.
_SIZE = 12


def is_modulated(light: Light) -> bool:
    """True if a lamp's light depends on direction or distance in ways of its own."""
    return light.profile is not None or light.falloff_power != 0 or light.falloff_smooth != 0


def pack_modulations(lights: Sequence[Light]) -> tuple[np.ndarray, list[int]]:
    """Return the float32 that kernels/modulation.cl reads, and where each lamp's begin: 0 for none.

    Lamps of one profile have one copy of it.
    """
    modulated = [light for light in lights if is_modulated(light)]
    parts = [np.zeros((1 + len(modulated)) * _SIZE, np.float32)]
    heads, end = parts[0].reshape(-1, _SIZE), parts[0].size
    starts: dict[int, int] = {}
    for head, light in zip(heads[1:], modulated, strict=True):
        head[:9] = (light.axes * light.stretch[:, None]).ravel()
        head[10:] = light.falloff_power, light.falloff_smooth
        if light.profile is None:
            continue
        if id(light.profile.factors) not in starts:
            starts[id(light.profile.factors)] = end
            parts.append(light.profile.packed)
            end += parts[-1].size
        head[9:10].view(np.int32)[0] = starts[id(light.profile.factors)]
    numbers = iter(range(1, len(heads)))
    return np.concatenate(parts), [_SIZE * next(numbers) if is_modulated(light) else 0 for light in lights]
