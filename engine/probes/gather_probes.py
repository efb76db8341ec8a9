"""Light of probe volumes from the solved patches: visibility, direct light, validity and repair."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..bake_result import ProbeGrid
from ..device.device_array import Values
from ..direct.contact import Contacts
from ..plan.solve_job import SolveJob
from ..progress import run_as_fraction
from ..scene.digests import digest_of
from ..scene.light_groups import LightGroups, light_groups
from ..scene.probe_volume import ProbeVolume
from ..settings import Settings
from ..solve.solution import Solution
from ..texel_gather.texel_sample_points import TexelGatherJob
from ..texel_gather.valid_patches import invalid_patches, radiance_of, substitutes_of
from ..validity.lit_backs import mean_luminance
from ..validity.probe_repair import filled, moved_out
from ..validity.thresholds import DARK_BACK, MAX_BACKS_PROBE
from ..visibility.views.viewpoints import OF_COORDINATE
from .light_parts import emitters_of, light_parts
from .probe_blocks import ProbeBlocks, ProbePart
from .probe_lights import ProbeLights
from .probe_rows import COEFFICIENTS, VALUES, ProbeRadiance, ProbeRows
from .sent_light import SentRadiance
from .sphere_directions import direction_count

#: Maximum number of probes whose samples are in memory at once, and maximum size of these samples, bytes.
_BATCH, _BATCH_BYTES = 1 << 16, 1 << 28

#: Maximum size of a sample, bytes: the patch ID, its tint, and the distance.
_SAMPLE_BYTES = 9

#: Maximum size of the samples that a session keeps for the next bake, bytes.
_KEPT = 1 << 28

#: Distance by which rays start behind a probe, as a fraction of the smallest cell width (chosen); at least
#: the resolution of float32.
_MARGIN = 1e-4

#: Shares of tracing, projection and repair in the time of a batch; the rest is direct light (measured).
_TRACING, _PROJECTING, _MOVING = 0.6, 0.7, 0.75

#: Share of the gather in the time of a volume; the rest fills invalid probes (chosen).
_GATHERING = 0.95

#: Maximum number of probes of a volume with maps of distances; its file has 316 MB (chosen).
MAX_DISTANCE_PROBES = 1 << 18

#: Luminance below which a back face is dark in a scene without light.
_BLACK = 1e-30


def gather_probes(
    texel_job: TexelGatherJob,
    solution: Solution,
    validity: np.ndarray,
    contacts: Contacts,
    groups: Mapping[str, Values],
) -> Generator[float, None, tuple[ProbeGrid, ...]]:
    """Return the light of all probe volumes of a scene; yield the fraction done.

    texel_job:  patches and direct light
    solution:   solution of all light
    validity:   (n,) float32, validity of the patches, see `patch_validity`
    contacts:   contacts of the patches
    groups:     (n, 3) float32, E/pi of the patches, by light group in order; empty without light groups
    """
    # Patches emit their final light, also where groups of them were solved.
    texel_job, volumes = replace(texel_job, solved=texel_job.job), texel_job.scene.probe_volumes
    total = sum(volume.count for volume in volumes)
    substitute = None
    if texel_job.choice.method != "none":
        invalid = invalid_patches(texel_job, validity, contacts)
        substitute = substitutes_of(texel_job, invalid, solution.light, solution.substitute)
    lights = [_radiance(texel_job.job, solution.light, substitute)]
    for number, light in enumerate(groups.values()):
        emission, sky, backs = texel_job.lighting.left_to_hemicubes(number)
        job = replace(texel_job.job, emission=emission, sky=sky, backs=backs, part_of=texel_job.job)
        lights.append(_radiance(job, light, substitute))
    part = _gather_of_volumes(texel_job, lights, bool(groups))
    made, before, origin = list[ProbeGrid](), 0, texel_job.job.patch_scene.triangles.origin
    for number, volume in enumerate(volumes):
        done = before / total, (before + volume.count) / total
        made.append((yield from run_as_fraction(*done, _grid(volume, part(number), tuple(groups), origin))))
        before += volume.count
    return tuple(made)


def _gather_of_volumes(
    texel_job: TexelGatherJob, lights: Sequence[ProbeRadiance], groups: bool
) -> Callable[[int], Generator[float, None, ProbePart]]:
    """Return a function that gathers a volume, by its number: here, or on devices of other processes.

    lights:  radiance of all light, then of each light group
    groups:  True if there are light groups
    """
    volumes, remote, compute = texel_job.scene.probe_volumes, texel_job.job.remote, texel_job.job.opencl
    by_group = light_groups(texel_job.scene) if groups else None
    blocks = ProbeBlocks(texel_job.job.checkpoint, lambda: _light_key(texel_job, lights, by_group))
    if remote is None:
        gather = ProbeGather(texel_job, lights, by_group)
        return lambda number: gather.part(number, 0, volumes[number].count, blocks)
    # Bakes by other processes have no light groups.
    sent = SentRadiance.of(compute, lights[0])

    def elsewhere(number: int) -> Generator[float, None, ProbePart]:
        find, add = partial(blocks.find, number), partial(blocks.add, number)
        gathering = remote.probes(sent, number, volumes[number].count, texel_job.choice, find, add)
        return joined((yield from gathering))

    return elsewhere


def _light_key(texel_job: TexelGatherJob, lights: Sequence[ProbeRadiance], groups: LightGroups | None) -> str:
    """Return a digest of everything besides the geometry that determines the light of probes.

    lights:  radiance of all light, then of each light group
    """
    patch_scene, settings = texel_job.job.patch_scene, texel_job.job.settings
    emitters = emitters_of(patch_scene, texel_job.lighting)
    of_lights = light_parts(emitters, patch_scene, texel_job.lighting, settings, groups)
    direct = [value for of_light in of_lights for part in of_light for value in part.key]
    received = [value for light in lights for value in SentRadiance.of(texel_job.job.opencl, light).key]
    volumes = [
        value for volume in texel_job.scene.probe_volumes for value in (volume.matrix, volume.resolution)
    ]
    how = settings.probe_samples, settings.probe_distances, settings.seed, texel_job.job.remote is None
    return digest_of((*direct, *received, *volumes, *how))


def joined(parts: Sequence[ProbePart]) -> ProbePart:
    """Return the values of consecutive parts of a volume as one part."""
    if len(parts) == 1:
        return parts[0]
    coefficients, validity, positions, distances = (
        np.concatenate(arrays) for arrays in zip(*parts, strict=True)
    )
    return coefficients, validity, positions, distances


def _grid(
    volume: ProbeVolume,
    gathering: Generator[float, None, ProbePart],
    names: Sequence[str],
    origin: np.ndarray,
) -> Generator[float, None, ProbeGrid]:
    """Return the light of a volume after the repair of invalid probes; yield the fraction done.

    names:   names of the light groups
    origin:  `Triangles.origin`
    """
    coefficients, validity, positions, distances = yield from run_as_fraction(0.0, _GATHERING, gathering)
    filling = filled(coefficients, validity > 0, volume)
    coefficients = yield from run_as_fraction(_GATHERING, 1.0, filling)
    return ProbeGrid(
        name=volume.name,
        resolution=volume.resolution,
        matrix=volume.matrix,
        coefficients=np.ascontiguousarray(coefficients[:, 0]),
        validity=validity,
        positions=(positions + origin).astype(np.float32),
        groups={name: np.ascontiguousarray(coefficients[:, number]) for number, name in enumerate(names, 1)},
        distances=distances,
    )


def _radiance(job: SolveJob, light: Values, substitute: np.ndarray | None) -> ProbeRadiance:
    """Return the radiance that probes receive from patches and background.

    job:         patches with all light, or with the light of one group
    light:       (n, 3) float32, E/pi of the patches
    substitute:  (n,) uint32, substitute patches; None if all are valid
    """
    radiance = radiance_of(job, light, substitute)
    mean = mean_luminance(job.opencl, radiance, job.count)
    return ProbeRadiance(radiance, job.background, job.fronts + 1, max(DARK_BACK * mean, _BLACK))


def _batch_size(directions: int) -> int:
    """Return the number of probes whose samples fit into memory at once."""
    return max(1, min(_BATCH, _BATCH_BYTES // (_SAMPLE_BYTES * directions)))


class ProbeGather:
    """Gather of volumes from the light of one solution, and of its light groups.

    lights:     radiance of all light, then of each light group
    groups:     light group of each emitter; None without light groups
    keeps_rows: True if the session keeps the samples for the next bake
    """

    def __init__(
        self,
        texel_job: TexelGatherJob,
        lights: Sequence[ProbeRadiance],
        groups: LightGroups | None,
        keeps_rows: bool = True,
    ) -> None:
        self._texel_job, self._lights, self._settings = texel_job, lights, texel_job.job.settings
        self._keeps_rows = keeps_rows
        self._compute, self._rays = texel_job.job.opencl, texel_job.job.rays.rays
        self._direct = ProbeLights(
            self._compute, self._rays, texel_job.job.patch_scene, texel_job.lighting, self._settings, groups
        )
        self._origin = texel_job.job.patch_scene.triangles.origin
        self._drop_rows_of_others()

    def part(
        self, number: int, first: int, last: int, blocks: ProbeBlocks | None = None
    ) -> Generator[float, None, ProbePart]:
        """Return the probes first <= i < last of a volume, by its number; yield the fraction done.

        Invalid probes that did not move have the light inside geometry.

        blocks:  finished blocks, which are not gathered again; None to gather all
        """
        volume = self._texel_job.scene.probe_volumes[number]
        points = volume.points() - self._origin
        parts, batch_size = [], _batch_size(direction_count(self._settings.probe_samples))
        for start in range(first, last, batch_size):
            end = min(start + batch_size, last)
            done = (start - first) / (last - first), (end - first) / (last - first)
            part = None if blocks is None else blocks.find(number, start, end)
            if part is None:
                part = yield from run_as_fraction(*done, self._batch(volume, points[start:end], start))
                if blocks is not None:
                    blocks.add(number, start, end, part)
            parts.append(part)
        return joined(parts)

    def _batch(
        self, volume: ProbeVolume, points: np.ndarray, first: int
    ) -> Generator[float, None, ProbePart]:
        """Return the values of consecutive probes."""
        rows = self._kept_rows(volume, points, first)
        yield from run_as_fraction(0.0, _TRACING, rows.trace())
        coefficients, valid = yield from run_as_fraction(_TRACING, _PROJECTING, self._projected(rows))
        validity, points, distances = valid.astype(np.float32), points.copy(), rows.distances
        invalid = np.flatnonzero(validity == 0)
        if len(invalid):
            moving = self._moved(volume, rows, invalid, first)
            moved, positions, light, maps = yield from run_as_fraction(_PROJECTING, _MOVING, moving)
            coefficients[moved], points[moved], validity[moved] = light, positions, 0.5
            if len(maps):
                distances = distances.copy()
                distances[moved] = maps
            rows = self._moved_rows(rows, "all", volume, points, first) if len(moved) else rows
        yield from run_as_fraction(_MOVING, 1.0, self._direct.add(rows, coefficients))
        return coefficients, validity, points, distances

    def _projected(self, rows: ProbeRows) -> Generator[float, None, tuple[np.ndarray, np.ndarray]]:
        """Return the light of samples, (n, lights, 9, 3) float32, and the mask of valid probes, (n,) bool."""
        coefficients = np.empty((rows.count, len(self._lights), VALUES), np.float32)
        for number, light in enumerate(self._lights):
            span = number / len(self._lights), (number + 1) / len(self._lights)
            gathered = yield from run_as_fraction(*span, rows.project(light))
            coefficients[:, number] = gathered[:, :VALUES]
            if number == 0:
                valid = gathered[:, VALUES] >= 1 - MAX_BACKS_PROBE
        return coefficients.reshape(rows.count, len(self._lights), COEFFICIENTS, 3), valid

    def _moved(
        self, volume: ProbeVolume, rows: ProbeRows, invalid: np.ndarray, first: int
    ) -> Generator[float, None, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Return the invalid probes, (k,) int64, that moved out of geometry, with their new values.

        The values are positions, light and distances as in `_batch`.
        """
        chosen, points = self._pushed_off(volume, rows, invalid)
        if not len(chosen):
            return chosen, points, np.zeros((0, len(self._lights), COEFFICIENTS, 3)), rows.distances[:0]
        moved = self._moved_rows(rows, "some", volume, points, first)
        yield from run_as_fraction(0.0, 0.9, moved.trace())
        coefficients, valid = yield from run_as_fraction(0.9, 1.0, self._projected(moved))
        distances = moved.distances[valid] if len(moved.distances) else moved.distances
        return chosen[valid], points[valid], coefficients[valid], distances

    def _pushed_off(
        self, volume: ProbeVolume, rows: ProbeRows, invalid: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the invalid probes, (k,) int64, that leave geometry in their cells, and their new points.

        Both are reused from the last bake if the same probes are invalid.
        """
        key = invalid.tobytes()
        if rows.pushed_off is None or rows.pushed_off[0] != key:
            offsets, stays = moved_out(volume, *rows.push_offs(invalid))
            rows.pushed_off = key, invalid[stays], (rows.points[invalid] + offsets)[stays]
        return rows.pushed_off[1:]

    def _moved_rows(
        self, rows: ProbeRows, key: str, volume: ProbeVolume, points: np.ndarray, first: int
    ) -> ProbeRows:
        """Return samples at the points of moved probes, from the last bake if the points have not changed."""
        place = points.tobytes()
        known = rows.moved.get(key)
        if known is None or known[0] != place:
            known = rows.moved[key] = place, self._rows(volume, points, first)
        return known[1]

    def _kept_rows(self, volume: ProbeVolume, points: np.ndarray, first: int) -> ProbeRows:
        """Return the samples of probes from the session's cache, else new ones."""
        cache, key = self._texel_job.job.kept.probes, (*self._key(volume), first)
        known = cache.get(key)
        if isinstance(known, ProbeRows):
            return known
        rows = self._rows(volume, points, first)
        others = (other.bytes for other in cache.values() if isinstance(other, ProbeRows))
        if self._keeps_rows and rows.bytes + sum(others) <= _KEPT:
            cache[key] = rows
        return rows

    def _key(self, volume: ProbeVolume) -> tuple:
        """Return everything besides the scene's geometry that determines the samples of a volume."""
        samples = direction_count(self._settings.probe_samples)
        limit = distance_limit(volume, self._settings)
        return volume.matrix.tobytes(), volume.resolution, samples, self._settings.seed, limit

    def _drop_rows_of_others(self) -> None:
        """Remove the samples of volumes that the scene does not have."""
        cache = self._texel_job.job.kept.probes
        mine = {self._key(volume) for volume in self._texel_job.scene.probe_volumes}
        for key in [key for key in cache if key[:-1] not in mine]:
            del cache[key]

    def _rows(self, volume: ProbeVolume, points: np.ndarray, first: int) -> ProbeRows:
        """Return new samples of probes."""
        reach = np.maximum(np.abs(points), np.abs(points + self._origin)).max(axis=1)
        margin = np.maximum(_MARGIN * volume.spacing, OF_COORDINATE * reach)
        settings = self._settings
        sources, seed = self._texel_job.job.patch_scene, settings.seed + first
        limit = distance_limit(volume, settings)
        return ProbeRows(
            compute=self._compute,
            rays=self._rays,
            sources=sources,
            points=points,
            margin=margin,
            samples=settings.probe_samples,
            seed=seed,
            limit=limit,
        )


def distance_limit(volume: ProbeVolume, settings: Settings) -> float | None:
    """Return the largest distance of the maps of a volume, m; None if it gets no maps."""
    has_maps = settings.probe_distances and volume.count <= MAX_DISTANCE_PROBES
    return volume.reach if has_maps else None


def probe_warnings(texel_job: TexelGatherJob) -> tuple[str, ...]:
    """Return warnings about probes that cannot be baked, or that miss bounced light or distances."""
    settings = texel_job.job.settings
    if texel_job.job.compute is None:
        return (
            "Light Probe Volumes: no OpenCL device, so only lightmaps are baked. Install an OpenCL driver, "
            "or switch Light Probes off.",
        )
    warnings = [
        f"Light Probe Volume '{volume.name}': {volume.count:,} probes exceed the {MAX_DISTANCE_PROBES:,} "
        "that Probe Distances allows, so it has none. Lower its resolution, or split the volume."
        for volume in texel_job.scene.probe_volumes
        if settings.probe_distances and volume.count > MAX_DISTANCE_PROBES
    ]
    if not settings.has_indirect:
        warnings.append(
            "Light Probe Volumes: no output has bounced light, so probes have none. Switch Combined on."
        )
    return tuple(warnings)
