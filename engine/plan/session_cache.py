"""Session cache: data that depends on geometry only and is reused by the next bake."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..direct.contact import Contacts
from ..direct.direct_light_cache import DirectLightCache
from ..direct.emitters import SampledTriangles, choose_sampled_triangles
from ..direct.lighting import DirectLighting
from ..direct.sky import Sky, split_sky
from ..gather.background_light import BackgroundLight
from ..gather.visibility_cache import VisibilityCache
from ..patches.areas import surface_areas
from ..patches.device_edge_neighbours import DeviceNeighbours
from ..patches.patch_list import PatchList
from ..patches.patch_materials import KnownSurfaces, patch_surfaces
from ..patches.patch_scene import PatchScene, make_patch_scene
from ..patches.seams import Seams
from ..patches.texel_fragments import TexelClipper
from ..postprocess.lightmap_points import LightmapPoints, off_centre_patches
from ..postprocess.seam_lookups import display_seams
from ..postprocess.store import LightmapImages
from ..resume.checkpoint import Checkpoints
from ..scene.digests import ArrayDigests, geometry_digest, surfaces_digest
from ..scene.model import Scene
from ..scene.open_surfaces import OpenSurfaces
from ..setting_types import VISIBILITY
from ..settings import Settings, descriptions
from ..validity.invalid import patches_inside
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.upper_levels import UpperLevels
from ..visibility.sampler import directional_options
from ..visibility.unoccluded_sky import open_sky
from .previous_solution import PreviousSolution
from .substitute_patches import PatchPairs, find_substitutes

#: Maximum size in bytes of a sky that is stored for comparison with the next one.
_MOST_SKY = 1 << 26

#: Divisor of the device memory for the default budget of the cache.
_PART = 4


class SessionCache:
    """Patches, ray tracer and visibility of a scene, on the devices of a session.

    The cache is valid for any bake with the same geometry, lightmap UVs, transparency and visibility
    settings.

    samples      visibility cache; None if it is not stored
    light        solution of the last bake, for a warm start, whatever its geometry; None if there is none
    sampled      direct light of that bake
    key          digest of the scene and settings for which the cache is valid
    surfaces     open surfaces of the last scene
    checkpoints  files of interrupted bakes and of the current one
    """

    samples: VisibilityCache | None
    light: PreviousSolution | None = None
    sampled: DirectLightCache | None = None
    key: tuple | None
    checkpoints: Checkpoints
    _parts: PatchScene | None
    _follows: bool
    _rays: RayScene | None
    _top: UpperLevels | None
    _seams: Future[Seams] | None
    _areas: Future[np.ndarray] | None
    _inside: np.ndarray | None
    _near: Contacts | None
    _clipper: TexelClipper | None
    _thin: tuple[np.ndarray, LightmapPoints] | None
    _sky: tuple[np.ndarray, np.ndarray | None] | None = None
    _split: tuple[np.ndarray, Sky] | None = None
    _static: tuple[np.ndarray, BackgroundLight] | None
    _surfaces_of: Scene | None
    _bright: tuple[np.ndarray, np.ndarray | None, SampledTriangles] | None
    _beside: tuple[PatchList, np.ndarray, PatchPairs] | None
    _store: LightmapImages | None = None

    def __init__(self) -> None:
        self.key, self.surfaces = None, OpenSurfaces()
        self.checkpoints = Checkpoints()
        self._surfaces_key, self._surfaces_of, self._arrays = b"", None, ArrayDigests()
        self.clear()

    def clear(self) -> None:
        """Drop all data that depends on geometry."""
        self._parts = self._rays = self._top = self._seams = self.samples = None
        self._areas = self._inside = self._near = self._clipper = self._thin = None
        self._static = self._bright = self._beside = None
        self._follows = False

    def make_patch_scene(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
    ) -> PatchScene:
        """Return the patches of a scene whose objects without lightmap have charts.

        Drops the data of other geometry or visibility settings. A warm start keeps the old visibility
        samples, since they remain valid where nothing moved. See `patches.patch_scene.make_patch_scene`.
        """
        arrays = self._arrays if settings.warm_start else None
        key = (geometry_digest(scene, arrays), *visibility_settings(settings))
        surfaces = surfaces_digest(scene, arrays)
        before = self._parts if settings.warm_start and self.key and self.key[1:] == key[1:] else None
        if key != self.key or (self._follows and not settings.warm_start):
            samples, rays = self.samples, self._rays
            self.clear()
            if before:
                self.samples, self._top = samples, rays.top if rays else None
        if self._parts is None:
            self._follows = before is not None
            followed = (before, self._surfaces_of) if before else None
            self._parts = make_patch_scene(graphics, compute, scene, settings, followed)
        elif surfaces != self._surfaces_key:
            last = self._surfaces_of
            known = None if last is None else KnownSurfaces(last, self._parts.surfaces)
            made = patch_surfaces(compute, scene, self._parts.geometry, settings.resolution, known)
            if not made.shine_as(self._parts.surfaces):
                self._near = None
            self._parts = self._parts.with_surfaces(made)
        self.key, self._surfaces_key = key, surfaces
        self._surfaces_of = scene if settings.warm_start else None
        return self._parts

    def ray_scene(self, compute: ComputeDevice | None, parts: PatchScene) -> RayScene:
        """Return the ray tracer with the patches as origins."""
        if self._rays is None:
            self._rays = RayScene(compute, parts, self._top)
        return self._rays

    def begin(
        self, compute: ComputeDevice | None, parts: PatchScene, atlases: int, settings: Settings
    ) -> tuple[Future[np.ndarray], Future[Seams] | None]:
        """Start to compute the area of each patch in a background thread; return the futures.

        The thread then computes the seams of the first `atlases` lightmaps if the settings request them. They
        are needed last, and two threads would slow each other down.
        """
        thread = ThreadPoolExecutor(1, "kept")
        if self._areas is None:
            self._areas = thread.submit(surface_areas, parts.triangles, parts.patches, parts.geometry)
        if self._seams is None and settings.hide_seams:
            neighbours, resolution = DeviceNeighbours(compute) if compute else None, parts.patches.resolution
            self._seams = thread.submit(display_seams, parts.triangles, atlases, resolution, neighbours)
        thread.shutdown(wait=False)
        return self._areas, self._seams if settings.hide_seams else None

    def choose_sampled_triangles(self, parts: PatchScene) -> SampledTriangles:
        """Return the triangles that are sampled as lights; see `direct.emitters.choose_sampled_triangles`."""
        last, surfaces = self._bright, parts.surfaces
        emission, backs = surfaces.emission, surfaces.back_emission
        if last is None or last[0] is not emission or last[1] is not backs:
            self._bright = last = emission, backs, choose_sampled_triangles(parts)
        return last[2]

    def split_sky(self, world: np.ndarray) -> Sky:
        """Return both parts of a world, cached until the world changes; see `direct.sky.split_sky`."""
        last = self._split
        if last is None or not (last[0] is world or np.array_equal(last[0], world)):
            last = world, split_sky(world)
        self._split = last if world.nbytes <= _MOST_SKY else None
        return last[1]

    def contacts(self, lighting: DirectLighting) -> Contacts:
        """Return the contacts of the patches, cached until the set of emissive patches changes."""
        if self._near is None:
            self._near = lighting.contacts()
        return self._near

    def find_substitutes(self, parts: PatchScene, hidden: np.ndarray) -> PatchPairs:
        """Return the candidates for substitutes; see `substitute_patches.find_substitutes`."""
        last = self._beside
        if last is None or last[0] is not parts.patches or not np.array_equal(last[1], hidden):
            self._beside = last = parts.patches, hidden, find_substitutes(parts, hidden)
        return last[2]

    def inside(self, rays: RayScene) -> np.ndarray:
        """Return the patches inside geometry, (n,) bool; see `validity.invalid.patches_inside`."""
        if self._inside is None:
            self._inside = patches_inside(rays, rays.count)
        return self._inside

    def off_centre_patches(
        self, compute: ComputeDevice | None, parts: PatchScene
    ) -> tuple[np.ndarray, LightmapPoints]:
        """Return the patches not at their texel's centre; see `lightmap_points.off_centre_patches`."""
        if self._thin is None:
            self._thin = off_centre_patches(compute, parts.triangles, parts.patches)
        return self._thin

    def clipper(self, compute: ComputeDevice, parts: PatchScene) -> TexelClipper:
        """Return the clipper of triangles at texel borders."""
        if self._clipper is None:
            self._clipper = TexelClipper(compute, parts.triangles, parts.patches.resolution)
        return self._clipper

    def begin_texels(
        self, compute: ComputeDevice, parts: PatchScene, atlases: int, settings: Settings
    ) -> None:
        """Prepare what the images of the first `atlases` lightmaps need independently of light."""
        if settings.texel_samples > 1:
            self.clipper(compute, parts).rows(atlases)
        if settings.hide_seams:
            self.off_centre_patches(compute, parts)

    def static_light(
        self, sky: np.ndarray, found: bool, make: Callable[[], BackgroundLight]
    ) -> BackgroundLight:
        """Return the background light of `samples`; compute it if the samples or the sky have changed.

        sky    (h, w, 3) float32, radiance, equirectangular, without the part that lights sample
        found  False if some samples are not yet computed
        make   creates the background light
        """
        last = self._static
        if not (found and last is not None and np.array_equal(last[0], sky)):
            last = sky, make()
        self._static = last if sky.nbytes <= _MOST_SKY else None
        return last[1]

    def open_sky(self, sky: np.ndarray) -> np.ndarray | None:
        """Return E/pi of an unoccluded sky, cached; see `visibility.unoccluded_sky.open_sky`."""
        last = self._sky
        if last is None or not (last[0] is sky or np.array_equal(last[0], sky)):
            last = sky, open_sky(sky)
        self._sky = last if sky.nbytes <= _MOST_SKY else None
        return last[1]

    def store(
        self, patches: PatchList, atlases: int, settings: Settings, compute: ComputeDevice | None
    ) -> LightmapImages:
        """Return the lightmap images, reused if the texels are the same.

        Only a warm start keeps the invalid patches and the fill.
        """
        if self._store is not None and self._store.suits(patches, atlases, settings.margin):
            self._store.reset()
            if not settings.warm_start:
                self._store.show_all()
        else:
            self._store = LightmapImages(patches, atlases, settings.margin, compute)
        self._store.keeps_fill = settings.warm_start
        return self._store

    def light_on(
        self, compute: ComputeDevice | None, parts: PatchScene, atlases: int, settings: Settings
    ) -> PreviousSolution | None:
        """Return the last bake's light on these patches for a warm start, else None.

        Without it, starts to compute areas and seams; see `begin`.
        """
        if settings.warm_start and self.light:
            return self.light.on(parts.patches)
        self.begin(compute, parts, atlases, settings)
        return None

    def limit(self, compute: ComputeDevice | None, budget: int) -> None:
        """Drop visibility samples that exceed a memory budget, bytes; 0 is a quarter of the device memory."""
        if self._store is not None:
            self._store.reset()
        if compute is None or self.samples is None:
            return
        if self.samples.bytes > (budget or compute.device.global_mem_size // _PART):
            self.samples = None


def visibility_settings(settings: Settings) -> tuple:
    """Return the values of all settings that may change patches or visibility."""
    named = descriptions().items()
    values = (getattr(settings, name) for name, entry in named if VISIBILITY in entry.invalidates)
    return (*values, settings.has_indirect, directional_options(settings), _modified(settings.patch_file))


def _modified(path: str | None) -> int | None:
    """Return the modification time of a file, ns; None if there is none."""
    return Path(path).stat().st_mtime_ns if path is not None and Path(path).exists() else None
