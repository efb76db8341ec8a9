"""Scene properties -> engine.Settings."""

from __future__ import annotations

import bpy

from ..engine.settings import Settings, check_settings
from .properties import HemibakeSceneProperties
from .setting_properties import setting_values

_EXTENSION = __package__.rpartition(".")[0]


def read_settings(properties: HemibakeSceneProperties) -> Settings:
    """Return the checked settings of a scene; raises SettingsError."""
    settings = Settings(**setting_values(properties), cache_dir=_cache_dir())
    check_settings(settings)
    return settings


def _cache_dir() -> str | None:
    """Return the extension's own folder for compiled kernels, None if it cannot be made."""
    try:
        return bpy.utils.extension_path_user(_EXTENSION, path="cl_cache", create=True)
    except (ValueError, OSError):
        return None
