"""Bakes a case with the engine and checks the result."""

from __future__ import annotations

import json
import math
import re
import tempfile
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from engine import BakeResult, EngineError, PatchFileError, Progress, Scene, Settings
from engine.outputs import DECODING
from engine.postprocess.output_names import output_names
from engine.scene.cutouts import has_cutouts
from engine.session import Session
from tests.fuzz.engine_cases import Case, build

_session = Session()

#: What a message may name instead of an object in quotes: a setting, the world, lightmaps, a device's limit.
_NAMED = "|".join(
    [r"'[^']+'", *(field.name for field in fields(Settings)), "world", "no mesh", "Shadow masks"]
)

#: Largest relative error of the mean light of a room that is known, and of single texels of it.
_MEAN, _TEXEL = 0.02, 0.3


def check(case: Case) -> str:
    """Bake a case; return how it ended, raise AssertionError if that is not how it should."""
    scene, settings = build(case)
    if case.room is not None or case.other is not None:
        settings = replace(settings, centres=True)
    try:
        if case.cancel is not None:
            _cancel(scene, settings, case.cancel)
            case = replace(case, cancel=None)
        lightmap = _bake(scene, settings)
    except EngineError as error:
        message = str(error)
        assert re.search(_NAMED, message) and message.rstrip().endswith("."), message
        return f"refused: {case.spoil or re.sub(r'[0-9.,]+', 'N', message)[:60]}"
    assert case.spoil is None, f"A scene with {case.spoil} is baked."
    _check_lightmap(lightmap, scene, settings)
    if case.room is not None:
        _check_room(lightmap, case.room)
    if case.other is not None:
        _check_alike(lightmap, _bake(scene, Settings(**{**case.other, "centres": True})), scene, settings)
    if case.damage is not None:
        _check_patch_file(scene, settings, case.damage, lightmap)
    return "baked"


def _bake(scene: Scene, settings: Settings) -> BakeResult:
    work = _session.bake(scene, settings)
    while True:
        try:
            _check_progress(next(work))
        except StopIteration as stop:
            return stop.value


#: First words of what a bake's stages are called.
_STAGES = {
    "Preparing", "Direct", "Choosing", "Visibility", "Bounce", "Final", "Light", "Outputs", "Supersampling",
    "Finishing",
}  # fmt: skip


def _cancel(scene: Scene, settings: Settings, slices: int) -> None:
    """Cancel a bake after a few slices, or at its end."""
    work = _session.bake(scene, settings)
    for _, progress in zip(range(slices), work, strict=False):
        _check_progress(progress)
    work.close()


def _check_progress(progress: Progress) -> None:
    assert progress.stage.partition(" ")[0] in _STAGES, progress.stage
    assert 0 <= progress.fraction <= 1 and 0 <= progress.overall <= 1, progress
    assert math.isnan(progress.seconds_left) or progress.seconds_left >= 0, progress.seconds_left
    assert math.isfinite(progress.energy), progress.energy
    assert math.isnan(progress.residual) or progress.residual >= 0, progress.residual
    if progress.intermediate is not None:
        _check_light("intermediate", progress.intermediate)


def _check_light(name: str, values: np.ndarray) -> None:
    assert values.dtype == np.float32
    assert np.isfinite(values).all(), f"{name} is not finite"
    if name not in DECODING:
        assert values.min(initial=0) >= 0, f"{name} is negative: {values.min()}"


def _check_lightmap(lightmap: BakeResult, scene: Scene, settings: Settings) -> None:
    shape = (len(scene.atlases), settings.resolution, settings.resolution)
    assert lightmap.atlases == scene.atlases
    assert lightmap.display.shape == (*shape, 3)
    assert lightmap.image.shape == ((*shape, 3) if settings.centres else (0, *shape[1:], 3))
    assert lightmap.has_patch.shape == shape and lightmap.has_patch.dtype == bool
    assert list(lightmap.passes) == output_names(scene, settings)
    _check_light("image", lightmap.image)
    for name, values in lightmap.passes.items():
        _check_light(name, values)
        assert values.shape == (*shape, 3)
        if name.startswith(("ambient_occlusion", "shadow_mask")):
            assert values.max() <= 1 + 1e-5, f"{name} is {values.max()}"
    if settings.centres:
        assert not lightmap.image[~lightmap.has_patch].any()
    _check_report(lightmap, settings)


def _check_report(lightmap: BakeResult, settings: Settings) -> None:
    report = lightmap.report
    assert report.patches >= lightmap.has_patch.sum()
    assert 0 <= report.iterations <= settings.max_bounces
    assert report.iterations or not lightmap.image.any(), "light without an iteration"
    assert len(report.added_flux) == report.iterations
    assert math.isnan(report.convergence_error) or report.convergence_error >= 0
    residual = report.convergence_error if math.isfinite(report.convergence_error) else None
    json.dumps(asdict(replace(report, convergence_error=residual)), allow_nan=False, default=np.generic.item)


def _check_room(lightmap: BakeResult, reflectance: float) -> None:
    """Check the last atlas: E/pi in a closed room of radiance 1 is 1 / (1 - reflectance)."""
    light = lightmap.image[-1][lightmap.has_patch[-1]] * (1 - reflectance)
    assert len(light) and abs(light.mean() - 1) < _MEAN, f"mean of the known room: {light.mean()}"
    assert np.abs(light - 1).max() < _TEXEL, f"known room: {light.min()} to {light.max()}"


def _check_patch_file(scene: Scene, settings: Settings, damage: int, expected: BakeResult) -> None:
    """Check that a bake from a patch file is the same, and that a damaged file is an error."""
    with tempfile.TemporaryDirectory(prefix="hemibake-fuzz-") as folder:
        path = Path(folder) / "patches"
        kept = replace(settings, patch_file=str(path))
        _bake(scene, kept)
        if damage >= 0:
            data = bytearray(path.read_bytes())
            data[damage % len(data)] ^= 0x55
            path.write_bytes(data)
        if damage >= 0:
            with pytest.raises(PatchFileError):
                _bake(scene, kept)
        else:
            assert (_bake(scene, kept).has_patch == expected.has_patch).all()


def _sample(scene: Scene, settings: Settings) -> float:
    """Return the most that a single sample of a patch's view brings, E/pi."""
    emissions = [
        float(material.emission.max()) * (1 if image is None else float(image.pixels.max()))
        for material in scene.materials
        for image in [material.emission_map]
    ]
    return max([*emissions, float(scene.world.max())]) / (2 * settings.hemicube**2)


def _check_alike(one: BakeResult, other: BakeResult, scene: Scene, settings: Settings) -> None:
    """Check that two ways to bake give about the same: no more than a few texels may differ, at edges.

    What passes through a half-transparent surface is drawn by lot: light of n samples is off by sqrt(n).
    """
    assert (one.has_patch == other.has_patch).all()
    first, second = one.image[one.has_patch], other.image[other.has_patch]
    if not len(first):
        return
    mean, sample = max(first.mean(), second.mean()), _sample(scene, settings)
    by_lot = has_cutouts(scene)
    noise = sample + (math.sqrt(mean * sample) if by_lot else 0)
    difference = np.abs(first - second).mean(axis=1)
    assert np.median(difference) <= 0.05 * mean + noise, (
        f"median difference {np.median(difference)} of {mean}"
    )
