"""Scene properties -> engine.Settings."""

from __future__ import annotations

import bpy

from ..engine.settings import OUTPUTS, Settings, check_settings
from .properties import HemibakeSceneProperties

_EXTENSION = __package__.rpartition(".")[0]


def read_settings(properties: HemibakeSceneProperties) -> Settings:
    """Return the checked settings of a scene; raises SettingsError."""
    settings = Settings(
        resolution=properties.resolution,
        hemicube=int(properties.hemicube),
        iterations=properties.iterations,
        tolerance=properties.tolerance,
        method=properties.method,
        visibility=properties.visibility,
        samples=properties.samples,
        outputs=tuple(name for name in OUTPUTS if name in properties.outputs),
        light_samples=properties.light_samples,
        sample_emission=properties.sample_emission,
        ao_samples=properties.ao_samples,
        ao_distance=properties.ao_distance,
        seed=properties.seed,
        dilation=properties.dilation,
        patch_file=bpy.path.abspath(properties.patch_file) or None,
        cache_dir=_cache_dir(),
    )
    check_settings(settings)
    return settings


def _cache_dir() -> str | None:
    """Return the extension's own folder for compiled kernels, None if it cannot be made."""
    try:
        return bpy.utils.extension_path_user(_EXTENSION, path="cl_cache", create=True)
    except (ValueError, OSError):
        return None
