import sys
from pathlib import Path

import pytest

from engine.errors import SettingsError
from engine.settings import Settings, check_settings

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("name", "value"),
    [("resolution", 0), ("resolution", 100000), ("hemicube", 48), ("max_bounces", 0), ("tolerance", -1),
     ("tolerance", float("nan")), ("method", "magic"), ("margin", -1), ("seed", -1), ("batch_bytes", 0),
     ("outputs", ("direct", "direct")), ("outputs", ()), ("outputs", ("foo",)), ("samples", 1),
     ("samples", 3), ("samples", 65537), ("patch_groups", 3), ("visibility", "RASTER"), ("rotate", "no"),
     ("array_size", (32, 0, 1)), ("array_size", (-1, -1, -1)), ("memory_budget", -1)],
)  # fmt: skip
def test_setting_out_of_its_range(name, value):
    with pytest.raises(SettingsError, match=f"^{name} is .*; choose "):
        check_settings(Settings(**{name: value}))


def test_message_names_the_value_and_the_range():
    with pytest.raises(SettingsError, match=r"^samples is 3; choose 4 to 65536 rays, or 0\.$"):
        check_settings(Settings(samples=3))


@pytest.mark.parametrize(
    ("name", "value"),
    [("samples", 0), ("samples", 4), ("array_size", (96, 97, 1)), ("memory_budget", 1 << 50)],
)
def test_ends_of_ranges_are_taken(name, value):
    check_settings(Settings(**{name: value}))


def test_page_of_the_settings_is_up_to_date(monkeypatch):
    """Mended by tools/settings_page.py."""
    monkeypatch.setattr(sys, "path", [str(ROOT / "tools"), *sys.path])
    from settings_page import PAGE, page

    assert PAGE.read_text(encoding="utf-8") == page()
