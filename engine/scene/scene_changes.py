"""Scene changes: lights, world, materials, and moved or replaced meshes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TypeVar

import numpy as np

from ..errors import SceneError
from .digests import same_values
from .model import Light, Material, Mesh, Scene

Part = TypeVar("Part", Material, Mesh)

#: Fields of a scene that `SceneChanges` can change.
_CHANGING = ("lights", "world", "materials", "meshes")

#: Maximum difference between matrices of the same probe volume relative to two origins, m: subtracting and
#: adding an origin 1e9 m away rounds float64 by 1e-7 m.
_SAME_PLACE = 1e-6


@dataclass(frozen=True)
class SceneChanges:
    """Changes of a scene; None and missing entries mean no change.

    lights:     all lights from now on; omitted ones are removed
    world:      see `Scene.world`
    materials:  new materials by index in `Scene.materials`
    moves:      (4, 4) float64 by mesh index: maps old positions, m, relative to `Scene.origin`, to new ones
    meshes:     new shapes, UVs or materials, by index in `Scene.meshes`
    """

    lights: tuple[Light, ...] | None = None
    world: np.ndarray | None = None
    materials: Mapping[int, Material] = field(default_factory=dict)
    moves: Mapping[int, np.ndarray] = field(default_factory=dict)
    meshes: Mapping[int, Mesh] = field(default_factory=dict)

    @property
    def empty(self) -> bool:
        """True if nothing changes."""
        others = self.materials or self.moves or self.meshes
        return self.lights is None and self.world is None and not others

    def of(self, scene: Scene) -> Scene:
        """Return the changed scene; raise SceneError for an index that does not exist."""
        _check_numbers("materials", self.materials, len(scene.materials))
        _check_numbers("meshes", (*self.meshes, *self.moves), len(scene.meshes))
        meshes = [self.meshes.get(number, mesh) for number, mesh in enumerate(scene.meshes)]
        for number, matrix in self.moves.items():
            meshes[number] = transformed(meshes[number], matrix)
        return replace(
            scene,
            lights=scene.lights if self.lights is None else self.lights,
            world=scene.world if self.world is None else self.world,
            materials=tuple(self.materials.get(i, surface) for i, surface in enumerate(scene.materials)),
            meshes=tuple(meshes),
        )


def changes_between(before: Scene, after: Scene) -> SceneChanges | None:
    """Return the changes between two scenes; None if the numbers of parts or the lightmaps differ."""
    counts = [(len(scene.meshes), len(scene.materials)) for scene in (before, after)]
    others = [entry.name for entry in fields(Scene) if entry.name not in _CHANGING]
    if counts[0] != counts[1] or not all(
        same_values(getattr(before, name), getattr(after, name)) for name in others
    ):
        return None
    return SceneChanges(
        lights=None if same_values(before.lights, after.lights) else after.lights,
        world=None if same_values(before.world, after.world) else after.world,
        materials=_replaced(before.materials, after.materials),
        meshes=_replaced(before.meshes, after.meshes),
    )


def same_probe_volumes(one: Scene, other: Scene) -> bool:
    """Return True if two scenes have the same probe volumes in world space, whatever their origins are."""
    if len(one.probe_volumes) != len(other.probe_volumes):
        return False
    shift = np.zeros((4, 4))
    shift[:3, 3] = one.origin - other.origin
    return all(
        (before.name, before.resolution) == (after.name, after.resolution)
        and np.allclose(before.matrix + shift, after.matrix, rtol=0, atol=_SAME_PLACE)
        for before, after in zip(one.probe_volumes, other.probe_volumes, strict=True)
    )


def transformed(mesh: Mesh, matrix: np.ndarray) -> Mesh:
    """Return a mesh transformed by a matrix, (4, 4) float64; a mirrored mesh stays counter-clockwise.

    Raises SceneError for a singular matrix.
    """
    linear = np.asarray(matrix, np.float64)[:3, :3]
    turned = float(np.linalg.det(linear))
    if not np.isfinite(turned) or turned == 0:
        raise SceneError(f"The matrix that moves '{mesh.name}' has no inverse. Use a scale other than 0.")
    positions = mesh.positions @ linear.T + np.asarray(matrix, np.float64)[:3, 3]
    normals = mesh.normals.astype(np.float64) @ np.linalg.inv(linear)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-30)
    corners = [0, 1, 2] if turned > 0 else [0, 2, 1]
    return replace(
        mesh,
        positions=positions.astype(np.float32)[:, corners],
        normals=normals.astype(np.float32)[:, corners],
        uvs=mesh.uvs[:, corners],
        texture_uvs={name: uvs[:, corners] for name, uvs in mesh.texture_uvs.items()},
    )


def _replaced(before: tuple[Part, ...], after: tuple[Part, ...]) -> dict[int, Part]:
    """Return the parts that differ, by index."""
    pairs = zip(before, after, strict=True)
    return {number: new for number, (old, new) in enumerate(pairs) if not same_values(old, new)}


def _check_numbers(kind: str, numbers: Iterable[int], count: int) -> None:
    """Raise SceneError if an index in `numbers` is not below `count`."""
    unknown = sorted(number for number in numbers if not 0 <= number < count)
    if unknown:
        raise SceneError(
            f"Changes refer to index {unknown[0]} of the scene's {kind}, but there are {count}. "
            "Start a new bake to add some."
        )
