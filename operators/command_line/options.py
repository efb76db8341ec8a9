"""Command-line options; options of engine settings are generated from the settings' descriptions."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from ...engine.quality import QUALITIES
from ...engine.setting_types import (
    Address,
    Description,
    DeviceName,
    FilePath,
    OneOf,
    Size,
    Span,
    SubsetOf,
    Switch,
)
from ...engine.settings import Settings, chosen_by_people, descriptions

#: Options for settings that the add-on has in addition to the engine's: type, placeholder and help.
OWN: dict[str, tuple[Callable[[str], Any], str, str]] = {
    "texels_per_metre": (float, "N", "instead of a resolution"),
    "largest_width": (int, "TEXELS", "greatest width that texels per metre may lead to"),
    "lightmap_count": (int, "N", "lightmaps that new lightmap UVs are spread over"),
    "padding": (int, "TEXELS", "between charts of new lightmap UVs"),
    "mip_level": (int, "N", "coarsest mip level at which charts keep the padding"),
    "meshes": (str.upper, "CHOICE", "render or viewport: which meshes are baked"),
    "uv_layer": (str, "NAME", "name of the lightmap UV layer"),
    "file_name": (str, "TEMPLATE", "name of the files, such as {file}_{lightmap}_{output}"),
    "file_format": (str.lower, "FORMAT", "exr, hdr, ktx2, png, rgbm, rgbd or logluv"),
    "exr_depth": (str, "BITS", "of a channel of OpenEXR: 32 or 16"),
    "png_depth": (str, "BITS", "of a channel of PNG: 8 or 16"),
    "exr_codec": (str.lower, "CODEC", "of OpenEXR: zip, piz, dwaa, dwab or none"),
    "exposure": (float, "STOPS", "that light is raised by before it is written as a PNG"),
    "light_range": (float, "N", "brightest light of RGBM and RGBD; 0 for that of the brightest texel"),
    "light_gamma": (float, "N", "power of the decoder of RGBM and RGBD"),
    "sun_latitude": (float, "DEGREES", "latitude of --sun-path, positive in the north"),
    "sun_day": (int, "DAY", "day of the year of --sun-path, from 1 to 366"),
    "sun_north": (float, "DEGREES", "from the y axis to north, counter-clockwise seen from above"),
}


class CommandError(Exception):
    """Raised if a command cannot run; the message names the remedy."""


class Parser(argparse.ArgumentParser):
    """Argument parser that raises CommandError instead of ending the process."""

    def error(self, message: str) -> NoReturn:
        """Raise CommandError instead of ending the process."""
        raise CommandError(f"{message}. See --help.")


def parser(program: str, description: str) -> Parser:
    """Return a parser of all options except the scene, which the caller adds."""
    made = Parser(prog=program, description=description, allow_abbrev=False)
    made.add_argument("--out", type=Path, required=True, help="folder for the lightmaps")
    _add_settings(made)
    made.add_argument(
        "--quality", choices=[*QUALITIES], help="sets hemicube, samples, light samples and adaptive"
    )
    made.add_argument(
        "--devices", choices=["all"], dest="scheduler",
        help="bake on all equal GPUs of this machine, or on different devices by workers (needs Dask)",
    )  # fmt: skip
    for name, (kind, word, text) in OWN.items():
        made.add_argument(f"--{name.replace('_', '-')}", type=kind, metavar=word, help=text)
    made.add_argument("--world", type=colour, metavar="R,G,B", help="replace the world by this radiance")
    made.add_argument(
        "--state", metavar="NAME", action="append", default=[], dest="states",
        help="also write the lightmaps of this light state; may be repeated",
    )  # fmt: skip
    made.add_argument(
        "--sun-path", metavar="HH:MM", nargs="+", dest="sun_times",
        help="also bake the sun at these times of a day, each as a light state",
    )  # fmt: skip
    made.add_argument("--sun-light", metavar="NAME", help="sun light that follows --sun-path")
    made.add_argument("--save-blend", type=Path, metavar="FILE", help="save the baked scene")
    made.add_argument(
        "--export", type=Path, metavar="FILE", help="write the baked scene as .glb or .gltf with lightmaps"
    )
    made.add_argument("--report", type=Path, metavar="FILE", help="write the report of the bake as JSON")
    made.add_argument("--json", action="store_true", help="end with one JSON object")
    _add_part(made)
    return made


def _add_part(parser: argparse.ArgumentParser) -> None:
    """Add the options that select a part of the file, see `choose_part`."""
    group = parser.add_argument_group("a part of the file; all else still shades and reflects")
    group.add_argument("--scene-name", metavar="NAME", help="bake this scene instead of the active one")
    part = group.add_mutually_exclusive_group()
    part.add_argument("--collection", metavar="NAME", help="bake the objects of this collection")
    part.add_argument("--lightmap", metavar="NAME", help="bake the objects of this lightmap")


def parse(parser: Parser, arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the options; raises CommandError. "--world -1,1,1" is accepted.

    By default argparse treats an argument that starts with - as an option.
    """
    words = iter(arguments)
    return parser.parse_args([f"{word}={next(words, '')}" if word == "--world" else word for word in words])


def _add_settings(parser: argparse.ArgumentParser) -> None:
    """Add an option for each setting; its value is None if it is not given."""
    group = parser.add_argument_group("settings, as in the panel and the preferences")
    for name in chosen_by_people():
        option = f"--{name.replace('_', '-')}"
        description = descriptions()[name]
        help_text = f"{description.text[:1].lower()}{description.text[1:]}{_choices(description)}".replace(
            "%", "%%"
        )
        if isinstance(description.values, Switch):
            group.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=help_text)
        else:
            group.add_argument(
                option, type=_reader(name, description), help=help_text, metavar=_word(description)
            )


def _reader(name: str, description: Description) -> Callable[[str], Any]:
    """Return the function that converts an argument to the type of a setting's Blender property."""
    match description.values:
        case Span():
            return type(getattr(Settings, name))
        case OneOf():
            return choice
        case SubsetOf():
            return names
        case Size():
            return size
    return str


def names(text: str) -> set[str]:
    """Split a text at commas into a set of words."""
    return {word for part in text.split(",") if (word := choice(part))}


def choice(text: str) -> str:
    """Return a choice in lower case without spaces, as the settings spell it."""
    return text.strip().lower()


def size(text: str) -> tuple[int, ...]:
    """Return the numbers of "WIDTH,HEIGHT,LAYERS"."""
    numbers = tuple(int(part) for part in text.split(","))
    if len(numbers) != 3:
        raise argparse.ArgumentTypeError(f"'{text}' is no size: give width, height and layers, as 1024,768,2")
    return numbers


def colour(text: str) -> tuple[float, float, float]:
    """Return the three numbers of "R,G,B"."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(math.isfinite(value) and value >= 0 for value in values):
        raise argparse.ArgumentTypeError(f"'{text}' is no radiance: give three numbers from 0, such as 1,1,1")
    return values


def _choices(description: Description) -> str:
    """Return the list of a setting's valid choices, to be appended to its help.

    Empty for other types of settings.
    """
    match description.values:
        case OneOf(options) | SubsetOf(options):
            return f": {', '.join(map(str, options))}"
    return ""


def _word(description: Description) -> str:
    """Return the placeholder of an argument in the help."""
    match description.values:
        case Span(unit=unit, shown=shown):
            return (shown[0] if shown else unit).replace("of the mean", "fraction").upper() or "N"
        case SubsetOf():
            return "NAMES"
        case Size():
            return "W,H,LAYERS"
        case Address():
            return "ADDRESS"
        case DeviceName():
            return "NAME"
        case FilePath():
            return "FILE"
    return "CHOICE"
