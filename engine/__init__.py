"""The Hemibake engine: lightmaps by texture-space radiosity, NumPy in and NumPy out.

Conventions, stated once for every module below:
  space      world space, right-handed, metres
  colour     scene-linear Rec.709 triples, float32
  radiance   L  [W/(m^2 sr)]
  irradiance E  [W/m^2]; a lightmap stores E/pi, which has the unit of radiance
  reflectance rho [1]; a patch sends out L = emission + rho * E/pi

The package never imports bpy: `operators` turns a Blender scene into an `engine.scene.Scene`. It imports
OpenGL and OpenCL when it bakes for the first time; the algorithm is in `engine.pipeline`.
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
    """Bake the lightmaps of a scene; yields after every slice of work, returns the Lightmap.

    Closing the generator cancels the bake; every GPU object is released in any case. Raises
    SettingsError, SceneError, PatchFileError or DeviceError, also for a package that is not installed.
    """
    session = Session()
    try:
        return (yield from session.bake(scene, settings))
    finally:
        session.close()
