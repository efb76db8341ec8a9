"""Conversion of Blender properties of a scene and the machine to engine.Settings."""

from __future__ import annotations

from typing import Any

from ..engine.setting_types import Span
from ..engine.settings import Settings, check_settings, descriptions, kept_with_scene
from .denoise_library import denoise_library
from .network import check_online_access
from .preferences import machine_settings
from .properties import HemibakeSceneProperties
from .scene.units import metres_per_unit
from .setting_properties import setting_values
from .user_files import cache_folder


def read_settings(properties: HemibakeSceneProperties) -> Settings:
    """Return the validated settings of a scene on this machine, with lengths in scene units.

    Raises SettingsError if a value is out of range.
    """
    values = setting_values(properties, kept_with_scene())
    scale = metres_per_unit(properties.id_data)
    values |= {name: values[name] / scale for name in _lengths() if name in values}
    settings = Settings(**values, **_machine())
    check_settings(settings)
    check_online_access(settings.scheduler)
    return settings


def machine_defaults() -> Settings:
    """Return the machine's settings, with the engine's defaults for settings of a scene."""
    settings = Settings(**_machine())
    check_settings(settings)
    return settings


def _lengths() -> list[str]:
    """Return the names of settings whose unit is metres."""
    known = descriptions().items()
    return [name for name, one in known if isinstance(one.values, Span) and one.values.unit == "m"]


def _machine() -> dict[str, Any]:
    files = {"cache_dir": cache_folder(), "denoise_library": denoise_library()}
    return machine_settings() | {name: None if path is None else str(path) for name, path in files.items()}
