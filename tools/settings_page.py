"""Write the page of the documentation that lists every setting, from the settings' descriptions.

python tools/settings_page.py            # docs/reference/settings.md
"""

from __future__ import annotations

import sys
from dataclasses import fields
from typing import Any

from headless import ROOT

sys.path.insert(0, str(ROOT))
from engine.quality import QUALITIES
from engine.setting_types import PREFERENCES, Description, OneOf, SomeOf, Span
from engine.settings import Settings, descriptions, kept_with_scene, shown_in

PAGE = ROOT / "docs" / "reference" / "settings.md"

_HEAD = """# Settings

The panel, `bpy.context.scene.hemibake`, `blender -c hemibake`, `tools/bake.py` and `engine.Settings` have
the same settings under the same names. This page is written by `tools/settings_page.py` from their
descriptions in `engine/settings.py`.

What decides how a scene comes out belongs to the scene, and is saved in the .blend. What describes the
machine is in the add-on's preferences and the same for every file: a .blend takes no device with it. An
option of the command line for one of these holds for that process.

Defaults are those of `engine.Settings`; a new scene starts with the quality *Preview*.

## Quality: `quality`

Stands for Hemicube, Samples, Light Samples and Adaptive, and shows *Custom* where these are of no quality.
Its error is the largest RMSE of a lightmap, relative to the map's mean, in the rooms of `tools/quality.py`.
Choosing a Hemicube sets Samples to 0, so that rays follow it.

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
    groups = {"Of the scene": kept_with_scene(), "Of the machine": shown_in(PREFERENCES)}
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
        case OneOf(options) | SomeOf(options):
            return ", ".join(map(str, options))
    return ""


def _options(name: str, description: Description) -> str:
    """Return a list of what a choice offers, if the setting is one."""
    match description.values:
        case OneOf(options) | SomeOf(options):
            items = [f"- `{value}` {option.label}: {option.text}.\n" for value, option in options.items()]
            return f"\n## {description.label}: `{name}`\n\n{''.join(items)}"
    return ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
