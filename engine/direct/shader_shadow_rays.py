"""Shadow rays by OpenGL compute shaders: sampled direct light for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from ..array_ops import to_float4
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.light_groups import LightGroups
from ..scene.model import Light
from ..settings import Settings
from ..visibility.rays.receiver_records import RECEIVER
from ..visibility.rays.shaders.shader_scene import ShaderScene
from ..visibility.rays.shaders.shader_tables import ShaderTables, reserve_storage, storage_buffer
from ..visibility.rays.shaders.shader_tracer import RECORDS, RESULTS, read_rows
from ..visibility.sampler import directional_options
from .emitter_lists import EmitterLists, joined_emitters, visible_fraction
from .emitters import EMITTER, SampledTriangles
from .light_tree import LIGHT_NODE, build_light_tree
from .modulation import is_modulated
from .sky import Sky

#: Storage blocks of shaders/direct/.
_EMITTERS, _NODES, _TABLES = 4, 5, 6

#: Structs that shaders/direct/direct.comp reads.
_RECORDS = (RECEIVER, EMITTER, LIGHT_NODE)

#: 32-bit words of state that a work item stores between dispatches: STATE_WORDS of shaders/direct/direct.comp
#: and ambient_occlusion.comp.
_DIRECT_STATE, _OCCLUSION_STATE = 208, 4

#: Light of some patches and its L1, (n, 4) and (3 n, 4) float32; see shaders/direct/direct.comp.
_Rows = tuple[np.ndarray, np.ndarray]


class ShaderShadowRays:
    """Shadow rays by OpenGL compute shaders: the same samples as `ShadowRays`, equal except for rounding."""

    def __init__(
        self,
        receivers: ShaderScene,
        patch_scene: PatchScene,
        lamps: Sequence[Light],
        bright: SampledTriangles,
        sky: Sky,
        settings: Settings,
    ) -> None:
        self._scene, self._tracer, self._settings = receivers, receivers.tracer, settings
        self._count = receivers.count
        self._features = tuple(option.removeprefix("-D").lower() for option in directional_options(settings))
        self._rows = 4 if settings.directional else 1
        if any(is_modulated(lamp) for lamp in lamps):
            self._features += ("modulated",)
        self._emitters = EmitterLists(lamps, patch_scene.triangles, bright, sky)
        height, width = sky.distribution.size
        self._uniforms = {
            "resolution": patch_scene.patches.resolution,
            "sky_width": width,
            "sky_height": height,
            "sky_count": len(sky.distribution.listed),
            "sky_total": sky.distribution.total,
            "seed": settings.seed & 0xFFFFFFFF,
        }
        self._tables = ShaderTables(
            receivers.graphics,
            {
                "modulations": self._emitters.modulations,
                "profiles": self._emitters.profiles,
                "sky_pixels": sky.distribution.pixels,
                "cumulative": sky.distribution.cumulative,
                "listed": sky.distribution.listed,
                **(_glow_arrays(patch_scene) if len(bright.triangles) else {}),
            },
        )

    @property
    def program_digest(self) -> str:
        """Digest of the source of the shader for sampled light."""
        return self._tracer.digest("direct", self._features, _RECORDS)

    def build(self) -> None:
        """Build the shader for sampled light, which takes a CPU's driver seconds."""
        self._tracer.build("direct", self._features, _RECORDS)

    def sampled(self) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return E/pi of all emitters at every patch, (n, 3) float32, and its L1; yield progress 0..1."""
        light, l1 = yield from self._all_light(self._emitters.lists)
        return light[:, :3].copy(), l1[:, :3].reshape(-1, 3, 3)

    def sampled_by_group(self, groups: LightGroups) -> Generator[float, None, np.ndarray]:
        """Return E/pi of each light group, (groups, n, 3) float32; yield progress 0..1."""
        light = np.zeros((groups.count, self._count, 3), np.float32)
        for group, lists in enumerate(self._emitters.by_group(groups) if self._count else ()):
            span = group / groups.count, (group + 1) / groups.count
            found, _ = yield from run_as_fraction(*span, self._all_light(lists))
            light[group] = found[:, :3]
        return light

    def shadow_mask(self, lamp: int) -> Generator[float, None, np.ndarray]:
        """Return the visible fraction of a light for each patch, (n,) float32; yield progress 0..1."""
        light, _ = yield from self._light(self._emitters.lists[lamp], self._settings.light_samples)
        return visible_fraction(light)

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the unoccluded fraction of each patch's hemisphere, (n,) float32; yield progress 0..1."""
        settings, results = self._settings, reserve_storage(self._scene.graphics, 16 * self._count)
        reach = settings.ao_distance or np.inf
        uniforms = {"budget": settings.ao_samples, "reach": reach, "seed": settings.seed & 0xFFFFFFFF}
        buffers = {RECORDS: self._scene.receivers, RESULTS: results}
        yield from self._tracer.run(
            "ambient_occlusion",
            self._count,
            buffers,
            uniforms,
            records=(RECEIVER,),
            state_words=_OCCLUSION_STATE,
        )
        return read_rows(results, self._count)[:, 0].copy()

    def _all_light(self, lists: list[np.ndarray]) -> Generator[float, None, _Rows]:
        """Return E/pi and unshadowed luminance of all emitters in the lists, (n, 4) float32, and the L1."""
        joined = joined_emitters(lists, self._settings.light_samples)
        if joined is None:
            rows = (self._rows - 1) * self._count
            return np.zeros((self._count, 4), np.float32), np.zeros((rows, 4), np.float32)
        return (yield from self._light(*joined))

    def _light(self, emitters: np.ndarray, budget: int) -> Generator[float, None, _Rows]:
        """Return E/pi and its unshadowed luminance from some emitters at all patches, and the L1."""
        graphics, tree = self._scene.graphics, build_light_tree(emitters)
        rows = self._rows * self._count
        results = reserve_storage(graphics, 16 * rows)
        buffers = {
            RECORDS: self._scene.receivers,
            _EMITTERS: storage_buffer(graphics, emitters),
            _NODES: storage_buffer(graphics, tree.nodes if len(tree.nodes) else LIGHT_NODE.array(1)),
            _TABLES: self._tables.buffer,
            RESULTS: results,
        }
        launch = {"root": tree.root, "budget": budget, "first_l1": self._count}
        uniforms = self._uniforms | self._tables.uniforms | launch
        yield from self._tracer.run(
            "direct", self._count, buffers, uniforms, self._features, _RECORDS, _DIRECT_STATE
        )
        return read_rows(results, self._count), read_rows(results, rows - self._count, self._count)


def _glow_arrays(patch_scene: PatchScene) -> dict[str, np.ndarray]:
    """Return the look-up tables of emissive surfaces: radiance of both sides, index map and UVs."""
    surfaces = patch_scene.surfaces
    return {
        "radiance": to_float4(surfaces.emission, first=1),
        "back_radiance": to_float4(surfaces.emission_of_backs, first=1),
        "texel_to_patch": patch_scene.texel_to_patch.astype(np.uint32, copy=False),
        "uvs": patch_scene.triangles.uvs.astype(np.float32, copy=False),
    }
