"""Types that describe a setting: valid values, default, label and tool-tip.

Each field of `settings.Settings` carries a `Description`. The engine's checks, Blender's properties, the
command line options and docs/reference/settings.md are generated from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from .errors import SettingsError

#: Panel name of settings that describe the machine, not the scene; they are not stored in the .blend file.
PREFERENCES = "preferences"

#: Kind of cached data that a setting can invalidate: patches and their visibility samples.
VISIBILITY = "visibility"


class Option(NamedTuple):
    """Choice of an enumeration: its label and tool-tip."""

    label: str
    text: str


class Values(Protocol):
    """Valid values of a setting."""

    def demand(self, value: Any) -> str | None:
        """Return a description of the valid values if `value` is invalid, else None."""


@dataclass(frozen=True)
class Span:
    """Numbers from `low` to `high`.

    unit:       unit of the number in the engine
    shown:      unit in the interface, and its size in `unit`; None if equal
    automatic:  further valid number, which leaves the choice to the engine
    """

    low: float
    high: float
    unit: str = ""
    shown: tuple[str, int] | None = None
    automatic: float | None = None

    def demand(self, value: Any) -> str | None:
        """Return the limits and the unit if the value is invalid."""
        if self.low <= value <= self.high or value == self.automatic:
            return None
        automatic = "" if self.automatic is None else f", or {self.automatic:g}"
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip() + automatic


@dataclass(frozen=True)
class OneOf:
    """One of several names or numbers, in the order of the interface."""

    options: Mapping[Any, Option]

    def demand(self, value: Any) -> str | None:
        """Return a text that lists the valid values if the value is invalid, else None."""
        return None if value in self.options else f"one of {', '.join(map(str, self.options))}"


@dataclass(frozen=True)
class SubsetOf:
    """Nonempty tuple of distinct names."""

    options: Mapping[str, Option]

    def demand(self, value: Any) -> str | None:
        """Return a text that lists the valid values if the value is invalid, else None."""
        if value and len(set(value)) == len(value) and set(value) <= set(self.options):
            return None
        return f"at least one of {', '.join(self.options)}, each once at most"


@dataclass(frozen=True)
class Switch:
    """True or False."""

    def demand(self, value: Any) -> str | None:
        """Return both values if the value is invalid."""
        return None if value in (True, False) else "True or False"


@dataclass(frozen=True)
class Size:
    """Width, height and layers, or three zeros for automatic."""

    def demand(self, value: Any) -> str | None:
        """Return the definition of a size if the value is invalid."""
        if len(value) == 3 and (min(value) > 0 or not any(value)):
            return None
        return "three numbers from 1 on, or three zeros"


@dataclass(frozen=True)
class DeviceName:
    """Name of an OpenCL device, or None."""

    def demand(self, value: Any) -> str | None:
        """Return None: the device is searched on use."""
        return None


@dataclass(frozen=True)
class Address:
    """Network address of a program, or empty."""

    def demand(self, value: Any) -> str | None:
        """Accept any text, because only a connection can test an address."""
        return None


@dataclass(frozen=True)
class FilePath:
    """Path of a file or folder, or None."""

    def demand(self, value: Any) -> str | None:
        """Return None: the file is opened on use."""
        return None


@dataclass(frozen=True)
class Description:
    """Description of a setting for the interface, with its valid values.

    label:        name in the interface
    text:         tool-tip, without a full stop
    values:       valid values
    panel:        one of PANELS; None for settings that programs set, not users
    invalidates:  cached data that a change of the value invalidates
    """

    label: str
    text: str
    values: Values
    panel: str | None = "advanced"
    invalidates: tuple[str, ...] = (VISIBILITY,)

    def check(self, name: str, value: Any) -> None:
        """Raise SettingsError if the value of the named setting is invalid."""
        demand = self.values.demand(value)
        if demand is not None:
            raise SettingsError(f"{name} is {_written(value)}; choose {demand}.")


def described(
    default: Any,
    label: str,
    text: str,
    values: Values,
    panel: str | None = "advanced",
    invalidates: tuple[str, ...] = (VISIBILITY,),
) -> Any:  # the type of the field that it describes
    """Return a dataclass field with a default and a `Description`."""
    return field(
        default=default, metadata={"description": Description(label, text, values, panel, invalidates)}
    )


def _written(value: Any) -> str:
    """Format a value of a setting as text for the user."""
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "empty"
    return f"{value:g}" if isinstance(value, float | int) else repr(value)
