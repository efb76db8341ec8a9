"""Closed bodies of glass: each front face also reflects the light of the face behind it.

A body has no patches inside, which could reflect light at the far face of a pane.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..scene.model import Material, Mesh, Scene
from ..scene.open_surfaces import OpenSurfaces
from ..scene.transmission import BACK, FRONT, Fresnel, Transmission, Transmittance, angular_factor

#: Minimum transmittance of a face at normal incidence, of each channel, with separate sides. Below it, light
#: that meets one side only would be wrong by more than 2.5 % (computed).
_CLEAREST = 0.8


def with_closed_glass(scene: Scene, surfaces: OpenSurfaces | None = None) -> Scene:
    """Return the scene with other materials for closed bodies of glass; the same scene without such bodies.

    Only glass faces count: a single sheet in a closed room is open.

    surfaces:  open surfaces of the previous scene; None without one
    """
    losses = [_plain_glass(material) for material in scene.materials]
    is_glass = np.array([loss is not None for loss in losses], bool)
    if not is_glass.any():
        return scene
    pairs = zip(scene.materials, losses, strict=True)
    bodies = tuple(_reflecting_twice(material, loss) for material, loss in pairs if loss is not None)
    numbers = np.cumsum(is_glass, dtype=np.int32) - 1 + len(is_glass)
    glass = [is_glass[mesh.material] for mesh in scene.meshes]
    is_open, first = (surfaces or OpenSurfaces()).of_parts(scene.meshes, glass), 0
    meshes = []
    for mesh, chosen in zip(scene.meshes, glass, strict=True):
        last = first + int(chosen.sum())
        closed = np.flatnonzero(chosen)[~is_open[first:last]]
        meshes.append(_with_numbers(mesh, closed, numbers))
        first = last
    return replace(scene, meshes=tuple(meshes), materials=(*scene.materials, *bodies))


def _with_numbers(mesh: Mesh, chosen: np.ndarray, numbers: np.ndarray) -> Mesh:
    """Return a mesh with other materials for the chosen triangles; the same mesh for none.

    chosen:   (k,) indices of triangles
    numbers:  (m,) int32, the other material of each material
    """
    if not len(chosen):
        return mesh
    material = mesh.material.copy()
    material[chosen] = numbers[material[chosen]]
    return replace(mesh, material=material)


def _plain_glass(material: Material) -> Fresnel | None:
    """Return the Fresnel term of untextured clear glass with equal sides; None for other materials.

    Tinted glass keeps a transmittance for each side, since light from inside a body meets one side only.
    """
    sides = material.transmission
    if material.translucent or material.back or sides.bounce_back or not material.reflectance.any():
        return None
    glass = [side for side in (sides.shadow, sides.bounce) if side.fresnel is not None]
    if sides.bounce.texture is not None or any(side.offset.min() < _CLEAREST for side in glass):
        return None
    return sides.bounce.fresnel


def _reflecting_twice(material: Material, loss: Fresnel) -> Material:
    """Return glass whose front also reflects the light of the face behind it.

    A face transmits T and reflects 1 - T of the light at an angle. Two faces reflect (1 - T) (1 + T^2), of
    which the front now reflects all. Its opaque part is (1 - T^2) / 2. The reflectance is scaled so that
    under uniform light the front reflects as much as both faces: by the mean of (1 - T) (1 + T^2) divided by
    the mean of (1 - T^2) / 2.
    """
    steps = 256
    cosines = np.sqrt((np.arange(steps) + 0.5) / steps)
    passed = float(np.max(material.transmission.bounce.offset)) * angular_factor(loss, cosines)
    factor = 2 * ((1 - passed) * (1 + passed**2)).mean() / (1 - passed**2).mean()
    sides = material.transmission.shadow, material.transmission.bounce
    return replace(
        material,
        reflectance=material.reflectance * np.float32(factor),
        transmission=Transmission(*(_side(side, body) for body in (FRONT, BACK) for side in sides)),
    )


def _side(face: Transmittance, body: int) -> Transmittance:
    """Return a face's transmittance for one side of a body; the same object without a Fresnel term."""
    return face if face.fresnel is None else replace(face, fresnel=replace(face.fresnel, body=body))
