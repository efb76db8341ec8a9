"""File of light probes beside a glTF file for Unity: JSON that the component HemibakeProbes reads."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mathutils import Matrix

from ...engine.object_message import object_message
from ...engine.probes.unity_probes import UnityVolume, light_volume_textures, unity_volume
from .baked_probes import Volume
from .signed_text import signed_json

_SHEARED = (
    "VRC Light Volumes cannot be sheared, so these volumes have no textures for VRChat: {}. Apply the scale "
    "of their parents."
)


def unity_file(model: Path) -> str:
    """Return the name of the file of probes of a glTF file."""
    return f"{model.stem}.Probes.json"


def unity_probes(volumes: Mapping[str, Volume]) -> tuple[str, list[str]]:
    """Return the text of the file of probes, and notes on omitted data.

    volumes:  see `baked_probes`
    """
    found = {name: unity_volume(*volume) for name, volume in volumes.items()}
    sheared = [name for name, volume in found.items() if volume.is_sheared]
    text = signed_json({"volumes": [_entry(name, volume) for name, volume in found.items()]})
    return text, [object_message(_SHEARED, sheared)] if sheared else []


def _entry(name: str, volume: UnityVolume) -> dict:
    """Return the entry of a volume; sheared ones have neither rotation nor textures."""
    entry = {
        "name": name,
        "resolution": list(volume.resolution),
        "worldToLocal": np.linalg.inv(volume.matrix)[:3].ravel().tolist(),
        "harmonics": _encoded(volume.harmonics.astype("<f4")),
    }
    if volume.is_sheared:
        return entry
    size = np.linalg.norm(volume.matrix[:3, :3], axis=0)
    w, x, y, z = Matrix((volume.matrix[:3, :3] / size).tolist()).to_quaternion()
    return {
        **entry,
        "position": volume.matrix[:3, 3].tolist(),
        "rotation": [x, y, z, w],
        "size": size.tolist(),
        "textures": [_encoded(part.astype("<f2")) for part in light_volume_textures(volume.harmonics)],
    }


def _encoded(array: np.ndarray) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(array.tobytes()).decode("ascii")
