"""Input of a solver: patches of a bake, their light, and the devices."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from ..array_ops import map_slabs
from ..device.buffers import upload_float4_once
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, colors_on_host
from ..device.gl_context import GraphicsContext
from ..device.opencl import cl
from ..device.program_cache import device_digest
from ..device.source import source_digest
from ..direct.contact import Contacts
from ..errors import DeviceError
from ..nonzero import has_rows
from ..patches.patch_scene import PatchScene
from ..resume.checkpoint import Checkpoint
from ..scene.color import channel_sum
from ..scene.digests import digest_of
from ..settings import Settings
from ..solve.anderson import COLUMNS
from ..solve.radiosity_state import PLAIN_COLUMNS, Areas, SolvedSurfaces, StartLight, areas_of
from ..visibility.rays.ray_scene import RayScene
from ..visibility.sampler import Background, upload_background
from ..visibility.unoccluded_sky import open_sky
from .previous_solution import DirectSources, PreviousSolution
from .remote_devices import RemoteDevices
from .session_cache import SessionCache, visibility_settings


@dataclass(frozen=True)
class SolveJob:
    """Radiosity equation of a bake.

    graphics, compute:  OpenGL context and OpenCL device; None without OpenCL
    patch_scene:        patches of the scene
    rays:               ray tracer with the patches as origins
    emission:           (n, 3) float32, radiance of each patch toward other patches
    sky:                (h, w, 3) float32, radiance, equirectangular, without the part that lights sample
    sampled_light:      (n, 3) float32, E/pi of light from shadow rays
    areas:              (n,) float32, m^2, area of each patch, or a future of it
    remote:             gather by other processes; None to gather here
    kept:               session cache of the patches
    indirect:           (n, 3) float32, E/pi of reflected light at the start of a warm start; None for none
    direct:             (n, 3) float32, E/pi of light before any reflection, if it is unchanged; else None
    validity:           (n,) float32, fraction without back faces, if it is unchanged; else None
    part_of:            job of all light, if this job solves a part of it, such as a light group
    contacts:           contacts of the patches; None if unknown
    backs:              (n, 3) float32, radiance of each patch's back face; None if equal to `emission`
    mapped:             number of patches in lightmaps, which come first; None if unknown
    """

    graphics: GraphicsContext
    compute: ComputeDevice | None
    patch_scene: PatchScene
    rays: RayScene
    emission: np.ndarray
    sky: np.ndarray
    sampled_light: np.ndarray
    areas: Areas
    settings: Settings
    remote: RemoteDevices | None = None
    kept: SessionCache = field(default_factory=SessionCache)
    indirect: Values | None = None
    direct: Values | None = None
    validity: np.ndarray | None = None
    part_of: SolveJob | None = None
    contacts: Contacts | None = None
    backs: np.ndarray | None = None
    mapped: int | None = None

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.patch_scene.patches)

    @property
    def area(self) -> np.ndarray:
        """Area of each patch, (n,) float32, m^2; waits for its computation."""
        return areas_of(self.areas)

    @property
    def fronts(self) -> int:
        """Number of patches on front faces, which come first; back faces use the last atlases."""
        triangles = self.patch_scene.triangles
        if triangles.backs is None:
            return self.count
        return int(np.count_nonzero(self.patch_scene.geometry.triangle < triangles.solid)) or self.count

    @property
    def surfaces(self) -> SolvedSurfaces:
        """Surfaces of the patches."""
        reflectance, sides = self.patch_scene.surfaces.reflectance, self.patch_scene.sides
        return SolvedSurfaces(reflectance, self.areas, sides, self.fronts)

    @property
    def start(self) -> StartLight:
        """Light before the first iteration."""
        return StartLight(self.sampled_light, self.gathers_direct, self.indirect, self.direct)

    @property
    def opencl(self) -> ComputeDevice:
        """The OpenCL device; raises DeviceError if there is none."""
        if self.compute is None:
            raise DeviceError(
                "This bake needs an OpenCL device, and there is none. Install a driver with OpenCL."
            )
        return self.compute

    @cached_property
    def background(self) -> Background:
        """Background on the OpenCL device: sky and emission of back faces."""

        def whole(sky: np.ndarray) -> np.ndarray | None:
            return self.kept.unoccluded_sky.get((sky,), lambda: open_sky(sky))

        return upload_background(self.opencl, self.back_emission, self.sky, whole)

    @cached_property
    def front_emission(self) -> cl.Buffer:
        """Radiance of the front face of patch i at entry i + 1, float4 buffer; entry 0 is black."""
        if self.backs is None:
            return self.background.emission
        return upload_float4_once(self.opencl, self.emission, first=1)

    @property
    def back_emission(self) -> np.ndarray:
        """Radiance of the back face of each patch, (n, 3) float32."""
        return self.emission if self.backs is None else self.backs

    @cached_property
    def checkpoint(self) -> Checkpoint:
        """Files of visibility samples and light of these patches."""
        # Checkpoints refer to each other. The key refers neither to the job nor to the session cache, since
        # their OpenGL objects would live on in a cycle.
        patch_scene, back_emission = self.patch_scene, self.back_emission
        devices = [self.graphics.name]
        if self.compute is not None:
            devices.append(device_digest(self.compute.device))
        key = partial(_visibility_key, patch_scene, back_emission, devices, self.kept.key, self.settings)
        return self.kept.checkpoints.of(key)

    def on(self, peer: ComputeDevice) -> SolveJob:
        """Return a copy for another device, which computes a part of the patches."""
        return replace(self, compute=peer, rays=self.rays.on(peer))

    def after(self, last: PreviousSolution | None) -> SolveJob:
        """Return a copy that starts from the light of an earlier bake, if there is any."""
        if last is None:
            return self
        sources = self.direct_sources
        return replace(
            self, indirect=last.indirect, direct=last.direct_of(sources), validity=last.validity_of(sources)
        )

    @property
    def direct_sources(self) -> DirectSources | None:
        """Everything that determines the light before any reflection; None unless visibility is cached."""
        samples = self.kept.samples
        if samples is None or not samples.complete:
            return None
        light = self.emission, self.back_emission, self.sky, self.sampled_light
        return DirectSources(weakref.ref(samples), self.patch_scene.triangles, *light)

    @cached_property
    def first_radiance(self) -> np.ndarray:
        """Exitant radiance of each patch before any bounce, (n,) float32, sum of the channels.

        Computed column by column, which saves memory for an (n, 3) temporary.
        """
        light, reflectance = self.sampled_light, colors_on_host(self.patch_scene.surfaces.reflectance)
        radiance: np.ndarray = channel_sum(self.patch_scene.surfaces.emission)

        def add_reflected(rows: slice) -> None:
            column = np.empty_like(radiance[rows])
            for channel in range(3):
                radiance[rows] += np.multiply(reflectance[rows, channel], light[rows, channel], out=column)

        map_slabs(len(radiance), 28, add_reflected)
        return radiance

    @property
    def light_key(self) -> tuple:
        """Everything that determines the light of the patches, given their visibility and gather."""
        settings = self.settings
        reflectance = colors_on_host(self.patch_scene.surfaces.reflectance)
        own = self.patch_scene.surfaces.own
        arrays = (self.emission, self.back_emission, self.sky, self.sampled_light, reflectance, self.area)
        return (*arrays, own, settings.accelerate, settings.tolerance, self.columns, self.remote is not None)

    @property
    def columns(self) -> int:
        """Number of iterates that the solver stores; accelerated iterations need more."""
        return COLUMNS if self.settings.accelerated else PLAIN_COLUMNS

    @cached_property
    def gathers_direct(self) -> bool:
        """True if patches gather light before any reflection."""
        all_light = self.part_of or self
        return all_light._is_seen

    @property
    def dark(self) -> bool:
        """True if no light reaches any patch and only light is an output."""
        return not self.lit and self.settings.only_light

    @property
    def lit(self) -> bool:
        """True if light reaches any patch."""
        return self._is_seen or has_rows(self.sampled_light)

    @cached_property
    def _is_seen(self) -> bool:
        """True if patches, or the unsampled part of the sky, emit light."""
        return any(has_rows(light) for light in (self.sky, self.emission, self.back_emission))


def _visibility_key(
    patch_scene: PatchScene,
    back_emission: np.ndarray,
    devices: list[str],
    cache_key: tuple | None,
    settings: Settings,
) -> str:
    """Return a digest of everything that determines the visibility between the patches.

    back_emission:  (n, 3) float32, radiance of back faces, W/(m^2 sr)
    devices:        names and digests of the devices
    cache_key:      `SessionCache.key`
    """
    where = (patch_scene.patches.texel, patch_scene.patches.atlas, patch_scene.texel_to_patch)
    points = (patch_scene.geometry.triangle, patch_scene.geometry.barycentric, back_emission)
    made_by = (source_digest(), *devices, cache_key, visibility_settings(settings))
    return digest_of((*where, *points, *made_by))
