"""Shadow rays: sampled direct light from lights, small bright surfaces and bright sky."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from copy import copy
from functools import partial
from typing import Protocol

import numpy as np

from ..device.buffers import (
    download,
    download_colors,
    download_colors_once,
    lasting_buffer,
    upload,
    upload_float4_once,
    upload_once,
    write,
    zeros,
)
from ..device.cl_device import ComputeDevice
from ..device.device_rows import device_rows
from ..device.kernel import Kernel
from ..device.opencl import cl
from ..device.peer_threads import run_in_parallel
from ..device.planned_program import Source
from ..device.row_range import RowRange
from ..device.time_slicer import sliced_rows
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.light_groups import LightGroups
from ..scene.memo import Memo
from ..scene.model import Light
from ..settings import Settings
from ..visibility.rays.ray_scene import RayScene
from ..visibility.sampler import directional_options
from .emitter_lists import EmitterLists, joined_emitters, visible_fraction
from .emitters import EMITTER, EMITTER_RECORDS, SampledTriangles
from .light_tree import LIGHT_NODE, LIGHT_TREE_RECORDS, LightTree, build_light_tree
from .sky import Sky, SkyDistribution


class ShadowCaster(Protocol):
    """Caster of shadow rays from n patches: `ShadowRays`, or devices of other processes."""

    def sampled(self) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return E/pi of all emitters at every patch, (n, 3) float32, and its L1, (n, 3, 3) float32."""
        ...

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return the visible fraction of a light for each patch, (n,) float32."""
        ...

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the unoccluded fraction of each patch's hemisphere, (n,) float32."""
        ...


#: Minimum number of shadow rays that several devices share; with fewer, one device is done before another one
#: is ready (measured on two H200).
_FEWEST_SHARED = 1 << 29

#: Function that returns the kernel of a caster and the kernel's arguments between receivers and result.
_Work = Callable[["ShadowRays"], "tuple[Kernel, tuple]"]


class ShadowRays:
    """Shadow rays from the patches of `receivers` to all sampled lights.

    patch_scene:  the emitting scene
    lamps:        the lights that emit
    bright:       sampled emissive triangles
    sky:          the sky, whose bright part is sampled
    """

    def __init__(
        self,
        receivers: RayScene,
        patch_scene: PatchScene,
        lamps: Sequence[Light],
        bright: SampledTriangles,
        sky: Sky,
        settings: Settings,
    ) -> None:
        compute = receivers.compute
        self._lights = patch_scene, lamps, bright, sky
        self._triangles, self._trees = len(patch_scene.triangles.mesh).bit_length(), Memo[LightTree]()
        self._set_receivers(receivers, settings)

        self._emitters = EmitterLists(lamps, patch_scene.triangles, bright, sky)
        tables = self._emitters.modulations, self._emitters.profiles
        self._modulations = tuple(upload(compute, array) for array in tables)
        self._glow = glow_arguments(compute, patch_scene, bright)
        self._sky = sky_arguments(compute, sky.distribution)

        # Record all inputs of the light, for comparison by the next bake; surfaces include their emission
        # textures.
        surfaces = patch_scene.surfaces
        shine = (
            surfaces.emission,
            surfaces.back_emission,
            patch_scene.texel_to_patch,
            patch_scene.triangles.uvs,
        )
        self.lights = (
            *self._emitters.lists, *tables, sky.bright, *(shine if len(bright.triangles) else ()),
            settings.light_samples, settings.seed, directional_options(settings),
        )  # fmt: skip

    def _set_receivers(self, receivers: RayScene, settings: Settings) -> None:
        """Set the points from which rays are cast, and the settings."""
        self._compute, self._rays, self._scene = receivers.compute, receivers.rays, receivers
        self._settings, self._count = settings, receivers.count
        source: Source = (*LIGHT_TREE_RECORDS, "direct.cl")
        options = directional_options(settings)
        (self._direct,) = self._rays.kernels(source, "sample_direct_light", options=options)
        self._receivers = receivers.receivers
        self._l1 = zeros(self._compute, 48 * self._count) if settings.directional else None

    def of(self, receivers: RayScene, settings: Settings) -> ShadowRays:
        """Return shadow rays from other points of the same device; both share emitters and their buffers."""
        other = copy(self)
        other._set_receivers(receivers, settings)
        return other

    @property
    def compute(self) -> ComputeDevice:
        """The OpenCL device that casts the rays."""
        return self._compute

    @property
    def emitters(self) -> np.ndarray:
        """Records of all sampled emitters, (m,) EMITTER."""
        return EMITTER.joined(self._emitters.lists)

    def sampled(
        self, chosen: np.ndarray | None = None
    ) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return E/pi of all emitters at every patch, (n, 3) float32, and its L1; yield progress 0..1.

        L1 (irradiance_l1.cl) is (n, 3, 3) float32: patch, world axis, rgb; (0, 3, 3) without directional
        maps.

        chosen: (n,) int32, indices of patches; None for all receivers
        """
        items = self._count if chosen is None else len(chosen)
        if not items:
            return np.zeros((0, 3), np.float32), self._read_l1(0)
        light = yield from self._all_light(self._emitters.lists, chosen)
        return download_colors_once(self._compute, light, items), self._read_l1(items)

    def sampled_by_group(self, groups: LightGroups) -> Generator[float, None, np.ndarray]:
        """Return E/pi of each light group, (groups, n, 3) float32; yield progress 0..1.

        Each group has as many samples as a bake of the group alone, so the sum of the groups differs from
        `sampled` by noise.
        """
        light = np.zeros((groups.count, self._count, 3), np.float32)
        for group, lists in enumerate(self._emitters.by_group(groups) if self._count else ()):
            span = group / groups.count, (group + 1) / groups.count
            found = yield from run_as_fraction(*span, self._all_light(lists))
            light[group] = download_colors_once(self._compute, found, self._count)
        return light

    def _all_light(
        self, lists: list[np.ndarray], chosen: np.ndarray | None = None
    ) -> Generator[float, None, cl.Buffer]:
        """Return direct light of each patch, (n,) float4: E/pi in rgb, its luminance without shadows in a."""
        joined = joined_emitters(lists, self._settings.light_samples)
        if joined is None:
            return zeros(self._compute, 16 * self._count)
        return (yield from self._light(*joined, chosen))

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return the visible fraction of a light for each patch, (n,) float32; yield progress 0..1.

        1 is unshadowed; 0 is full shadow, or no irradiance from the light.
        """
        result = yield from self._light(self._emitters.lists[lamp], self._settings.light_samples)
        return visible_fraction(download(self._compute, result, (self._count, 4)))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the unoccluded fraction of each patch's hemisphere, (n,) float32; yield progress 0..1.

        The fraction is cosine-weighted; only surfaces within `Settings.ao_distance` occlude.
        """
        reach = np.float32(self._settings.ao_distance or np.inf)
        arguments = (np.int32(self._settings.ao_samples), reach, np.uint32(self._settings.seed))

        def occlusion(caster: ShadowRays) -> tuple[Kernel, tuple]:
            (kernel,) = caster._rays.kernels((*EMITTER_RECORDS, "ambient_occlusion.cl"), "ambient_occlusion")
            return kernel, arguments

        result = yield from self._cast(occlusion, self._settings.ao_samples, self._count)
        return download(self._compute, result, (self._count, 4))[:, 0].copy()

    def _light(
        self, emitters: np.ndarray, budget: int, chosen: np.ndarray | None = None
    ) -> Generator[float, None, cl.Buffer]:
        """Return E/pi and its unshadowed luminance from some emitters, float4 of n patches.

        chosen: as in `sampled`
        """
        items = self._count if chosen is None else len(chosen)
        tree = self._trees.get((emitters,), lambda: build_light_tree(emitters))
        nodes = tree.nodes if len(tree.nodes) else LIGHT_NODE.array(1)

        def direct(caster: ShadowRays) -> tuple[Kernel, tuple]:
            compute = caster._compute
            arguments = (
                upload(compute, emitters), upload(compute, nodes), np.int32(tree.root),
                *caster._modulations, np.int32(budget),
                *caster._glow, *caster._sky, np.uint32(self._settings.seed), caster._l1,
                None if chosen is None else upload(compute, chosen),
            )  # fmt: skip
            return caster._direct, arguments

        return (yield from self._cast(direct, budget, items))

    def _read_l1(self, items: int) -> np.ndarray:
        """Return L1 of the light sampled last, (items, 3, 3) float32. (0, 3, 3) without directional maps."""
        if self._l1 is None or not items:
            return np.zeros((0, 3, 3), np.float32)
        return download_colors(self._compute, self._l1, items, 3).transpose(1, 0, 2)

    def _cast(self, work: _Work, samples: int, items: int) -> Generator[float, None, cl.Buffer]:
        """Run a kernel over items on all devices that share the patches; yield progress 0..1.

        Returns its results, float4 of each item.
        """
        shares = items * samples >= _FEWEST_SHARED and not self._settings.directional
        peers = self._scene.peers if shares else ()
        rows, result = RowRange(0, items, 1 + len(peers)), self._result(items)
        found: list[tuple[int, np.ndarray]] = []

        def cast_on(peer: ComputeDevice) -> None:
            caster = self._on(peer)
            there = caster._result(items)
            for first, end in caster._slices(work, samples, rows, there, from_end=True):
                found.append((first, download(peer, there, (end - first, 4), 16 * first)))

        own = rows.progress(self._slices(work, samples, rows, result))
        yield from run_in_parallel(own, [(peer.thread, partial(cast_on, peer)) for peer in peers], rows.stop)
        for first, light in found:
            write(self._compute, result, light, 16 * first)
        return result

    def _on(self, peer: ComputeDevice) -> ShadowRays:
        """Return the caster of the same rays on another device."""
        return ShadowRays(self._scene.on(peer), *self._lights, self._settings)

    def _result(self, items: int) -> cl.Buffer:
        """Return a buffer for the results of items, float4 each."""
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 16 * items)

    def _slices(
        self, work: _Work, samples: int, rows: RowRange, result: cl.Buffer, from_end: bool = False
    ) -> Generator[tuple[int, int], None, None]:
        """Run a kernel over slices of rows on this device; yield each slice."""
        kernel, arguments = work(self)

        def launch(start: int, end: int) -> None:
            slice_ = np.int32(start), np.int32(end)
            self._rays.run(kernel, end - start, self._receivers, *arguments, result, *slice_)

        size = self._compute.slice_size(kernel, samples, self._triangles)
        yield from sliced_rows(self._compute.queue, rows, launch, size, from_end)


def glow_arguments(compute: ComputeDevice, patch_scene: PatchScene, bright: SampledTriangles) -> tuple:
    """Return kernel arguments of surfaces: radiance of both sides, texel map, UVs and resolution.

    Without sampled triangles the radiance is a dummy, since kernels do not read it.
    """
    surfaces = patch_scene.surfaces
    if len(bright.triangles):
        front = upload_float4_once(compute, surfaces.emission, first=1)
        back = upload_float4_once(compute, surfaces.emission_of_backs, first=1)
    else:
        front = back = zeros(compute, 16)
    uvs = lasting_buffer(compute, patch_scene.triangles.uvs)
    lookups = device_rows(compute, patch_scene.entries), uvs
    return (front, back, *lookups, np.int32(patch_scene.patches.resolution))


def sky_arguments(compute: ComputeDevice, sky: SkyDistribution) -> tuple:
    """Return kernel arguments of the bright sky: pixels, distribution, indices, size, total."""
    (height, width), arrays = sky.size, (sky.pixels, sky.cumulative, sky.listed)
    buffers = (upload_once(compute, array) for array in arrays)
    return (*buffers, *map(np.int32, (width, height, len(sky.listed))), np.float32(sky.total))
