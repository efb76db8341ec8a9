"""What the nodes of lamps make of their strength, packed for the device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.device_struct import DeviceStruct
from ..scene.model import Light

#: What a lamp's nodes make of its strength along a direction away from it, at a distance.
MODULATION = DeviceStruct(
    "Modulation",
    ("float[3]", "x", "rows of the matrix from the world to the lamp's own, perhaps stretched space"),
    ("float[3]", "y", ""),
    ("float[3]", "z", ""),
    ("int", "profile", "where its profile begins among all profiles, 0 for none"),
    ("int", "falloff_power", "of the distance, m"),
    ("float", "falloff_smooth", "m^2"),
)


def is_modulated(light: Light) -> bool:
    """True if a lamp's light depends on direction or distance in ways of its own."""
    return light.profile is not None or light.falloff_power != 0 or light.falloff_smooth != 0


def pack_modulations(lights: Sequence[Light]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return records, profiles and the number of each lamp's record; 0, which is no lamp's, for none.

    Profiles are float32, one after another as modulation.cl reads them. Lamps of one profile have one
    copy of it.
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
