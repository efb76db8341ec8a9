"""What a bake still can do on a machine without OpenCL: OpenGL sums the hemicubes, no rays are cast."""

from __future__ import annotations

from dataclasses import replace

from .device.compute import Compute
from .device.graphics import Graphics
from .errors import DeviceError
from .scene import Scene, shining_lights
from .settings import Settings

#: Outputs that take rays.
_RAY_OUTPUTS = {"ambient_occlusion": "ambient occlusion", "shadow_mask": "shadow masks"}


def open_compute(
    graphics: Graphics, scene: Scene, settings: Settings
) -> tuple[Compute | None, Settings, tuple[str, ...]]:
    """Open the OpenCL device; return it, what is left of the settings without it, and sentences for the user.

    Raises DeviceError if there is none and the bake needs rays, or OpenGL is older than 4.3.
    """
    try:
        return Compute(settings.cache_dir), settings, ()
    except DeviceError as error:
        needs = [text for name, text in _RAY_OUTPUTS.items() if name in settings.outputs]
        if shining_lights(scene):
            needs.insert(0, "the light of lamps")
        if needs:
            raise DeviceError(f"OpenCL is needed for {' and '.join(needs)}. {error}") from error
        if not graphics.computes:
            raise DeviceError(f"'{graphics.name}' has no OpenGL 4.3, so OpenCL is needed. {error}") from error
        note = f"Baked without OpenCL: small bright surfaces and bright sky give more noise. {error}"
        return None, replace(settings, sample_emission=False), (note,)
