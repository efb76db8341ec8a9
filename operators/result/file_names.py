"""File names from a user's template."""

from __future__ import annotations

import re
import string
from collections.abc import Iterator, Mapping, Sequence

from ...engine.errors import SettingsError

#: Fields of a template.
FIELDS = ("file", "scene", "lightmap", "output", "format", "resolution")

_KNOWN = f"Fields are {', '.join(f'{{{field}}}' for field in FIELDS)}."

#: Maximum length of a file name without extension, bytes; file systems allow 255 in total.
_LONGEST = 200


def names_by_template(template: str, images: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the names, without extension, that a template gives to images.

    images:  values of FIELDS for each image

    Raises SettingsError for an invalid template, and for a template with equal names for several images.
    """
    parts = _parts(template)
    names = [file_name("".join(text + values.get(field, "") for text, field in parts)) for values in images]
    first: dict[str, Mapping[str, str]] = {}
    for name, values in zip(names, images, strict=True):
        same = first.setdefault(name.casefold(), values)
        if same is not values:
            raise SettingsError(
                f"The name '{template}' gives the same file, '{name}', to {_told(same)} and {_told(values)}. "
                f"{_remedy(template, same, values)}."
            )
    return names


def file_name(name: str) -> str:
    """Return a valid file name: without reserved characters or trailing dots, and short enough."""
    plain = re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", name)
    short = plain.encode()[:_LONGEST].decode(errors="ignore").rstrip(". ")
    return short or "Lightmap"


def numbered_names(name: str, count: int) -> Iterator[str]:
    """Yield a name, then the name with numbers as Blender adds them: .001, .002, and so on.

    count:  number of names
    """
    yield name
    for number in range(1, count):
        yield f"{name}.{number:03d}"


def _parts(template: str) -> list[tuple[str, str]]:
    """Return a template as pairs of a text and the following field; raise SettingsError."""
    try:
        parsed = list(string.Formatter().parse(template))
    except ValueError as error:
        raise SettingsError(f"The name '{template}' has an unpaired brace. {_KNOWN}") from error
    for text, field, how, conversion in parsed:
        if field is not None and (field not in FIELDS or how or conversion):
            written = "".join(
                (field, *(("!", conversion) if conversion else ()), *((":", how) if how else ()))
            )
            raise SettingsError(f"The name '{template}' has an unknown field {{{written}}}. {_KNOWN}")
        if "/" in text or "\\" in text:
            raise SettingsError(f"The name '{template}' names a folder. Choose it under Folder.")
    return [(text, field or "") for text, field, *_ in parsed]


def _told(values: Mapping[str, str]) -> str:
    return f"'{values['lightmap']}' ({values['output'].replace('_', ' ')})"


def _remedy(template: str, one: Mapping[str, str], other: Mapping[str, str]) -> str:
    """Return the remedy that makes two names differ."""
    fields = [f"{{{field}}}" for field in FIELDS if one[field].casefold() != other[field].casefold()]
    missing = [field for field in fields if field not in template]
    return f"Add {' and '.join(missing)} to it" if missing else "Give one of them another name"
