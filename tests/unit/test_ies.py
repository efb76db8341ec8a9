"""IES files: every kind of symmetry, and what is wrong with broken ones."""

import numpy as np
import pytest

from engine.errors import SceneError
from engine.scene.profile import read_ies

WATT = 4 * np.pi / 177.83


def ies(horizontal, vertical, candelas, kind=1, multiplier=1.0, ballast="1 1 10", tilt="NONE"):
    """Return an IES file; candelas (horizontal, vertical)."""
    rows = [horizontal, *np.asarray(candelas, float)]
    lines = ["IESNA:LM-63-2002", "[TEST] a, b 1 2 3", f"TILT={tilt}"]
    lines += [f"1 1000 {multiplier} {len(vertical)} {len(horizontal)} {kind} 2 0.1 0.2 0", ballast]
    lines += [", ".join(str(value) for value in row) for row in [vertical, *rows]]
    return "\r\n".join(lines) + "\r\n"


def degrees(angles):
    return np.degrees(angles).round(3).tolist()


def columns(profile):
    """Return the first factor of each column, in candela."""
    return (profile.factors[:, 0, 1] / WATT).round(3).tolist()


@pytest.mark.parametrize(
    ("horizontal", "azimuths", "order"),
    [
        ([0], [0, 360], [0, 0]),
        ([0, 45, 90], [0, 45, 90, 135, 180, 225, 270, 315, 360], [0, 1, 2, 1, 0, 1, 2, 1, 0]),
        ([0, 60, 180], [0, 60, 180, 300, 360], [0, 1, 2, 1, 0]),
        ([90, 150, 270], [0, 60, 180, 300, 360], [0, 1, 2, 1, 0]),
        ([0, 90, 180, 360], [0, 90, 180, 360], [0, 1, 2, 3]),
        ([0, 120, 240], [0, 120, 240, 360], [0, 1, 2, 0]),
    ],
)
def test_type_c_is_mirrored_to_a_full_circle(horizontal, azimuths, order):
    candelas = np.arange(1, 1 + len(horizontal))[:, None] * [10, 5, 1]
    profile = read_ies(ies(horizontal, [0, 45, 90], candelas))
    assert degrees(profile.azimuths) == azimuths and degrees(profile.polars) == [0, 45, 90]
    assert columns(profile) == [10 * (1 + index) for index in order]


def test_types_a_and_b_become_c():
    candelas = np.array([[1, 2, 3], [4, 5, 6.0]])
    a = read_ies(ies([0, 60], [-90, 0, 90], candelas, kind=3))
    assert degrees(a.azimuths) == [120, 180, 240] and degrees(a.polars) == [0, 90, 180]
    assert columns(a) == [4, 1, 4]
    b = read_ies(ies([0, 60], [-90, 0, 90], candelas, kind=2))
    assert degrees(b.azimuths) == [0, 90, 180] and degrees(b.polars) == [30, 90, 150]
    assert columns(b) == [4, 5, 6]


def test_multiplier_ballast_and_tilt():
    tilt = "INCLUDE\r\n1\r\n3\r\n0 45 90\r\n1 0.9 0.8"
    profile = read_ies(ies([0], [0, 90], [[100, 50]], multiplier=2, ballast="0.5 0.8 10", tilt=tilt))
    assert columns(profile) == [80, 80]


GOOD = ies([0, 90], [0, 45, 90], [[3, 2, 1], [6, 5, 4]])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "hello",
        GOOD.replace("TILT=NONE", "TILT"),
        GOOD[: GOOD.rindex("5")],
        GOOD.replace("6.0", "six"),
        GOOD.replace("6.0", "nan"),
        GOOD.replace("0, 45, 90", "0, 90, 45"),
        GOOD.replace("1 1000 1.0 3 2 1", "1 1000 1.0 0 2 1"),
        GOOD.replace("1 1000 1.0 3 2 1", "1 1000 1.0 3 2 7"),
        GOOD.replace("1 1000 1.0 3 2 1", "1 1000 1.0 1e300 2 1"),
        GOOD.replace("1 1000 1.0 3 2 1", "1 1000 1.0 -3 2 1"),
        "\nTILT=INCLUDE\n1 1e300 1",
        "\nTILT=INCLUDE\n1 -7 1",
    ],
)
def test_a_broken_file_is_refused(text):
    with pytest.raises(SceneError):
        read_ies(text)
