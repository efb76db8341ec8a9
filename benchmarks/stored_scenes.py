"""Scenes of Blender as stored arrays."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from engine import Scene

#: Width of the lightmap of each scene, texels.
RESOLUTIONS = {"living_room": 1024, "gazebo": 512, "complex": 1024, "house": 1024}


def store_scene(scene: Scene, folder: Path, name: str) -> None:
    """Write the arrays of a scene."""
    (folder / f"{name}.pickle").write_bytes(pickle.dumps(scene))


def stored_scene(folder: Path, name: str) -> Scene:
    """Return a scene that `store_scene` has written; its classes are those of the imported engine."""
    with (folder / f"{name}.pickle").open("rb") as file:
        scene: Scene = _Unpickler(file).load()
    return scene


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Return a class of the imported engine, whatever package Blender loaded it in."""
        _, found, rest = module.partition(".engine")
        return super().find_class(f"engine{rest}" if found else module, name)
