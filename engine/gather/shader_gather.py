"""Gather by OpenGL compute shaders, which trace and cache visibility samples; for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import TypeVar

import moderngl
import numpy as np

from ..array_ops import to_float4
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..settings import Settings
from ..visibility.rays.receiver_records import RECEIVER
from ..visibility.rays.shaders.shader_scene import ShaderScene
from ..visibility.rays.shaders.shader_tables import (
    ShaderTables,
    largest_block,
    reserve_storage,
    storage_buffer,
)
from ..visibility.rays.shaders.shader_tracer import RECORDS, RESULTS, read_rows
from ..visibility.sample_counts import ray_count
from ..visibility.sampler import directional_options
from ..visibility.unoccluded_sky import open_sky
from ..visibility.views.directions import r2_sequence
from ..visibility.views.hemicube import rotation_salt

#: Type of the result of a work generator.
Result = TypeVar("Result")

#: Memory limit of cached samples, bytes; OpenGL has no query for the memory size.
_MAX_KEPT = 1 << 30

#: Maximum number of samples per patch. Shaders sum them in one invocation, and Mesa's llvmpipe limits its
#: loops to 65,535 steps.
_MAX_SAMPLES = 1 << 14

#: Storage blocks of shaders/gather/background_rays.comp and gather_rays.comp.
_TABLES, _ROWS, _RADIANCE = 4, 5, 6

#: Share of tracing in the time of an iteration that traces samples (chosen).
_TRACING = 0.9


class ShaderGather:
    """Gather with samples traced by compute shaders; samples beyond 1 GiB are traced in every iteration.

    samples:    number per patch
    keeps_all:  True if all samples are traced once
    """

    def __init__(
        self,
        receivers: ShaderScene,
        sources: PatchScene,
        back_emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Create the tables and buffers of the shaders.

        receivers:      receiving patches
        sources:        m patches whose light is gathered
        back_emission:  (m, 3) float32, radiance of back faces of the sources, W/(m^2 sr)
        sky:            (h, w, 3) float32, radiance, equirectangular as `Scene.world`
        """
        self._scene, self._tracer, self._graphics = receivers, receivers.tracer, receivers.graphics
        self.samples = min(ray_count(settings), _MAX_SAMPLES)
        self._features = tuple(option.removeprefix("-D").lower() for option in directional_options(settings))
        table = open_sky(sky)
        self._tables = ShaderTables(self._graphics, _arrays(self.samples, sources, sky, table))
        triangles = sources.triangles
        self._uniforms = self._tables.uniforms | {
            "samples": self.samples,
            "rotate": int(settings.rotate),
            "salt": int(rotation_salt(settings.seed)),
            "outside": len(back_emission) + 1,
            "resolution": sources.patches.resolution,
            "has_backs": int(triangles.backs is not None),
            "sky_width": sky.shape[1],
            "sky_height": sky.shape[0],
            "has_open_sky": int(table is not None),
        }
        self._back_emission = storage_buffer(self._graphics, to_float4(back_emission, first=1))
        self._radiance = reserve_storage(self._graphics, 16 * (len(back_emission) + 1))
        rows = 4 * self.samples
        self._step = max(1, min(largest_block(self._graphics), _MAX_KEPT) // rows)
        self.keeps_all = receivers.count * rows <= _MAX_KEPT
        self._kept: dict[int, moderngl.Buffer] = {}
        self._background = np.zeros((receivers.count, 4), np.float32)
        self._background_l1 = np.zeros((3 * receivers.count if self._features else 0, 4), np.float32)
        self._has_background = False

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance, (m, 3) float32; return E/pi and validity, (n, 4) float32.

        The first call traces the samples. Yields progress 0..1.
        """
        self._radiance.write(to_float4(radiance, first=1))
        gathered = np.zeros((self._scene.count, 4), np.float32)
        for first, last in self._chunks():
            rows = yield from self._within(0.0, _TRACING, first, last, self._rows(first, last))
            gathered[first:last, :3] = yield from self._within(
                _TRACING, 1.0, first, last, self._gathered(first, last, rows, ())
            )
        self._has_background = True
        return gathered + self._background

    def gather_l1(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return irradiance gradients (L1), (n, 3, 3) float32: patch, world axis, rgb."""
        self._radiance.write(to_float4(radiance, first=1))
        l1 = self._background_l1[:, :3].copy()
        for first, last in self._chunks():
            rows = yield from self._within(0.0, _TRACING, first, last, self._rows(first, last))
            l1[3 * first : 3 * last] += yield from self._within(
                _TRACING, 1.0, first, last, self._gathered(first, last, rows, self._features)
            )
        return l1.reshape(-1, 3, 3)

    def _chunks(self) -> Iterator[tuple[int, int]]:
        """Yield the spans of patches whose samples fit in one buffer."""
        for first in range(0, self._scene.count, self._step):
            yield first, min(first + self._step, self._scene.count)

    def _within(
        self, begin: float, end: float, first: int, last: int, work: Generator[float, None, Result]
    ) -> Generator[float, None, Result]:
        """Run work on a span of patches; yield its progress as part of all patches, 0..1."""
        size = (last - first) / self._scene.count
        start = first / self._scene.count
        return (yield from run_as_fraction(start + begin * size, start + end * size, work))

    def _rows(self, first: int, last: int) -> Generator[float, None, moderngl.Buffer]:
        """Return the samples of a span of patches, from the cache or traced; sum background light once."""
        if first in self._kept:
            return self._kept[first]
        count = last - first
        size = 4 * self.samples * (count if self.keeps_all else self._step)
        rows = self._kept.get(-1) or reserve_storage(self._graphics, size)
        buffers = {RECORDS: self._scene.receivers, _TABLES: self._tables.buffer, RESULTS: rows}
        uniforms = self._uniforms | {"first_patch": first}
        items = count * self.samples
        tracing = self._tracer.run("trace_visibility", items, buffers, uniforms, records=(RECEIVER,))
        yield from run_as_fraction(0.0, _TRACING, tracing)
        self._kept[first if self.keeps_all else -1] = rows
        if not self._has_background:
            yield from run_as_fraction(_TRACING, 1.0, self._find_background(first, last, rows))
        return rows

    def _find_background(self, first: int, last: int, rows: moderngl.Buffer) -> Generator[float, None, None]:
        """Sum the background light of patches and its L1."""
        count = last - first
        size = (4 if self._features else 1) * count
        results = reserve_storage(self._graphics, 16 * size)
        buffers = self._buffers(rows, self._back_emission, results)
        uniforms = self._uniforms | {"first_patch": first, "first_l1": count}
        yield from self._tracer.run("background_rays", count, buffers, uniforms, self._features, (RECEIVER,))
        self._background[first:last] = read_rows(results, count)
        if self._features:
            self._background_l1[3 * first : 3 * last] = read_rows(results, 3 * count, count)

    def _gathered(
        self, first: int, last: int, rows: moderngl.Buffer, features: Sequence[str]
    ) -> Generator[float, None, np.ndarray]:
        """Return E/pi from front faces of sources, (k, 3) float32; with features its L1, (3 k, 3)."""
        count = last - first
        size = (3 if features else 1) * count
        results = reserve_storage(self._graphics, 16 * size)
        buffers = self._buffers(rows, self._radiance, results)
        uniforms = self._uniforms | {"first_patch": first}
        yield from self._tracer.run("gather_rays", count, buffers, uniforms, features, (RECEIVER,))
        return read_rows(results, size)[:, :3]

    def _buffers(
        self, rows: moderngl.Buffer, radiance: moderngl.Buffer, results: moderngl.Buffer
    ) -> dict[int, moderngl.Buffer]:
        """Return the storage blocks of a shader that sums light."""
        return {
            RECORDS: self._scene.receivers,
            _TABLES: self._tables.buffer,
            _ROWS: rows,
            _RADIANCE: radiance,
            RESULTS: results,
        }


def _arrays(
    samples: int, sources: PatchScene, sky: np.ndarray, table: np.ndarray | None
) -> dict[str, np.ndarray]:
    """Return the tables that the shaders read: sample pattern, UVs, index map and sky."""
    triangles = sources.triangles
    return {
        "pattern": r2_sequence(samples),
        "uvs": triangles.uvs.astype(np.float32, copy=False),
        "atlases": triangles.atlas.astype(np.int32, copy=False),
        "texel_to_patch": sources.texel_to_patch.astype(np.uint32, copy=False),
        "sky": to_float4(sky.reshape(-1, 3)),
        "open_sky": np.zeros((1, 4), np.float32) if table is None else to_float4(table),
        **({} if triangles.backs is None else {"backs": triangles.backs.astype(np.int32, copy=False)}),
    }
