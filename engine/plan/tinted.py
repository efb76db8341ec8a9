"""Settings for colored transparency: rays attenuate each channel, drawn hemicubes do not."""

from __future__ import annotations

from dataclasses import replace

from ..object_message import listing
from ..scene.cutouts import is_tinted_material
from ..scene.model import Scene
from ..settings import Settings


def settings_for_tints(scene: Scene, settings: Settings) -> tuple[Settings, tuple[str, ...]]:
    """Return the settings of a bake, and warnings for the user.

    Scenes with colored transparency use ray visibility. Method "paper" draws hemicubes, which have one
    transmittance for all channels: the value of the channel with the highest transmittance.
    """
    tinted = [material.name for material in scene.materials if is_tinted_material(material)]
    if not tinted:
        return settings, ()
    if settings.method != "paper":
        return replace(settings, visibility="rays"), ()
    sentence = (
        "{}: indirect light through colored transparency is grey, since hemicubes have no color filter. "
        "Choose another Method than Paper."
    )
    return settings, (listing(sentence, tinted),)
