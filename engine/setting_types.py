"""What is known of one setting: values, default, and how it is described to people.

Each field of `settings.Settings` carries a `Description`. The engine's checks, Blender's properties, the
options of the command line and docs/reference/settings.md are made from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from .errors import SettingsError

#: Where the add-on keeps what describes the machine and not the scene; it is no part of a .blend.
PREFERENCES = "preferences"

#: Panels of the interface that hold settings, in their order.
PANELS = ("bake", "quality", "outputs", "advanced", "memory", "paper", PREFERENCES)


class Option(NamedTuple):
    """A value that can be chosen: its name in the interface, and what it does."""

    label: str
    text: str


class Values(Protocol):
    """The values that a setting takes."""

    def demand(self, value: Any) -> str | None:
        """Return what to choose instead of a value, None if the setting takes it."""


@dataclass(frozen=True)
class Span:
    """Numbers from `low` to `high`.

    unit       of the number as the engine takes it
    shown      unit that people read and write, and how many of `unit` it is; None if it is the same
    automatic  a further number, which leaves the choice to the engine
    """

    low: float
    high: float
    unit: str = ""
    shown: tuple[str, int] | None = None
    automatic: float | None = None

    def demand(self, value: Any) -> str | None:
        """Return the limits and the unit."""
        if self.low <= value <= self.high or value == self.automatic:
            return None
        automatic = "" if self.automatic is None else f", or {self.automatic:g}"
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip() + automatic


@dataclass(frozen=True)
class OneOf:
    """One of several names or numbers, in the order of the interface."""

    options: Mapping[Any, Option]

    def demand(self, value: Any) -> str | None:
        """Return all options."""
        return None if value in self.options else f"one of {', '.join(map(str, self.options))}"


@dataclass(frozen=True)
class SomeOf:
    """A tuple of at least one of several names, each once at most."""

    options: Mapping[str, Option]

    def demand(self, value: Any) -> str | None:
        """Return all options."""
        if value and len(set(value)) == len(value) and set(value) <= set(self.options):
            return None
        return f"at least one of {', '.join(self.options)}, each once at most"


@dataclass(frozen=True)
class Switch:
    """True or False."""

    def demand(self, value: Any) -> str | None:
        """Return both values."""
        return None if value in (True, False) else "True or False"


@dataclass(frozen=True)
class Size:
    """Width, height and layers, or three zeros for an automatic one."""

    def demand(self, value: Any) -> str | None:
        """Return what a size is."""
        if len(value) == 3 and (min(value) > 0 or not any(value)):
            return None
        return "three numbers from 1 on, or three zeros"


@dataclass(frozen=True)
class DeviceName:
    """The name of an OpenCL device, or None."""

    def demand(self, value: Any) -> str | None:
        """Return None: whether there is such a device is found out when it is used."""
        return None


@dataclass(frozen=True)
class Address:
    """The network address of a program, or empty."""

    def demand(self, value: Any) -> str | None:
        """Return None: whether a program answers there is found out when it is used."""
        return None


@dataclass(frozen=True)
class FilePath:
    """The path of a file or folder, or None."""

    def demand(self, value: Any) -> str | None:
        """Return None: whether there is such a file is found out when it is opened."""
        return None


@dataclass(frozen=True)
class Description:
    """How a setting is shown, and which values it takes.

    label   name in the interface
    text    what it does, without a full stop
    values  what it may be
    panel   one of PANELS; None for what a program sets and not a person
    """

    label: str
    text: str
    values: Values
    panel: str | None = "advanced"

    def check(self, name: str, value: Any) -> None:
        """Raise SettingsError if the setting of this name does not take a value."""
        demand = self.values.demand(value)
        if demand is not None:
            raise SettingsError(f"{name} is {_written(value)}; choose {demand}.")


def described(
    default: Any, label: str, text: str, values: Values, panel: str | None = "advanced"
) -> Any:  # the type of the field that it describes
    """Return a dataclass field with a default and a `Description`."""
    return field(default=default, metadata={"description": Description(label, text, values, panel)})


def _written(value: Any) -> str:
    """Return a value as a person would write it."""
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "empty"
    return f"{value:g}" if isinstance(value, float | int) else repr(value)
