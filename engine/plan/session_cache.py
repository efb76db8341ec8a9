"""Session cache: data that depends on geometry only and is reused by the next bake."""

from __future__ import annotations

from collections.abc import Generator
from functools import partial
from pathlib import Path

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..direct.direct_light_cache import DirectLightCache
from ..direct.emitter_cache import MAX_SKY_BYTES, EmitterCache
from ..gather.background_light import BackgroundLight
from ..gather.visibility_cache import VisibilityCache
from ..patches.backs import find_candidates, with_backs, with_places
from ..patches.patch_materials import KnownSurfaces, patch_surfaces
from ..patches.patch_scene import PatchScene, make_patch_scene
from ..postprocess.texel_cache import TexelCache
from ..resume.checkpoint import Checkpoints
from ..scene.digests import ArrayDigests, geometry_digest, surfaces_digest
from ..scene.memo import Memo
from ..scene.model import Scene
from ..scene.open_surfaces import OpenSurfaces
from ..setting_types import VISIBILITY
from ..settings import Settings, descriptions
from ..validity.invalid import patches_inside
from ..validity.substitutes import PatchPairs, find_substitutes
from ..visibility.rays.bvh import Bvh
from ..visibility.rays.ray_scene import RayScene, make_tracer
from ..visibility.rays.shaders.host_bvh import HostBvh
from ..visibility.rays.shaders.shader_scene import ShaderScene
from ..visibility.rays.upper_levels import UpperLevels
from ..visibility.rays.visible_backs import VisibleBacks
from ..visibility.sampler import directional_options
from .previous_solution import PreviousSolution

#: Divisor of the device memory for the default budget of the cache.
_PART = 4


class SessionCache:
    """Patches, ray tracer and visibility of a scene, on the devices of a session.

    The cache is valid for any bake with the same geometry, lightmap UVs, transparency and visibility
    settings.

    samples:         visibility cache; None if it is not stored
    emitters:        sampled emitters and contacts
    texels:          areas, seams and images
    background:      light of sky and emissive back faces, by sky
    unoccluded_sky:  E/pi of the whole sky, by sky; see `visibility.unoccluded_sky.open_sky`
    light:           solution of the last bake, for a warm start, whatever its geometry; None if there is none
    sampled:         direct light of that bake
    key:             digest of the scene and settings for which the cache is valid
    surfaces:        open surfaces of the last scene
    probes:          visibility of probes, by volume and samples; see `probes.gather_probes`
    visible:         back faces of the last scene that rays from surfaces meet
    checkpoints:     files of interrupted bakes and of the current one
    """

    samples: VisibilityCache | None
    light: PreviousSolution | None = None
    sampled: DirectLightCache | None = None
    key: tuple | None
    _patch_scene: PatchScene | None
    _follows: bool
    _rays: RayScene | None
    _top: UpperLevels | None
    _surfaces_of: Scene | None

    def __init__(self) -> None:
        self.key, self.surfaces, self.visible = None, OpenSurfaces(), VisibleBacks()
        self._backs = Memo[Scene]()
        self.checkpoints = Checkpoints()
        self.emitters, self.texels = EmitterCache(), TexelCache()
        self.background = Memo[BackgroundLight](MAX_SKY_BYTES)
        self.unoccluded_sky = Memo[np.ndarray | None](MAX_SKY_BYTES)
        self._inside = Memo[np.ndarray]()
        # Iterations and final gathers have different invalid patches.
        self._substitutes = Memo[PatchPairs](results=2)
        self._surfaces_key, self._surfaces_of, self._arrays = b"", None, ArrayDigests()
        self.probes = dict[tuple, object]()
        self.clear()

    def clear(self) -> None:
        """Drop all data that depends on geometry."""
        self._patch_scene = self._rays = self._top = self.samples = None
        self._follows = False
        for data in (
            self.emitters, self.texels, self.background, self._inside, self._substitutes, self.probes,
        ):  # fmt: skip
            data.clear()

    def with_places(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
    ) -> Generator[None, None, Scene]:
        """Return the scene with lightmap UVs for what has none; see `patches.backs.with_places`.

        Yields between launches of the rays that find visible backs. A warm start keeps the choice of visible
        backs while objects move; see `refresh_backs`. With a patch file all backs have patches, so that its
        charts do not depend on positions or devices.
        """
        if settings.patch_file is not None:
            return with_places(scene, settings.resolution, self.surfaces)
        placed, candidates, texel = find_candidates(scene, settings.resolution, self.surfaces)
        is_visible = yield from self.visible.find(
            partial(make_tracer, graphics, compute), placed, candidates, texel, settings.resolution,
            is_moving=settings.warm_start,
        )  # fmt: skip
        return with_backs(placed, is_visible, settings.resolution, texel, self._backs)

    def refresh_backs(self, graphics: GraphicsContext, compute: ComputeDevice | None) -> bool:
        """Choose the visible backs again after objects have moved; return True if the choice changes."""
        return self.visible.refresh(partial(make_tracer, graphics, compute))

    def make_patch_scene(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
    ) -> PatchScene:
        """Return the patches of a scene whose objects without lightmap have charts.

        Drops the data of other geometry or visibility settings. A warm start keeps the old visibility
        samples, since they remain valid where nothing moved. See `patches.patch_scene.make_patch_scene`.
        """
        if self.key is None:
            return self._make_first(graphics, compute, scene, settings)
        arrays = self._arrays if settings.warm_start else None
        key = (geometry_digest(scene, arrays), *visibility_settings(settings))
        surfaces = surfaces_digest(scene, arrays)
        before = self._patch_scene if settings.warm_start and self.key[1:] == key[1:] else None
        if key != self.key or (self._follows and not settings.warm_start):
            samples, rays = self.samples, self._rays
            self.clear()
            if before:
                self.samples, self._top = samples, rays.top if rays else None
        if self._patch_scene is None:
            self._follows = before is not None
            followed = (before, self._surfaces_of) if before else None
            self._patch_scene = make_patch_scene(graphics, compute, scene, settings, followed)
        elif surfaces != self._surfaces_key:
            last = self._surfaces_of
            known = None if last is None else KnownSurfaces(last, self._patch_scene.surfaces)
            made = patch_surfaces(compute, scene, self._patch_scene.geometry, settings.resolution, known)
            if not made.has_emitters_of(self._patch_scene.surfaces):
                self.emitters.clear_contacts()
            self._patch_scene = self._patch_scene.with_surfaces(made)
        self.key, self._surfaces_key = key, surfaces
        self._surfaces_of = scene if settings.warm_start else None
        return self._patch_scene

    def _make_first(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
    ) -> PatchScene:
        """Return the result of `make_patch_scene` for an empty cache; threads hash long arrays meanwhile."""
        arrays = self._arrays if settings.warm_start else ArrayDigests()
        arrays.begin(scene)
        options = visibility_settings(settings)
        self._patch_scene = make_patch_scene(graphics, compute, scene, settings)
        self.key = geometry_digest(scene, arrays), *options
        self._surfaces_key = surfaces_digest(scene, arrays)
        self._surfaces_of = scene if settings.warm_start else None
        return self._patch_scene

    def ray_scene(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, patch_scene: PatchScene
    ) -> RayScene:
        """Return the ray tracer with the patches as origins; of compute shaders if there is no OpenCL.

        scene:  scene of the patches
        """
        if self._rays is None:
            known = partial(self.visible.bvh_of, scene, patch_scene.triangles.origin)
            shaders = ShaderScene(graphics, patch_scene, known(HostBvh)) if compute is None else None
            self._rays = RayScene(compute, patch_scene, self._top, shaders, known(Bvh))
        return self._rays

    def find_substitutes(
        self, patch_scene: PatchScene, invalid: np.ndarray, compute: ComputeDevice | None = None
    ) -> PatchPairs:
        """Return the pairs of `substitutes.find_substitutes`, cached for the same patches and mask.

        Patch groups with the same representatives may have other members, so that the index maps differ.
        """
        inputs = patch_scene.patches, patch_scene.entries, invalid
        return self._substitutes.get(inputs, lambda: find_substitutes(patch_scene, invalid, compute))

    def inside(self, rays: RayScene) -> np.ndarray:
        """Return the patches inside geometry, (n,) bool; see `validity.invalid.patches_inside`."""
        return self._inside.get((), lambda: patches_inside(rays, rays.count))

    def light_on(
        self, compute: ComputeDevice | None, patch_scene: PatchScene, atlases: int, settings: Settings
    ) -> PreviousSolution | None:
        """Return the last bake's light on these patches for a warm start, else None.

        Without it, starts to compute areas and seams, see `TexelCache.begin`, unless the kernel of seams may
        still have to be built.
        """
        if settings.warm_start and self.light:
            return self.light.on(patch_scene.patches)
        if compute is None or not compute.is_preparing:
            self.texels.begin(compute, patch_scene, atlases, settings)
        return None

    def limit(self, compute: ComputeDevice | None, budget: int) -> None:
        """Free visibility samples that exceed a memory budget, bytes; 0 is a quarter of the device memory."""
        if compute is None or self.samples is None:
            return
        if not self.samples.shrink(budget or compute.device.global_mem_size // _PART):
            self.samples = None


def visibility_settings(settings: Settings) -> tuple:
    """Return the values of all settings that may change patches or visibility."""
    named = descriptions().items()
    values = (getattr(settings, name) for name, entry in named if VISIBILITY in entry.invalidates)
    return (*values, settings.has_indirect, directional_options(settings), _modified(settings.patch_file))


def _modified(path: str | None) -> int | None:
    """Return the modification time of a file, ns; None if there is none."""
    return Path(path).stat().st_mtime_ns if path is not None and Path(path).exists() else None
