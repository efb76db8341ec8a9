"""Trace of one texel: the result of each stage of a bake, like pbrt's `--debugstart` for one pixel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from .bake_state import BakeState
from .direct.lighting import DirectLighting
from .outputs import is_light
from .progress import finished
from .scene.model import Scene, shining_lights
from .validity.invalid import is_invalid

#: Names that the trace uses, instead of a light group, for emissive faces and the bright sky.
_FACES, _WORLD = "(emissive faces)", "(bright sky)"


@dataclass(frozen=True)
class Texel:
    """Column x and row y of a texel of a lightmap; row 0 is at v = 0, the bottom row."""

    lightmap: int
    x: int
    y: int


def trace_texel(state: BakeState, texel: Texel) -> Iterator[str]:
    """Yield one line for each result of a bake at a texel; light is E/pi, scene-linear.

    Raises IndexError if the lightmaps have no such texel.
    """
    patches = state.patch_scene.patches
    shape = (state.atlases, patches.resolution, patches.resolution)
    if not all(0 <= number < size for number, size in zip(_index(texel), shape, strict=True)):
        raise IndexError(
            f"Texel {texel.x}, {texel.y}: outside the lightmap. Use numbers from 0 to {shape[1] - 1}."
        )
    yield f"texel            {state.scene.atlases[texel.lightmap]}, column {texel.x}, row {texel.y}"
    entry = int(patches.on_texels(state.atlases)[_index(texel)])
    if entry:
        yield from _patch(state, entry - 1)
    else:
        yield "patch            none: no surface covers the centre of this texel"
    yield from _samples(state, texel)
    yield from _images(state, texel)


def _index(texel: Texel) -> tuple[int, int, int]:
    """Return the index of a texel in arrays of shape (atlases, r, r): atlas, row, column."""
    return texel.lightmap, texel.y, texel.x


def _patch(state: BakeState, patch: int) -> Iterator[str]:
    """Yield the results of the stages that work on patches."""
    scene = state.patch_scene
    geometry, triangle = scene.geometry, int(scene.geometry.triangle[patch])
    mesh = state.scene.meshes[int(scene.triangles.mesh[triangle])]
    material = state.scene.materials[int(scene.triangles.material[triangle])]
    origin = state.scene.origin + scene.triangles.origin
    yield f"patch            {patch}, triangle {triangle} of '{mesh.name}', material '{material.name}'"
    yield f"position         {_numbers(geometry.center[patch] + origin)} m, world"
    yield f"normal           {_numbers(geometry.normal[patch])}"
    yield f"reflectance      {_numbers(np.asarray(scene.surfaces.reflectance)[patch])}"
    yield f"emission         {_numbers(np.asarray(scene.surfaces.emission)[patch])}"
    yield from _validity(state, patch)
    for name, light in _direct_light(state):
        yield f"direct light     {_numbers(light[patch])} from {name}"
    solution = state.solution
    yield f"not reflected    {_numbers(solution.direct[patch])} (direct light, sky and unsampled emission)"
    yield f"reflected        {_numbers(solution.indirect[patch])} ({solution.iterations} iterations)"
    yield f"at the centre    {_numbers(solution.irradiance[patch])}"


def _validity(state: BakeState, patch: int) -> Iterator[str]:
    """Yield the measurements that decide if a patch lies inside geometry."""
    contacts, invalid = state.contacts, is_invalid(state.validity, state.contacts)[patch]
    yield f"back faces       {max(0.0, 1 - float(state.validity[patch])):.1%} of the view"
    flags = [
        ("covered", contacts.covered),
        ("backlit", contacts.backlit),
        ("back to back", contacts.back_to_back),
    ]
    yield f"contacts         {', '.join(name for name, flag in flags if flag[patch]) or 'none'}"
    yield f"validity         {'invalid: the texel is filled' if invalid else 'valid'}"


def _direct_light(state: BakeState) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the name of each emitter and its direct light at all patches, (n, 3) float32.

    Each light has shadow rays of its own, so the sum differs from the bake's direct light by noise.
    """
    scene, names = _one_group_each(state.scene)
    lighting = DirectLighting(scene, state.patch_scene, state.rays, state.settings)
    yield from zip(names, finished(lighting.gather_by_group()), strict=False)


def _one_group_each(scene: Scene) -> tuple[Scene, list[str]]:
    """Return a scene with a group for each light, for all faces and for the world; and their names."""
    lights = shining_lights(scene)
    groups = tuple(f"{number} '{light.name}'" for number, light in enumerate(lights))
    lights = tuple(replace(light, light_group=name) for light, name in zip(lights, groups, strict=True))
    meshes = tuple(replace(mesh, light_group=_FACES) for mesh in scene.meshes)
    names = (*groups, _FACES, _WORLD)
    grouped = replace(scene, lights=lights, meshes=meshes, light_groups=names, world_light_group=_WORLD)
    return grouped, list(names)


def _samples(state: BakeState, texel: Texel) -> Iterator[str]:
    """Yield the light of each sample of a supersampled texel."""
    samples, resolution = state.samples.samples, state.patch_scene.patches.resolution
    key = (texel.lightmap * resolution + texel.y) * resolution + texel.x
    chosen = np.flatnonzero(samples.keys(resolution) == key)
    if not len(chosen):
        yield "texel samples    none: the texel shows the light at its centre"
    for number in chosen:
        where = samples.position[number] - (texel.x, texel.y)
        shown = {name: values[number] for name, values in state.samples.values.items() if is_light(name)}
        light = ", ".join(f"{name} {_numbers(value)}" for name, value in shown.items())
        yield (
            f"texel sample     at {_numbers(where)} of the texel, weight {samples.weight[number]:.3g}, "
            f"{'valid' if state.samples.visible[number] else 'invalid'}: {light}"
        )


def _images(state: BakeState, texel: Texel) -> Iterator[str]:
    """Yield the value of each output before and after the images are finished."""
    index = _index(texel)
    for name, image in state.images.items():
        values = state.texels.values(state.outputs[name], state.samples.values.get(name))
        known = "known" if state.texels.known[index] else "filled from its neighbours"
        yield f"{name:16} {_numbers(values[index])} before denoising, seams and fill; {known}"
        yield f"{name:16} {_numbers(image[index])} final"


def _numbers(values: np.ndarray) -> str:
    """Format numbers with six significant digits."""
    return " ".join(f"{float(value):.6g}" for value in np.atleast_1d(values))
