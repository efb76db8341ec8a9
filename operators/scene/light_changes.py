"""How much the light of objects has changed: quick bakes, of a scene before and now, are compared."""

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

#: Rays of each patch, and to each light, of a quick bake; and those for ambient occlusion.
_RAYS, _LIGHT_RAYS, _AO_RAYS = 64, 16, 64

#: What is left of the mean error of a bake in a quick one: that of the worst texel is some times as large.
_CLOSER = 64

#: A light group that gives less than this part of all light counts as if it gave so much.
_FAINTEST = 0.01

#: More than any change.
ALL_LIGHT = 1e30


def comparison_settings(settings: Settings) -> Settings:
    """Return settings for the same patches as those of a bake, but few rays of each.

    A change that many texels see by a few rays each is met by some of these.
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
        scheduler="",
    )


def tells_all(settings: Settings, before: Scene, now: Scene) -> bool:
    """Return whether quick bakes tell all that has changed of what a bake shows.

    Shadow masks are of single lamps, and light groups that were renamed or are new have other maps.
    """
    groups = settings.by_light_groups and light_group_names(before) != light_group_names(now)
    return not groups and "shadow_mask" not in settings.outputs


def differing_lights(before: Scene, now: Scene) -> tuple[Scene, Scene] | None:
    """Return both scenes with nothing that shines but the lamps that differ; None if not only lamps differ.

    Light adds up, so that these tell all change of it, and other lamps none of their noise.
    """
    if not same_values(replace(before, lights=()), replace(now, lights=())):
        return None
    return _lit_by_others(before, now), _lit_by_others(now, before)


def _lit_by_others(scene: Scene, other: Scene) -> Scene:
    """Return a scene with no other light than of lamps that another scene does not have."""
    lamps = (lamp for lamp in scene.lights if not any(same_values(lamp, known) for known in other.lights))
    dark = map(without_emission, scene.materials)
    world = np.zeros_like(scene.world)
    return replace(scene, lights=tuple(lamps), materials=tuple(dark), world=world)


@dataclass(frozen=True)
class QuickBakes:
    """Lightmaps that tell how light has changed.

    whole        of the scene as it was
    before, now  of the light that may differ, as it was and as it is
    """

    whole: BakeResult
    before: BakeResult
    now: BakeResult


def light_changes(read: ReadScene, quick: QuickBakes) -> dict[int, float]:
    """Return how much the light of each object may have changed, by session uid.

    The largest change of a texel, as a fraction of its light before, or of the object's mean where that is
    more. ALL_LIGHT where a texel was no patch before, or no texel is one.
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
    """Return the largest change of some texels in any output, see `_largest_step`."""
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
    """Return the light, (n, 3) float32, that changes of a map are relative to.

    That is the map, but of a light group a part of all light at least, and all of that for what carries
    directional maps.
    """
    if is_of_light_group(name):
        return np.maximum(whole[name], _FAINTEST * whole["combined"])
    return whole["combined" if name.endswith(CARRIED) else name]


def _light_of(lightmap: BakeResult, texels: tuple) -> dict[str, np.ndarray]:
    """Return what some texels show, (n, 3) float32 by name: light, and fractions of it.

    Directional maps change with the light that carries them; they are compared to all of that.
    """
    maps = {name: image[texels] for name, image in lightmap.passes.items()}
    light = {name: image for name, image in maps.items() if name not in SIGNED_MAPS}
    return light | encode_signed_maps(maps)


def _largest_step(whole: np.ndarray, before: np.ndarray, now: np.ndarray) -> float:
    """Return the largest change of all channels of light, relative to a texel's whole or the mean of all.

    whole, before, now  (n, 3) float32
    """
    change = np.abs(now.astype(np.float64) - before).sum(axis=1)
    if not change.any():
        return 0.0
    light = whole.sum(axis=1, dtype=np.float64)
    light = np.maximum(light, light.mean())
    return float((change / light).max()) if light.min() > 0 else ALL_LIGHT
