"""Checks faces: coordinates, normals, scale and zero area."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ...engine.scene.degenerate import is_degenerate
from ..scene.objects.coordinate_limits import coordinate_issue, middle_of
from .finding import ERROR, WARNING, Finding, found
from .meshes import CheckedMesh

#: Triangles that are processed before control returns to Blender's window.
_CHUNK = 1 << 14

#: Types of objects that mark a closed mesh around them as a room, which is viewed from inside.
_CONTENTS = {"MESH", "LIGHT", "CAMERA", "CURVE", "FONT", "SURFACE", "META"}

Steps = Generator[None, None, list[Finding]]


def check_coordinates(
    meshes: Sequence[CheckedMesh],
) -> Generator[None, None, tuple[list[CheckedMesh], list[Finding]]]:
    """Return the meshes with usable coordinates, and findings on the others."""
    boxes, issues = [], []
    for mesh in meshes:
        boxes.append(mesh.box)
        yield
    middle = middle_of(boxes)
    yield
    for box in boxes:
        issues.append(coordinate_issue(box, middle))
        yield
    findings = []
    for issue in dict.fromkeys(filter(None, issues)):
        names = [mesh.name for mesh, its in zip(meshes, issues, strict=True) if its == issue]
        findings += found(ERROR, f"{{}}: {issue}", names)
    return [mesh for mesh, its in zip(meshes, issues, strict=True) if its is None], findings


def check_normals(meshes: Sequence[CheckedMesh], centres: dict[str, np.ndarray]) -> Steps:
    """Return findings on closed meshes whose normals point inwards or are mixed.

    A room may have normals that point inwards: a closed mesh with other objects inside.

    centres:  centres of all objects, see `centres_of`
    """
    turned, mixed = [], []
    for mesh in meshes:
        if mesh.is_closed:
            if not _is_even(mesh):
                mixed.append(mesh.name)
            elif (yield from _looks_inwards(mesh)) and not contains_things(mesh, centres):
                turned.append(mesh.name)
        yield
    return [
        *found(
            WARNING,
            "Normals point inward, and nothing is inside: {}. The lightmap stores the light of the inside, "
            "which is dark. Recalculate normals.",
            turned,
            "normals",
        ),
        *found(
            WARNING,
            "Normals point partly inward, partly outward: {}. Faces that point inward store the light of the "
            "inside. Recalculate normals.",
            mixed,
            "normals",
        ),
    ]


def check_faceless(objects: Sequence[bpy.types.Object], meshes: Sequence[CheckedMesh]) -> list[Finding]:
    """Return a finding on mesh objects without faces, which are not among the meshes."""
    names = {mesh.name for mesh in meshes}
    faceless = [obj.name for obj in objects if obj.name not in names]
    return found(WARNING, "No faces, so not baked: {}. Add faces, or set the role to Ignored.", faceless)


def check_scale(meshes: Sequence[CheckedMesh]) -> list[Finding]:
    """Return a finding on meshes whose matrix has a rank below 2, so that they are a line or a point."""
    names = [mesh.name for mesh in meshes if np.linalg.matrix_rank(mesh.matrix[:3, :3]) < 2]
    return found(WARNING, "Scale is 0, so that no light arrives: {}. Set a scale other than 0.", names)


def check_zero_area(
    meshes: Sequence[CheckedMesh],
) -> Generator[None, None, tuple[list[CheckedMesh], list[Finding]]]:
    """Remove triangles without area from meshes, as bakes do; return the meshes that have others.

    Single triangles without area are invisible, so only meshes that consist of them make a finding.
    """
    kept, names = [], []
    for mesh in meshes:
        degenerate = yield from _find_degenerate(mesh)
        if degenerate.any():
            mesh = replace(mesh, triangles=mesh.triangles[~degenerate])
        if len(mesh.triangles):
            kept.append(mesh)
        else:
            names.append(mesh.name)
    return kept, found(
        WARNING, "All faces have zero area, so not baked: {}. Scale them, or set the role to Ignored.", names
    )


def _find_degenerate(mesh: CheckedMesh) -> Generator[None, None, np.ndarray]:
    """Return a mask of the triangles of a mesh that have no area, (t,) bool."""
    parts = [np.zeros(0, bool)]
    for first in range(0, len(mesh.corners), _CHUNK):
        parts.append(is_degenerate(mesh.corners[first : first + _CHUNK]))
        yield
    return np.concatenate(parts)


def contains_things(mesh: CheckedMesh, centres: dict[str, np.ndarray]) -> bool:
    """Return whether the bounding box of a mesh contains the centre of another object, (3,) by name."""
    low, high = mesh.box
    others = [centre for name, centre in centres.items() if name != mesh.name]
    return bool(others) and bool(((np.array(others) > low) & (np.array(others) < high)).all(axis=1).any())


def centres_of(objects: Sequence[bpy.types.Object]) -> dict[str, np.ndarray]:
    """Return the centre of each object in world space, (3,) float64, by name."""
    middles = {}
    for obj in objects:
        if obj.type in _CONTENTS:
            box = np.array([corner[:] for corner in obj.bound_box], np.float64)
            middle = box.mean(axis=0) if obj.type != "LIGHT" and obj.type != "CAMERA" else np.zeros(3)
            matrix = np.array(obj.matrix_world, np.float64)
            middles[obj.name] = matrix[:3, :3] @ middle + matrix[:3, 3]
    return middles


def _is_even(mesh: CheckedMesh) -> bool:
    """Return whether the two faces at each edge have consistent orientation: they run along it oppositely."""
    forward = mesh.vertex == mesh.edges[mesh.edge, 0]
    return bool((np.bincount(mesh.edge, forward, len(mesh.edges))[mesh.edge] == 1).all())


def _looks_inwards(mesh: CheckedMesh) -> Generator[None, None, bool]:
    """Return whether the signed volume of a closed mesh is negative, so that its normals point inwards.

    A negative scale does not matter: Blender flips the faces of mirrored objects.
    """
    middle, volume = mesh.positions.mean(axis=0), 0.0
    for first in range(0, len(mesh.corners), _CHUNK):
        a, b, c = (mesh.corners[first : first + _CHUNK] - middle).transpose(1, 0, 2)
        volume += float((a * np.cross(b, c)).sum(dtype=np.float64))
        yield
    return volume < 0
