"""Modulation of lights by their shader nodes (profiles and falloff), packed for the device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.device_struct import DeviceStruct
from ..scene.model import Light

#: Modulation of a light's strength by direction and distance.
MODULATION = DeviceStruct(
    "Modulation",
    ("float[3]", "x", "rows of the matrix from world space to the light's own space, scale included"),
    ("float[3]", "y", ""),
    ("float[3]", "z", ""),
    ("int", "profile", "offset of its profile in all profiles, 0 for none"),
    ("int", "falloff_power", "of the distance, m"),
    ("float", "falloff_smooth", "m^2"),
)


def is_modulated(light: Light) -> bool:
    """True if the light has an angular profile or a distance falloff node."""
    return light.profile is not None or light.falloff_power != 0 or light.falloff_smooth != 0


def pack_modulations(lights: Sequence[Light]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Pack the angular profiles and falloffs of lights for the device.

    Returns modulation records, profiles, and the index of each light's record, 0 for lights without
    modulation. Profiles are float32, concatenated in the layout of modulation.cl. Lights with the same
    profile share one copy.
    """
    modulated = [light for light in lights if is_modulated(light)]
    records, profiles = MODULATION.array(1 + len(modulated)), [np.zeros(1, np.float32)]
    starts: dict[int | None, int] = {None: 0}
    for record, light in zip(records[1:], modulated, strict=True):
        factors = None if light.profile is None else id(light.profile.factors)
        if light.profile is not None and factors not in starts:
            starts[factors] = sum(map(len, profiles))
            profiles.append(light.profile.packed)
        record["x"], record["y"], record["z"] = light.axes * light.stretch[:, None]
        record["profile"] = starts[factors]
        record["falloff_power"], record["falloff_smooth"] = light.falloff_power, light.falloff_smooth
    numbers = iter(range(1, len(records)))
    return (
        records,
        np.concatenate(profiles),
        [next(numbers) if is_modulated(light) else 0 for light in lights],
    )
