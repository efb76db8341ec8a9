"""The Hemibake engine: lightmaps by texture-space radiosity, NumPy in and NumPy out.

Conventions, stated once for every module below:
  space      world space, right-handed, metres
  colour     scene-linear Rec.709 triples, float32
  radiance   L  [W/(m^2 sr)]
  irradiance E  [W/m^2]; a lightmap stores E/pi, which has the unit of radiance
  reflectance rho [1]; a patch sends out L = emission + rho * E/pi

The package never imports bpy: `operators` turns a Blender scene into an `engine.scene.Scene`.
"""

from .bake import bake
from .errors import DeviceError, EngineError, PatchFileError, SceneError, SettingsError
from .lightmap import Lightmap
from .progress import Progress, finished
from .scene import Light, Material, Mesh, Scene, Texture
from .settings import Settings

__all__ = [
    "DeviceError",
    "EngineError",
    "Light",
    "Lightmap",
    "Material",
    "Mesh",
    "PatchFileError",
    "Progress",
    "Scene",
    "SceneError",
    "Settings",
    "SettingsError",
    "Texture",
    "bake",
    "finished",
]
