"""What a bake leaves to the next one of its session: all that lights, colours and the world do not change."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
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
from ..settings import Settings
from ..validity.invalid import patches_inside
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.upper_levels import UpperLevels
from ..visibility.sampler import directional_options
from ..visibility.unoccluded_sky import open_sky
from .previous_solution import PreviousSolution
from .substitute_patches import PatchPairs, find_substitutes

#: Settings that change nothing of what patches are and see. Whether light bounces and has directions does.
_LEAVING_VISIBILITY = frozenset({
    "accelerate", "ao_distance", "ao_samples", "centres", "checkpoint_interval", "checkpoint_space",
    "denoise", "denoise_device", "denoise_library", "margin", "hide_seams", "intermediates", "max_bounces",
    "cache_budget", "light_samples", "outputs", "sample_emission", "scheduler", "texel_samples", "tolerance",
    "warm_start",
})  # fmt: skip

#: A larger sky, bytes, is not kept to be compared with the next one.
_MOST_SKY = 1 << 26

#: What is kept takes this part of the device's memory by default.
_PART = 4


class SessionCache:
    """The patches of a scene, the rays through it, and what patches see, on the devices of a session.

    It serves any bake of the same geometry, lightmap UVs and transparency by the same settings, as far as
    these change what patches see.

    samples      what patches see; None if that is not kept
    light        of the last bake that left it for a warm start, whatever its geometry; None if none did
    sampled      by shadow rays in that bake
    key          of the scene and settings that it serves
    surfaces     which surfaces of the last scene are open
    checkpoints  what a bake that was interrupted has left in files, and what the current one writes
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
        """Drop everything."""
        self._parts = self._rays = self._top = self._seams = self.samples = None
        self._areas = self._inside = self._near = self._clipper = self._thin = None
        self._static = self._bright = self._beside = None
        self._follows = False

    def make_patch_scene(
        self, graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
    ) -> PatchScene:
        """Return the patches of a scene whose occluders have places.

        See `patches.patch_scene.make_patch_scene`.

        All that is kept of other geometry, or by other settings, is dropped. On a warm start what is kept of
        other geometry stays to be compared with: its samples hold where nothing has moved.
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
        """Return what casts rays from the patches of the scene."""
        if self._rays is None:
            self._rays = RayScene(compute, parts, self._top)
        return self._rays

    def begin(
        self, compute: ComputeDevice | None, parts: PatchScene, atlases: int, settings: Settings
    ) -> tuple[Future[np.ndarray], Future[Seams] | None]:
        """Begin to find the area that each patch stands for, in a thread beside the devices.

        After that it finds the seams of the first `atlases` lightmaps, if they are asked for: they are needed
        last, and two threads would hold up each other.
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
        """Return both parts of a world, kept until it is another; see `direct.sky.split_sky`."""
        last = self._split
        if last is None or not (last[0] is world or np.array_equal(last[0], world)):
            last = world, split_sky(world)
        self._split = last if world.nbytes <= _MOST_SKY else None
        return last[1]

    def contacts(self, lighting: DirectLighting) -> Contacts:
        """Return what faces nearby do to the patches; it changes with which of them emit alone."""
        if self._near is None:
            self._near = lighting.contacts()
        return self._near

    def find_substitutes(self, parts: PatchScene, hidden: np.ndarray) -> PatchPairs:
        """Return which patches may stand in for hidden ones; see `substitute_patches.find_substitutes`."""
        last = self._beside
        if last is None or last[0] is not parts.patches or not np.array_equal(last[1], hidden):
            self._beside = last = parts.patches, hidden, find_substitutes(parts, hidden)
        return last[2]

    def inside(self, rays: RayScene) -> np.ndarray:
        """Return which patches are inside of something, (n,) bool; see `validity.invalid.patches_inside`."""
        if self._inside is None:
            self._inside = patches_inside(rays, rays.count)
        return self._inside

    def off_centre_patches(
        self, compute: ComputeDevice | None, parts: PatchScene
    ) -> tuple[np.ndarray, LightmapPoints]:
        """Return the patches that are not at their texel's centre.

        See `lightmap_points.off_centre_patches`.
        """
        if self._thin is None:
            self._thin = off_centre_patches(compute, parts.triangles, parts.patches)
        return self._thin

    def clipper(self, compute: ComputeDevice, parts: PatchScene) -> TexelClipper:
        """Return what clips the triangles at texels."""
        if self._clipper is None:
            self._clipper = TexelClipper(compute, parts.triangles, parts.patches.resolution)
        return self._clipper

    def begin_texels(
        self, compute: ComputeDevice, parts: PatchScene, atlases: int, settings: Settings
    ) -> None:
        """Make what images of the first `atlases` lightmaps need that is the same for any light."""
        if settings.texel_samples > 1:
            self.clipper(compute, parts).rows(atlases)
        if settings.hide_seams:
            self.off_centre_patches(compute, parts)

    def static_light(
        self, sky: np.ndarray, found: bool, make: Callable[[], BackgroundLight]
    ) -> BackgroundLight:
        """Return the static light of `samples`, made anew if these or the sky are others than before.

        sky    (h, w, 3) float32, radiance, equirectangular, as patches see it
        found  False if some samples are still to be found
        """
        last = self._static
        if not (found and last is not None and np.array_equal(last[0], sky)):
            last = sky, make()
        self._static = last if sky.nbytes <= _MOST_SKY else None
        return last[1]

    def open_sky(self, sky: np.ndarray) -> np.ndarray | None:
        """Return E/pi of all of a sky; see `visibility.unoccluded_sky.open_sky`.

        That of the last one is kept.
        """
        last = self._sky
        if last is None or not (last[0] is sky or np.array_equal(last[0], sky)):
            last = sky, open_sky(sky)
        self._sky = last if sky.nbytes <= _MOST_SKY else None
        return last[1]

    def store(
        self, patches: PatchList, atlases: int, settings: Settings, compute: ComputeDevice | None
    ) -> LightmapImages:
        """Return what puts values of patches into lightmaps: the last one, if it is of the same texels.

        Which of them are hidden, and what it fills images with, is kept for a warm start alone.
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
        """Return the light of the last bake on patches for a warm start.

        None without one; then areas and seams begin to be found, see `begin`.
        """
        if settings.warm_start and self.light:
            return self.light.on(parts.patches)
        self.begin(compute, parts, atlases, settings)
        return None

    def limit(self, compute: ComputeDevice | None, budget: int) -> None:
        """Drop what patches see if it takes more memory of the device than a budget, bytes.

        0 is a quarter of the device's.
        """
        if self._store is not None:
            self._store.reset()
        if compute is None or self.samples is None:
            return
        if self.samples.bytes > (budget or compute.device.global_mem_size // _PART):
            self.samples = None


def visibility_settings(settings: Settings) -> tuple:
    """Return all of the settings that may change what patches are and what they see."""
    names = [entry.name for entry in fields(settings) if entry.name not in _LEAVING_VISIBILITY]
    values = (getattr(settings, name) for name in names)
    return (*values, settings.has_indirect, directional_options(settings), _modified(settings.patch_file))


def _modified(path: str | None) -> int | None:
    """Return when a file was written last, ns; None without one."""
    return Path(path).stat().st_mtime_ns if path is not None and Path(path).exists() else None
