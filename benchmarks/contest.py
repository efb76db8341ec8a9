"""Hemibake against Cycles in the open Blender scene, on the same lightmap UVs.

Only to be imported within `tools.headless.blender()`.
"""

from __future__ import annotations

import hashlib
import importlib
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from benchmarks.curves import Point
from tools.headless import MODULE, quiet_stdout
from tools.verification.areas import bake_areas
from tools.verification.cycles import RealisedScene
from tools.verification.difference import Difference, compare, weight_of

#: Seeds of the two halves of the reference, and of the measured bakes.
_HALVES, _SEED = (1, 2), 3

#: A bake faster than this is timed a second time, s.
_QUICK = 10.0

#: Samples of the first bake of Cycles that is measured, and of the last.
_FIRST, _LAST = 16, 4096


def operator_bake(context: bpy.types.Context, values: dict[str, Any]) -> tuple[float, Any]:
    """Bake as the Bake operator does: read the scene, bake, store; return seconds and the Lightmap.

    Devices and what they run are kept from the bake before, but nothing that patches see.
    """
    session = importlib.import_module(f"{MODULE}.engine.session")
    runs = importlib.import_module(f"{MODULE}.operators.bake_run")
    for name, value in values.items():
        setattr(context.scene.hemibake, name, str(value) if name == "hemicube" else value)
    session.forget()
    started = time.perf_counter()
    with quiet_stdout():
        run = runs.BakeRun(context, session.bake, watched=False)
        lightmap = run.run_to_end()
        run.finish(lightmap)
    return time.perf_counter() - started, lightmap


def best_of_two(work: Callable[[], tuple[float, Any]]) -> tuple[float, Any]:
    """Do something once, or twice if it is quick; return the best time and what it made then."""
    first = work()
    return min(first, work(), key=lambda pair: pair[0]) if first[0] < _QUICK else first


class Reference:
    """Two independent bakes of Cycles, kept in a folder: at the centres of texels, and of their areas.

    Each baker is measured against what it gives with endless samples: a texel of Cycles is the light at its
    centre, one of Hemibake the mean of what surfaces cover of it.

    samples:  of a texel, in each half
    seconds:  of all when they were made
    """

    def __init__(
        self, context: bpy.types.Context, cycles: RealisedScene, read, settings, case: str, samples: int,
        cache: Path,
    ) -> None:  # fmt: skip
        """Bake, or read what an earlier run has kept of the same scene in the folder `cache`."""
        path = cache / f"references-{case}-{samples}-{_digest(read.scene, samples)}.npz"
        if not path.exists():
            cache.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(path, **_reference(context, cycles, read, settings, samples))
        with np.load(path) as kept:
            self._centres = kept["first"], kept["second"]
            self._areas = kept["first_areas"], kept["second_areas"]
            self._colour, self._share = kept["colour"], kept["share"]
            self.seconds = float(kept["seconds"])
        self.samples = samples

    def compare_centres(self, image: np.ndarray, known: np.ndarray) -> Difference:
        """Return how far an image, (atlases, h, w, 3), is from the light at the centres of known texels."""
        return compare(image, known, weight_of(self._colour), self._centres)[0]

    def compare_areas(self, image: np.ndarray, known: np.ndarray) -> Difference:
        """Return how far an image, (atlases, h, w, 3), is from the mean light of known texels."""
        return compare(image, known, self._share, self._areas)[0]


def _reference(
    context: bpy.types.Context, cycles: RealisedScene, read, settings, samples: int
) -> dict[str, Any]:
    """Return the arrays that a `Reference` stores, by name."""
    began = time.perf_counter()
    with quiet_stdout():
        centres = [cycles.bake(samples, seed) for seed in _HALVES]
        colour = cycles.colour()
        areas = bake_areas(context, read, settings, samples)
    return {
        "first": centres[0], "second": centres[1], "colour": colour,
        "first_areas": areas.bakes[0], "second_areas": areas.bakes[1], "share": areas.share,
        "seconds": time.perf_counter() - began,
    }  # fmt: skip


def hemibake_curve(
    context: bpy.types.Context,
    reference: Reference,
    known_of: Callable[[Any], np.ndarray],
    configurations: list[dict[str, Any]],
    limit: float,
) -> tuple[list[dict[str, Any]], np.ndarray]:
    """Bake with every configuration; one above the limit in seconds ends those with its visibility.

    known_of tells the texels of a lightmap whose centres are known. Returns records, and these texels.
    """
    _, lightmap = operator_bake(context, configurations[0])
    known = known_of(lightmap)
    records, too_slow = [], set()
    for values in configurations:
        if values.get("visibility") in too_slow:
            continue
        seconds, lightmap = best_of_two(lambda values=values: operator_bake(context, values))
        figures = reference.compare_areas(lightmap.display, lightmap.known)
        report = lightmap.report
        stages = {stage: float(passed) for stage, passed in report.seconds.items()}
        records.append({**values, "seconds": seconds, **_errors(figures), "method": report.method,
                        "patches": int(report.patches), "stages": stages})  # fmt: skip
        if seconds > limit:
            too_slow.add(values.get("visibility"))
    return records, known


def cycles_curve(
    cycles: RealisedScene, reference: Reference, known: np.ndarray, device: str, target: float, limit: float
) -> list[dict[str, Any]]:
    """Bake with twice the samples each time until the error is below the target or a bake above the limit."""

    def bake(samples: int, persistent: bool) -> tuple[float, np.ndarray]:
        with quiet_stdout():
            image = cycles.bake(samples, _SEED, device, persistent)
        return cycles.seconds, image

    # Kernels are loaded first; then whatever is faster, with data kept between bakes or without.
    bake(1, False)
    fresh = min(bake(_FIRST, False)[0] for _ in range(2))
    bake(1, True)
    persistent = min(bake(_FIRST, True)[0] for _ in range(2)) < fresh
    records, samples = [], _FIRST
    while samples <= _LAST:
        seconds, image = best_of_two(lambda samples=samples: bake(samples, persistent))
        figures = reference.compare_centres(image[..., :3], known)
        records.append({"samples": samples, "seconds": seconds, "persistent": persistent, **_errors(figures)})
        if seconds > limit or 0 < figures.rmse < target:
            break
        samples *= 2
    return records


def points(records: list[dict[str, Any]], error: str) -> list[Point]:
    """Return the records whose error is known as points of a curve; error is "rmse" or "smooth"."""
    known = [record for record in records if record[error] is not None]
    return [Point(str(index), record["seconds"], record[error]) for index, record in enumerate(known)]


def cycles_devices(wanted: bool) -> list[str]:
    """Return the devices that Cycles can bake with: the processor, and a graphics card if one is wanted."""
    return ["CPU", "GPU"] if wanted and _use_cards() else ["CPU"]


def _use_cards() -> str | None:
    """Let Cycles use the first kind of graphics card that is there; return the kind."""
    addon = bpy.context.preferences.addons.get("cycles")
    if addon is None:
        return None
    for kind in ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL"):
        try:
            addon.preferences.compute_device_type = kind
            addon.preferences.refresh_devices()
        except (TypeError, RuntimeError, ValueError):
            continue
        cards = [device for device in addon.preferences.devices if device.type == kind]
        if cards:
            for device in addon.preferences.devices:
                device.use = device.type == kind
            return kind
    return None


def _errors(figures: Difference) -> dict[str, float | None]:
    """Return the errors; None where the noise of the reference is all there is: its estimate is then 0."""
    return {"rmse": figures.rmse or None, "smooth": figures.smooth or None, "bias": figures.bias}


def _digest(scene, samples: int) -> str:
    """Return a digest of all that determines a reference: the scene, the samples, Blender's version."""
    key = f"{bpy.app.version_string} {samples} {_plain(scene)!r}"
    return hashlib.sha256(key.encode()).hexdigest()[:12]


def _plain(value: Any) -> Any:
    """Return a value as builtins alone: records by their fields, arrays by a digest of their bytes."""
    if is_dataclass(value):
        return [(field.name, _plain(getattr(value, field.name))) for field in fields(value)]
    if isinstance(value, np.ndarray | np.generic):
        return value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
    if isinstance(value, dict):
        return [(name, _plain(item)) for name, item in value.items()]
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
