"""Writes docs/reference/settings.md from the descriptions of the settings.

python tools/settings_page.py
"""

from __future__ import annotations

import sys
from dataclasses import fields
from typing import Any

from headless import ROOT

sys.path.insert(0, str(ROOT))
from engine.quality import QUALITIES
from engine.setting_types import PREFERENCES, Description, OneOf, Span, SubsetOf
from engine.settings import Settings, descriptions, kept_with_scene, shown_in

PAGE = ROOT / "docs" / "reference" / "settings.md"

_HEAD = """# Settings

The panel, `bpy.context.scene.hemibake`, the command line, `tools/bake.py` and `engine.Settings` have the same
settings with the same names. `tools/settings_page.py` writes this page from `engine/settings.py`.

Settings of the scene are saved in the .blend. Settings of the machine are in the add-on's preferences and
apply to every file. On the command line, an option for a setting of the machine applies to that process only.

Defaults are those of `engine.Settings`. A new scene starts with the quality *Preview*.

## Quality: `quality`

A quality sets Hemicube, Samples, Light Samples and Adaptive; *Custom* means that their values belong to none.
The error is the largest RMSE of a lightmap in the rooms of `tools/quality.py`, relative to the map's mean.
Choosing a Hemicube sets Samples to 0, so that the number of rays follows from it.

| Quality | Error | with Denoise | Hemicube | Samples | Light Samples | Adaptive |
|---|---|---|---|---|---|---|
"""

_TABLE = """
## {}

| Setting | Default | Values | What it does |
|---|---|---|---|
"""


def page() -> str:
    """Return the page."""
    known, defaults = descriptions(), {entry.name: entry.default for entry in fields(Settings)}
    groups = {"Settings of the scene": kept_with_scene(), "Settings of the machine": shown_in(PREFERENCES)}
    tables = [
        _TABLE.format(title) + "".join(_row(name, known[name], defaults[name]) for name in names)
        for title, names in groups.items()
    ]
    choices = [_options(name, known[name]) for names in groups.values() for name in names]
    return _HEAD + _qualities(known) + "".join(tables) + "".join(choices)


def _qualities(known: dict[str, Description]) -> str:
    """Return the rows of the table of qualities."""
    rows = [
        (
            f"**{quality.label}** `{name}`",
            f"{100 * quality.error:g} %",
            f"{100 * quality.denoised:g} %" if quality.denoised else "",
            *(_shown(known[setting], value) for setting, value in quality.values.items()),
        )
        for name, quality in QUALITIES.items()
    ]
    return "".join(f"| {' | '.join(map(str, row))} |\n" for row in rows)


def _row(name: str, description: Description, default: Any) -> str:
    """Return the row of a setting."""
    cells = (f"**{description.label}** `{name}`", _shown(description, default), _values(description))
    return f"| {' | '.join(cells)} | {description.text}. |\n"


def _shown(description: Description, value: Any) -> str:
    """Return a value in the unit that people read."""
    match description.values:
        case Span(shown=(_, scale)):
            return f"{value // scale}"
    if isinstance(value, bool):
        return "on" if value else "off"
    return "" if value is None else ", ".join(map(str, value if isinstance(value, tuple) else (value,)))


def _values(description: Description) -> str:
    """Return the values that a setting takes."""
    match description.values:
        case Span(low, high, unit, shown, automatic):
            unit, scale = shown or (unit, 1)
            first = "" if automatic is None else f"{automatic:g}, "
            return f"{first}{-(-low // scale):g} … {int(high // scale):,} {unit}".strip()
        case OneOf(options) | SubsetOf(options):
            return ", ".join(map(str, options))
    return ""


def _options(name: str, description: Description) -> str:
    """Return a section with a table of the options of a setting; empty for a setting without options."""
    match description.values:
        case OneOf(options) | SubsetOf(options):
            rows = [f"| `{value}` {option.label} | {option.text}. |\n" for value, option in options.items()]
            return f"\n## {description.label}: `{name}`\n\n| Value | Meaning |\n|---|---|\n{''.join(rows)}"
    return ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
