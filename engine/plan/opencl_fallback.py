"""What a bake still can do on a machine without OpenCL: OpenGL sums the hemicubes, no rays are cast."""

from __future__ import annotations

from dataclasses import replace

from ..device.devices import Devices
from ..errors import DeviceError
from ..outputs import OUTPUTS
from ..scene.model import Scene, shining_lights
from ..scene.sky_suns import put_suns_into_world
from ..settings import Settings
from .tinted import settings_for_tints


def without_opencl(
    devices: Devices, scene: Scene, settings: Settings
) -> tuple[Scene, Settings, tuple[str, ...]]:
    """Return the scene, what is left of the settings if there is no OpenCL, and sentences for the user.

    Hemicubes then see the sun of a sky. With OpenCL, tinted surfaces need rays. Raises DeviceError if there
    is none and the bake needs rays, or OpenGL is older than 4.3.
    """
    settings, tints = settings_for_tints(scene, settings, devices.compute is not None)
    if devices.compute is not None:
        return scene, settings, tints
    error, graphics = devices.missing, devices.graphics
    needs = [entry.needs_opencl for name, entry in OUTPUTS.items() if name in settings.outputs]
    needs = [need for need in needs if need]
    scene = put_suns_into_world(scene)
    if shining_lights(scene):
        needs.insert(0, "the light of lamps")
    if settings.visibility == "rays":
        needs.append("rays")
    if settings.scheduler:
        needs.append("a bake by workers")
    if needs:
        raise DeviceError(f"OpenCL is needed for {' and '.join(needs)}. {error}")
    if not graphics.computes:
        raise DeviceError(f"'{graphics.name}' has no OpenGL 4.3, so OpenCL is needed. {error}")
    note = f"Baked without OpenCL: small bright surfaces and bright sky give more noise. {error}"
    return scene, replace(settings, sample_emission=False, patch_groups=1), (note, *tints)
