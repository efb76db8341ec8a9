"""Settings of bakes with tinted surfaces: rays follow each channel, drawn hemicubes do not."""

from __future__ import annotations

from dataclasses import replace

from ..object_message import listing
from ..scene.cutouts import is_tinted_material
from ..scene.model import Scene
from ..settings import Settings


def settings_for_tints(
    scene: Scene, settings: Settings, has_opencl: bool
) -> tuple[Settings, tuple[str, ...]]:
    """Return the settings with which a scene is baked, and sentences for the user.

    Rays find what patches see wherever surfaces change the color of light. Method "paper", and bakes without
    OpenCL, draw hemicubes: these pass as much of each channel as of the strongest one.
    """
    tinted = [material.name for material in scene.materials if is_tinted_material(material)]
    if not tinted:
        return settings, ()
    if has_opencl and settings.method != "paper":
        return replace(settings, visibility="rays"), ()
    remedy = "Choose another Method than Paper." if has_opencl else "Bake with OpenCL."
    sentence = f"{{}}: indirect light through colored transparency is grey, as hemicubes draw it. {remedy}"
    return settings, (listing(sentence, tinted),)
