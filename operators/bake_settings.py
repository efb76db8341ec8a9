"""Conversion of Blender properties of a scene and the machine to engine.Settings."""

from __future__ import annotations

from typing import Any
from urllib.parse import urlsplit

import bpy

from ..engine.errors import SettingsError
from ..engine.setting_types import Span
from ..engine.settings import Settings, check_settings, descriptions, kept_with_scene
from .denoise_library import denoise_library
from .preferences import machine_settings
from .properties import HemibakeSceneProperties
from .scene.units import metres_per_unit
from .setting_properties import setting_values
from .user_files import cache_folder

#: Scheduler that starts workers on this machine, and names of this machine.
_LOCAL_WORKERS, _THIS_MACHINE = "all", ("localhost", "127.0.0.1", "::1")


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


def check_online_access(scheduler: str) -> None:
    """Raise a SettingsError if a scheduler is on the network, which Blender's preferences do not allow."""
    if not scheduler or scheduler == _LOCAL_WORKERS or urlsplit(scheduler).hostname in _THIS_MACHINE:
        return
    if not bpy.app.online_access:
        raise SettingsError(
            f"Scheduler '{scheduler}': Blender does not allow online access. Allow it in its preferences "
            "under System > Network, start Blender with --online-mode, or leave the scheduler empty."
        )
