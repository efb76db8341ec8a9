"""Options of the command line for the engine's settings, made from their descriptions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from headless import ROOT

sys.path.insert(0, str(ROOT))
from engine.setting import Description, FilePath, OneOf, Size, SomeOf, Span, Switch
from engine.settings import Settings, descriptions


def setting_names() -> list[str]:
    """Return the settings that a person chooses."""
    return [name for name, description in descriptions().items() if description.panel is not None]


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add an option for each setting; what is not given is None."""
    group = parser.add_argument_group("settings, as in the panel")
    for name in setting_names():
        option = f"--{name.replace('_', '-')}"
        description = descriptions()[name]
        told = f"{description.text[:1].lower()}{description.text[1:]}{_choices(description)}".replace(
            "%", "%%"
        )
        if isinstance(description.values, Switch):
            group.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=told)
        else:
            group.add_argument(option, type=_reader(name, description), help=told, metavar=_word(description))


def _reader(name: str, description: Description) -> Callable[[str], Any]:
    """Return what turns an argument into what the Blender property of a setting takes."""
    match description.values:
        case Span():
            return type(getattr(Settings, name))
        case OneOf():
            return choice
        case SomeOf():
            return names
        case Size():
            return size
    return str


def names(text: str) -> set[str]:
    """Return the words between commas."""
    return {word for part in text.split(",") if (word := choice(part))}


def choice(text: str) -> str:
    """Return one word of a choice as the settings spell it."""
    return text.strip().lower()


def size(text: str) -> tuple[int, ...]:
    """Return the numbers of "WIDTH,HEIGHT,LAYERS"."""
    numbers = tuple(int(part) for part in text.split(","))
    if len(numbers) != 3:
        raise argparse.ArgumentTypeError(f"'{text}' is no size: give width, height and layers, as 1024,768,2")
    return numbers


def _choices(description: Description) -> str:
    """Return the names that a choice offers, as the end of its help; else the unit."""
    match description.values:
        case OneOf(options) | SomeOf(options):
            return f": {', '.join(map(str, options))}"
    return ""


def _word(description: Description) -> str:
    """Return what stands for an argument in the help."""
    match description.values:
        case Span(unit=unit, shown=shown):
            return (shown[0] if shown else unit).replace("of the mean", "share").upper() or "N"
        case SomeOf():
            return "NAMES"
        case Size():
            return "W,H,LAYERS"
        case FilePath():
            return "FILE"
    return "CHOICE"
