"""Measures how much the light of objects changed: compares quick bakes of the scene before and now."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...engine.bake_result import BakeResult
from ...engine.outputs import SIGNED_MAPS, is_of_light_group
from ...engine.postprocess.directional_denoising import CARRIED, encode_signed_maps
from ...engine.scene.digests import same_values
from ...engine.scene.light_groups import light_group_names
from ...engine.scene.model import NO_LIGHTMAP, Scene, without_emission
from ...engine.settings import Settings
from .bake_targets import source_of
from .read import ReadScene
from .uvs.uv_faults import covered_texels

#: Rays per patch of a quick bake, rays per patch and light, and rays for ambient occlusion.
_RAYS, _LIGHT_RAYS, _AO_RAYS = 64, 16, 64

#: Divisor of a bake's error tolerance for comparison bakes, because the worst texel's error is several times
#: the mean error.
_CLOSER = 64

#: Minimum light of a light group in comparisons, as a fraction of all light.
_FAINTEST = 0.01

#: A value larger than any change.
ALL_LIGHT = 1e30


def comparison_settings(settings: Settings) -> Settings:
    """Return settings with the same patches as a bake, but with few rays per patch.

    A change that affects a few rays of each of many texels is still hit by some of these rays.
    """
    return replace(
        settings,
        visibility="rays" if settings.method != "paper" else settings.visibility,
        samples=_RAYS,
        light_samples=min(_LIGHT_RAYS, settings.light_samples),
        ao_samples=min(_AO_RAYS, settings.ao_samples),
        texel_samples=1,
        tolerance=settings.tolerance / _CLOSER,
        adaptive=False,
        denoise=False,
        hide_seams=False,
        margin=0,
        intermediates=False,
        checkpoint_space=0,
        patch_file=None,
        light_probes=False,
        reflection_cubes=False,
        scheduler="",
    )


def detects_every_change(settings: Settings, before: Scene, now: Scene) -> bool:
    """Return True if comparison bakes can show every change of the outputs.

    They cannot for shadow masks, which belong to single lights, and for light groups that are new or renamed.
    """
    groups = settings.by_light_groups and light_group_names(before) != light_group_names(now)
    return not groups and "shadow_mask" not in settings.outputs


def differing_lights(before: Scene, now: Scene) -> tuple[Scene, Scene] | None:
    """Reduce both scenes to the lights that differ; return None if other light sources differ as well.

    Light is additive, so these lights give the whole change, without the noise of other lights.
    """
    if not same_values(replace(before, lights=()), replace(now, lights=())):
        return None
    return _lit_by_others(before, now), _lit_by_others(now, before)


def _lit_by_others(scene: Scene, other: Scene) -> Scene:
    """Return a scene with only the lights that the other scene lacks."""
    lamps = (lamp for lamp in scene.lights if not any(same_values(lamp, known) for known in other.lights))
    dark = map(without_emission, scene.materials)
    world = np.zeros_like(scene.world)
    return replace(scene, lights=tuple(lamps), materials=tuple(dark), world=world)


@dataclass(frozen=True)
class QuickBakes:
    """Comparison bakes: results of low-sample bakes of two versions of a scene.

    whole:   the scene as it was, with all light
    before:  the light that may differ, as it was
    now:     the light that may differ, as it is now
    """

    whole: BakeResult
    before: BakeResult
    now: BakeResult


def light_changes(read: ReadScene, quick: QuickBakes) -> dict[int, float]:
    """Return the relative change of each object's light, by session uid.

    It is the largest change of a texel, as a fraction of its light before or of the object's mean, if that is
    larger. It is ALL_LIGHT if the object's patches changed, or if it has none.
    """
    before, now = quick.before, quick.now
    changes: dict[int, float] = {}
    resolution = now.has_patch.shape[1]
    for mesh, entry in zip(read.scene.meshes, read.entries, strict=True):
        if mesh.atlas == NO_LIGHTMAP or entry is None:
            continue
        name = now.atlases[mesh.atlas]
        texels, _ = covered_texels(mesh.uvs, resolution)
        row, column = np.divmod(texels, resolution + 1)
        here = (now.atlases.index(name), row, column)
        there = (before.atlases.index(name), row, column) if name in before.atlases else None
        change = ALL_LIGHT if there is None else _largest_change(quick, there, here)
        uid = source_of(entry)
        changes[uid] = max(changes.get(uid, 0.0), change)
    return changes


def _largest_change(quick: QuickBakes, there: tuple, here: tuple) -> float:
    """Return the largest change of the texels of one object in any output."""
    patches = quick.now.has_patch[here]
    if not patches.any() or not np.array_equal(patches, quick.before.has_patch[there]):
        return ALL_LIGHT
    whole, before, now = (
        _light_of(lightmap, tuple(axis[patches] if np.ndim(axis) else axis for axis in texels))
        for lightmap, texels in ((quick.whole, there), (quick.before, there), (quick.now, here))
    )
    black = np.zeros((int(patches.sum()), 3), np.float32)
    return max(
        _largest_step(_reference(name, whole), before.get(name, black), now.get(name, black))
        for name in whole
    )


def _reference(name: str, whole: dict[str, np.ndarray]) -> np.ndarray:
    """Return the light, (n, 3) float32, relative to which changes of a map are measured.

    It is the map itself. For a light group it is at least a fraction of all light. For directional maps it is
    all light, because they are weighted by it.
    """
    if is_of_light_group(name):
        return np.maximum(whole[name], _FAINTEST * whole["combined"])
    return whole["combined" if name.endswith(CARRIED) else name]


def _light_of(lightmap: BakeResult, texels: tuple) -> dict[str, np.ndarray]:
    """Return the values of chosen texels, (n, 3) float32, for each map of a bake.

    Directional maps are encoded to light, because their changes matter in proportion to the light.
    """
    maps = {name: image[texels] for name, image in lightmap.passes.items()}
    light = {name: image for name, image in maps.items() if name not in SIGNED_MAPS}
    return light | encode_signed_maps(maps)


def _largest_step(whole: np.ndarray, before: np.ndarray, now: np.ndarray) -> float:
    """Return the maximum change of light, summed over channels, relative to the larger of texel and mean.

    The larger of both counts. `whole`, `before` and `now` are (n, 3) float32.
    """
    change = np.abs(now.astype(np.float64) - before).sum(axis=1)
    if not change.any():
        return 0.0
    light = whole.sum(axis=1, dtype=np.float64)
    light = np.maximum(light, light.mean())
    return float((change / light).max()) if light.min() > 0 else ALL_LIGHT
