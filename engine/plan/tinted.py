"""Settings for colored transparency: rays attenuate each channel, drawn hemicubes do not."""

from __future__ import annotations

from dataclasses import replace

from ..object_message import listing
from ..scene.cutouts import is_tinted_material
from ..scene.model import Scene
from ..settings import Settings


def settings_for_tints(
    scene: Scene, settings: Settings, has_opencl: bool
) -> tuple[Settings, tuple[str, ...]]:
    """Return the settings of a bake, and warnings for the user.

    Scenes with colored transparency use ray visibility. Method "paper" and bakes without OpenCL draw
    hemicubes, in which all channels pass like the strongest one.
    """
    tinted = [material.name for material in scene.materials if is_tinted_material(material)]
    if not tinted:
        return settings, ()
    if has_opencl and settings.method != "paper":
        return replace(settings, visibility="rays"), ()
    remedy = "Choose another Method than Paper." if has_opencl else "Bake with OpenCL."
    sentence = (
        "{}: indirect light through colored transparency is grey, since hemicubes have no color filter. "
        + remedy
    )
    return settings, (listing(sentence, tinted),)
