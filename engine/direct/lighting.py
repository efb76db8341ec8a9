"""Direct lighting of patches by shadow rays; shadow masks, ambient occlusion and contacts."""

from __future__ import annotations

from collections.abc import Callable, Generator
from copy import copy
from dataclasses import replace

import numpy as np

from ..nonzero import note_rows
from ..patches.patch_scene import PatchScene
from ..scene.light_groups import light_groups
from ..scene.model import Light, Scene, shining_lights
from ..settings import Settings
from ..visibility.rays.ray_scene import RayScene
from .contact import Contacts, find_contacts, patches_lit_by_backs
from .direct_light_cache import DirectLightCache
from .emitter_split import EmitterSplit, split_light
from .enclosed_lights import warn_enclosed_lights
from .shader_shadow_rays import ShaderShadowRays
from .shadow_rays import ShadowCaster, ShadowRays

#: Shadow rays per light for the preview.
_FEW = 4


class DirectLighting:
    """Direct lighting of a scene, and the emission that is left to the gather.

    gathered_emission:  (n, 3) float32, radiance of each patch's front that the gather has to handle
    backs_left:         (n, 3) float32, the same of the back; None if equal to the front
    gathered_sky:       (h, w, 3) float32, radiance of the sky that the gather has to handle
    l1:                 (n, 3, 3) float32, L1 of the sampled light after `gather`: world axis, rgb; see
                        irradiance_l1.cl. (0, 3, 3) without directional maps
    warnings:           sentences for the user
    """

    def __init__(
        self,
        scene: Scene,
        patch_scene: PatchScene,
        rays: RayScene,
        settings: Settings,
        elsewhere: ShadowCaster | None = None,
        split: EmitterSplit | None = None,
        meanwhile: Callable[[], object] | None = None,
    ) -> None:
        """Split the emission of a scene into sampled light and light for the gather.

        elsewhere:  casts rays from all patches on devices of other processes; None for this device
        split:      both parts of the emission; None to compute them
        meanwhile:  called while other processes cast rays
        """
        self._scene, self._patch_scene, self._settings = scene, patch_scene, settings
        self._ray_scene, self._meanwhile = rays, meanwhile
        self._lamps = [lamp.relative_to(patch_scene.triangles.origin) for lamp in shining_lights(scene)]
        self._shadow_rays: ShadowCaster | None = None
        self._elsewhere = elsewhere
        self._near: Contacts | None = None
        self._last: DirectLightCache | None = None
        self._changed: np.ndarray | None = None
        self.warnings: list[str] = []
        self.l1 = self._no_l1()
        split = split or split_light(scene.world, patch_scene, settings)
        self._bright, self._sky = split.bright, split.sky
        self.gathered_emission, self.gathered_sky = self._bright.gathered_emission, self._sky.rest
        same = self._bright.back_left is self.gathered_emission
        self.backs_left = None if same else self._bright.back_left
        shines = self._lamps or scene.world.any() or len(patch_scene.surfaces.shining)
        if settings.light_outputs and not shines:
            self.warnings.append(
                "Nothing emits light: the lightmaps are black. Add a light, an emissive material or a world."
            )

    def follow(self, last: DirectLightCache | None) -> None:
        """Reuse direct light of an earlier bake: rays are cast only where it may have changed."""
        if last is None or not self._samples_any:
            return
        casting = self._casting()
        if isinstance(casting, ShadowRays):
            self._changed = last.changed(casting, self._patch_scene, self._ray_scene)
            self._last = None if self._changed is None else last

    @property
    def part_to_sample(self) -> float:
        """Fraction of the patches from which shadow rays must be traced; the others keep cached light."""
        return 1.0 if self._changed is None else len(self._changed) / max(self._ray_scene.count, 1)

    @property
    def shader(self) -> ShaderShadowRays | None:
        """Caster of sampled light by a compute shader; None if OpenCL casts, or if no light is sampled."""
        if self._ray_scene.shaders is None or not self._samples_any:
            return None
        casting = self._casting()
        return casting if isinstance(casting, ShaderShadowRays) else None

    def sampled_light(self, light: np.ndarray) -> DirectLightCache | None:
        """Return `light`, the result of `gather`, as a cache for the next bake; None without OpenCL."""
        casting = self._casting() if self._samples_any else None
        if not isinstance(casting, ShadowRays):
            return None
        return DirectLightCache(casting.lights, self._patch_scene, self._ray_scene.receivers, light, self.l1)

    def gather(self) -> Generator[float, None, np.ndarray]:
        """Return E/pi of the sampled light, (n, 3) float32; yield progress 0..1."""
        if not self._samples_any:
            return self._no_light()
        if self._elsewhere is not None:
            return (yield from self._gathered_elsewhere(self._elsewhere))
        casting = self._casting()
        if self._last is not None and isinstance(casting, ShadowRays):
            return (yield from self._gather_changed(casting, self._last))
        light, self.l1 = yield from casting.sampled()
        return light

    def _gathered_elsewhere(self, elsewhere: ShadowCaster) -> Generator[float, None, np.ndarray]:
        """Return light that other processes sample; this device computes contacts meanwhile."""
        work = elsewhere.sampled()
        yield next(work)
        self._casting()
        self._near = self.contacts()
        if self._meanwhile is not None:
            self._meanwhile()
        light, self.l1 = yield from work
        return light

    def preview_gather(self) -> Generator[float, None, np.ndarray]:
        """Return a noisy version of `gather` from few shadow rays, for the display; yield progress 0..1."""
        if not self._samples_any:
            return self._no_light()
        few = replace(self._settings, light_samples=min(self._settings.light_samples, _FEW))
        quick = self.of(self._ray_scene, few)
        quick._last, quick._changed = self._last, self._changed
        return (yield from quick.gather())

    def _gather_changed(
        self, casting: ShadowRays, last: DirectLightCache
    ) -> Generator[float, None, np.ndarray]:
        """Sample light at the changed patches only; return the light of all patches, (n, 3) float32."""
        if not self.part_to_sample:
            self.l1 = last.l1
            return last.light
        some, l1 = yield from casting.sampled(self._changed)
        light, self.l1 = last.light.copy(), last.l1.copy()
        light[self._changed] = some
        if len(l1):
            self.l1[self._changed] = l1
        return light

    def gather_by_group(self) -> Generator[float, None, np.ndarray]:
        """Return E/pi of each light group at every patch, (groups, n, 3) float32; yield progress 0..1."""
        groups = light_groups(self._scene)
        if not self._samples_any:
            return np.zeros((groups.count, self._ray_scene.count, 3), np.float32)
        casting = self._cast_from(self._ray_scene, self._settings)
        return (yield from casting.sampled_by_group(groups))

    def left_to_hemicubes(self, group: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return one light group's emission for the gather: of fronts, of the sky, and of backs."""
        groups, triangles = light_groups(self._scene), self._patch_scene.triangles
        mine = groups.meshes[triangles.mesh[self._patch_scene.geometry.triangle]] == group
        sky = self.gathered_sky if groups.world == group else np.zeros((1, 1, 3), np.float32)
        backs = None if self.backs_left is None else self.backs_left * mine[:, None]
        return self.gathered_emission * mine[:, None], sky, backs

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return the visible fraction of a light for each patch, (n,) float32; yield progress 0..1."""
        return (yield from self._casting().shadow_mask(lamp))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the unoccluded fraction of each patch's hemisphere, (n,) float32.

        Yield progress 0..1.
        """
        return (yield from self._casting().ambient_occlusion())

    def contacts(self) -> Contacts:
        """Return masks of patches that are covered, back to back, or lit by back faces; see `Contacts`."""
        return self._near or Contacts(*self._in_contact(), self.lit_by_backs(self._ray_scene))

    def lit_by_backs(self, points: RayScene) -> np.ndarray:
        """Return a mask of points whose rays hit mostly back faces, one of them emissive, (n,) bool."""
        triangles = self._patch_scene.triangles
        shining = self._bright.shining[: triangles.solid]
        if not shining.any():
            return np.zeros(points.count, bool)
        return patches_lit_by_backs(points, points.count, shining, triangles.positions[: triangles.solid])

    def _in_contact(self) -> tuple[np.ndarray, np.ndarray]:
        """Return masks of patches covered by a touching face, and of patches back to back, (n,) bool each.

        A patch of a back face coincides with the front of the same face, which does not count as a cover.
        """
        covered, back_to_back = find_contacts(self._ray_scene, self._ray_scene.count)
        seen = ~self._ray_scene.on_backs
        return covered & seen, back_to_back & seen

    def of(self, points: RayScene, settings: Settings) -> DirectLighting:
        """Return a copy of this lighting for the points of another ray scene and for other settings."""
        other = copy(self)
        other._ray_scene, other._settings, other.warnings, other._near = points, settings, [], None
        other._shadow_rays, other.l1 = self._cast_from(points, settings), other._no_l1()
        other._last = other._changed = None
        return other

    @property
    def emitters(self) -> tuple[list[Light], EmitterSplit]:
        """Lights that emit, relative to `Triangles.origin`, and both parts of the other emission."""
        return self._lamps, EmitterSplit(self._bright, self._sky)

    @property
    def _samples_any(self) -> bool:
        """True if any light, surface or sky is sampled."""
        return bool(self._lamps) or len(self._bright.triangles) > 0 or self._sky.bright is not None

    def _no_light(self) -> np.ndarray:
        """Return E/pi of 0 for all patches, (n, 3) float32."""
        dark = np.zeros((self._ray_scene.count, 3), np.float32)
        note_rows(dark, np.zeros(0, np.int64))
        return dark

    def _no_l1(self) -> np.ndarray:
        """Return L1 vectors of 0 for all patches, (n, 3, 3) float32; (0, 3, 3) without directional maps."""
        return np.zeros((self._ray_scene.count if self._settings.directional else 0, 3, 3), np.float32)

    def _cast_from(self, points: RayScene, settings: Settings) -> ShadowRays | ShaderShadowRays:
        """Return the caster of shadow rays for the receivers of a ray scene."""
        known = self._shadow_rays
        if isinstance(known, ShadowRays) and known.compute is points.compute:
            return known.of(points, settings)
        lights = self._patch_scene, self._lamps, self._bright, self._sky, settings
        if points.shaders is not None:
            return ShaderShadowRays(points.shaders, *lights)
        return ShadowRays(points, *lights)

    def _casting(self) -> ShadowCaster:
        """Return the caster of shadow rays, created on first use; add warnings about enclosed lights."""
        if self._shadow_rays is None:
            rays = self._ray_scene.caster
            self.warnings += warn_enclosed_lights(rays, self._scene, self._patch_scene.triangles, self._lamps)
            self._shadow_rays = self._elsewhere or self._cast_from(self._ray_scene, self._settings)
        return self._shadow_rays
