"""Profiles of lamps: packed once for all lamps that have one, refused if they cannot be looked up."""

from dataclasses import replace

import numpy as np
import pytest

from engine.direct.modulation import pack_modulations
from engine.errors import SceneError
from engine.scene.checks import check_light
from engine.scene.model import Light
from engine.scene.profile import Profile
from engine.worker import messages

AZIMUTHS, POLARS = np.float32([0, 2, 2 * np.pi]), np.float32([0, 0.5, 1, np.pi])


def lamp(**values):
    factors = np.arange(36, dtype=np.float32).reshape(3, 4, 3)
    profile = Profile(AZIMUTHS, POLARS, factors)
    return Light("Lamp", "point", np.zeros(3), np.eye(3), np.ones(3, np.float32), profile=profile, **values)


def test_lamps_of_one_profile_have_one_copy_of_it_also_in_the_worker():
    first, plain = lamp(), replace(lamp(), profile=None)
    lights = (first, plain, replace(first, falloff_power=2), lamp())
    parcel = messages.PackedMessage(lights)
    memory = memoryview(bytearray(parcel.size))
    parcel.write(memory)
    records, profiles, numbers = pack_modulations(messages.read(memory))
    starts = records["profile"][[number for number in numbers if number]]
    assert numbers == [1, 0, 2, 3]
    assert 0 < starts[0] == starts[1] != starts[2]
    assert profiles[starts[0]] == 3 and profiles[starts[0] + 1] == 4
    assert len(profiles) == starts[2] + len(first.profile.packed)
    assert records["falloff_power"].tolist() == [0, 0, 2, 0]


@pytest.mark.parametrize(
    "wrong",
    [
        {"azimuths": AZIMUTHS[::-1]},
        {"polars": POLARS[:3]},
        {"polars": np.float32([0, 0, 1, 2])},
        {"azimuths": np.float32([0, np.nan, 6])},
        {"factors": np.full((3, 4, 3), -1, np.float32)},
        {"factors": np.full((3, 4, 3), np.inf, np.float32)},
        {"factors": np.zeros((3, 4, 1), np.float32)},
    ],
)
def test_a_profile_that_cannot_be_looked_up_is_refused_by_name(wrong):
    light = lamp()
    check_light(light)
    with pytest.raises(SceneError, match="Light 'Lamp' has a profile"):
        check_light(replace(light, profile=replace(light.profile, **wrong)))


def test_profile_and_power_together_are_light():
    light = replace(lamp(), strength=np.full(3, 1e15, np.float32))
    with pytest.raises(SceneError, match="Light 'Lamp' has a profile and a power"):
        check_light(replace(light, profile=replace(light.profile, factors=light.profile.factors * 1e15)))
