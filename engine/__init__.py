"""Hemibake engine: lightmaps by texture-space radiosity, NumPy arrays in and out.

Conventions of all modules:
  space       world space, right-handed, metres
  color       scene-linear RGB, float32; primaries of the caller
  radiance    L, W/(m^2 sr)
  irradiance  E, W/m^2; lightmaps and arrays named irradiance store E/pi, which has the unit of radiance
  reflectance rho, dimensionless; exitant radiance is L = emission + rho * E/pi

The package never imports bpy: `operators` converts a Blender scene into an `engine.scene.model.Scene`. OpenGL
and OpenCL are imported by the first bake. The algorithm is in `engine.pipeline`.
"""

from collections.abc import Generator

from .bake_result import BakeResult
from .errors import DeviceError, EngineError, PatchFileError, SceneError, SettingsError
from .live import Live
from .progress import Progress, finished
from .scene.model import Light, Material, Mesh, Scene
from .scene.scene_changes import SceneChanges
from .scene.texture import Texture
from .session import Session
from .settings import Settings

__all__ = [
    "BakeResult",
    "DeviceError",
    "EngineError",
    "Light",
    "Live",
    "Material",
    "Mesh",
    "PatchFileError",
    "Progress",
    "Scene",
    "SceneChanges",
    "SceneError",
    "Session",
    "Settings",
    "SettingsError",
    "Texture",
    "bake",
    "finished",
]


def bake(scene: Scene, settings: Settings) -> Generator[Progress, None, BakeResult]:
    """Bake the lightmaps of a scene; yield `Progress` after each slice of work, return the `BakeResult`.

    Closing the generator cancels the bake. All GPU objects are released in any case. Raises SettingsError,
    SceneError, PatchFileError, or DeviceError, which also reports missing packages.
    """
    session = Session()
    try:
        return (yield from session.bake(scene, settings))
    finally:
        session.close()
