"""Bakes of the same arrays by Hemibake and by glim, to the same error, on one GPU.

python -m benchmarks.glim LIBRARY --arrays FOLDER [--scene box living_room ...] [--goal 5 2] [--bakes 8]

LIBRARY is glim's shared library, built from github.com/z3y/glim (cargo build --release); FOLDER is what
`benchmarks.scene_arrays` has written. Textures and the world become constants, lamps are left out. The error
is the RMSE over all baked texels, relative to their mean, against each program's own fine bake. Of the
samples that reach the goal, the fastest count. Then bakes alternate; the table has their medians and spread.
U and G are those of `benchmarks.launches`. glim has one point of a texel as G has, but dilates as U does.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.glim_library import Glim, GlimSamples, GlimScene
from benchmarks.launches import WORK, made_scene
from benchmarks.tables import table

if TYPE_CHECKING:
    from engine import Scene, Settings
    from engine.session import Session

#: Scenes, and the width of their lightmaps, texels.
_SCENES = {
    "box": 1024, "gazebo": 512, "complex-small": 512, "complex": 1024, "living_room": 1024, "house": 1024,
}  # fmt: skip

#: Rays, light samples and tolerance of bakes here, and of the fine bake.
_RAYS = ((16, 4, 0.03), (32, 8, 0.02), (64, 16, 0.01), (128, 64, 0.01), (256, 256, 0.005))
_FINE_RAYS = (8192, 1024, 1e-4)

#: Direct and indirect samples and bounces of bakes there, and of the fine bake.
_DIRECT, _INDIRECT, _BOUNCES = (8, 16, 32, 64, 128, 256), (2, 4, 8, 16, 32, 64, 128), (2, 3, 4, 6, 8)
_FINE = GlimSamples(8192, 2048, 8)

#: Titles of the table.
_TITLES = ("scene, error", "U, s", "G, s", "glim, s", "with seams, s", "glim / U", "with seams / U")

#: Bakes; returns seconds and the image.
_Bake = Callable[[], tuple[float, np.ndarray]]

#: Largest reflectance of a plain scene (chosen), and width of the margin of its charts, texels.
_LARGEST_REFLECTANCE, _MARGIN = 0.8, 4

#: Bounces suffice if the error is below this part of the goal, or this multiple of the least (chosen).
_SPARE, _EQUAL = 0.7, 1.02

#: While the fastest is sought: bakes of each number of rays here, and samples there that reach a goal.
_TRIALS, _ENOUGH = 3, 3


def main() -> None:
    """Measure the scenes and print a table."""
    options = _parse()
    rows = []
    for name in options.scene:
        rows += _rows(name, options)
        print(table(_TITLES, rows), flush=True)


def _rows(name: str, options: argparse.Namespace) -> list[tuple[Any, ...]]:
    """Return the rows of a scene, one for each goal."""
    from engine.device.freed_memory import keep_freed_memory
    from engine.session import Session

    keep_freed_memory()
    resolution, session = options.width or _SCENES[name], Session()
    scene = plain_scene(made_scene(name.split("-")[0], resolution, options.arrays))
    glim = Glim(options.library.resolve(), glim_scene(scene, resolution))
    fine = glim.bake(_FINE)[1]
    sought = {work: _hemibake_errors(session, scene, resolution, work) for work in WORK}
    rows = []
    for goal in options.goal:
        bakes: dict[str, _Bake] = {}
        chosen: dict[str, Any] = {}
        for work, errors in sought.items():
            if (rays := fastest(errors, goal)) is not None:
                bakes[work] = partial(_hemibake, session, scene, resolution, work, rays)
                chosen[work] = rays
        if (samples := _glim_samples(glim, fine, goal)) is not None:
            bakes["glim"], bakes["seams"] = (partial(glim.bake, samples, seams) for seams in (False, True))
            chosen["glim"] = samples
        print(f"{name}, {goal:g} %: {chosen}", flush=True)
        rows.append(_row(f"{name.split('-')[0]} {resolution}², {goal:g} %", bakes, options.bakes))
    glim.close()
    session.close()
    return rows


def _row(title: str, bakes: dict[str, _Bake], count: int) -> tuple[Any, ...]:
    """Alternate bakes, and return a row of medians and spreads."""
    times: dict[str, list[float]] = {name: [] for name in bakes}
    for _ in range(count):
        for name, bake in bakes.items():
            times[name].append(bake()[0])
    medians = {name: statistics.median(values) for name, values in times.items()}
    cells = [
        f"{medians[name]:.3f} ({min(times[name]):.3f}–{max(times[name]):.3f})" if name in times else None
        for name in ("U", "G", "glim", "seams")
    ]
    ratios = [
        f"{medians[name] / medians['U']:.2f}" if {name, "U"} <= set(medians) else None
        for name in ("glim", "seams")
    ]
    return title, *cells, *ratios


def fastest(errors: Iterable[tuple[float, float, Any]], goal: float) -> Any | None:
    """Return the fastest samples whose error is at most `goal` %; None if none is.

    errors: error as a fraction, seconds, samples
    """
    reached = [(seconds, samples) for error, seconds, samples in errors if 100 * error <= goal]
    return min(reached, key=lambda pair: pair[0])[1] if reached else None


def _hemibake_errors(
    session: Session, scene: Scene, resolution: int, work: str
) -> list[tuple[float, float, Any]]:
    """Return the error and the time of Hemibake's bakes."""
    fine = _hemibake(session, scene, resolution, work, _FINE_RAYS)[1]
    found = []
    for rays in _RAYS:
        bakes = [_hemibake(session, scene, resolution, work, rays) for _ in range(_TRIALS)]
        found.append((_error(bakes[-1][1], fine), min(seconds for seconds, _ in bakes), rays))
    return found


def _glim_samples(glim: Glim, fine: np.ndarray, goal: float) -> GlimSamples | None:
    """Return the fastest samples with which glim's error is at most `goal` %; None if none are found.

    The fewest bounces that leave room for noise are found with the most samples. Then samples are tried by
    their number of rays, until a few reach the goal.
    """
    most = max(_DIRECT), max(_INDIRECT)
    errors = {count: 100 * _error(glim.bake(GlimSamples(*most, count))[1], fine) for count in _BOUNCES}
    enough = [count for count, error in errors.items() if error <= goal]
    if not enough:
        return None
    limit = max(_SPARE * goal, _EQUAL * min(errors.values()))
    bounces = next(count for count in enough if errors[count] <= limit)
    found = []
    for direct, indirect in sorted(product(_DIRECT, _INDIRECT), key=lambda pair: pair[0] + bounces * pair[1]):
        samples = GlimSamples(direct, indirect, bounces)
        bakes = [glim.bake(samples) for _ in range(2)]
        if 100 * _error(bakes[-1][1], fine) <= goal:
            found.append((min(seconds for seconds, _ in bakes), samples))
        if len(found) == _ENOUGH:
            break
    return min(found, key=lambda pair: pair[0])[1] if found else None


def _error(image: np.ndarray, fine: np.ndarray) -> float:
    """Return the RMSE over texels with light, relative to the mean, of (r, r, 4) images."""
    baked = (fine[..., 3] > 0) & (image[..., 3] > 0)
    difference = image[baked][:, :3].astype(np.float64) - fine[baked][:, :3]
    return float(np.sqrt(np.mean(difference**2)) / fine[baked][:, :3].mean(dtype=np.float64))


def _hemibake(
    session: Session, scene: Scene, resolution: int, work: str, rays: tuple[int, int, float]
) -> tuple[float, np.ndarray]:
    """Bake here; return seconds and the image, (r, r, 4) float32: light, and 1 where a texel has some."""
    from engine import finished

    session.forget()
    began = time.perf_counter()
    result = finished(session.bake(scene, _settings(resolution, work, rays)))
    seconds = time.perf_counter() - began
    return seconds, np.dstack([result.display[0], result.has_patch[0]]).astype(np.float32)


def _settings(resolution: int, work: str, rays: tuple[int, int, float]) -> Settings:
    """Return the settings of a bake."""
    from benchmarks.configurations import settings

    values: dict[str, Any] = dict(zip(("samples", "light_samples", "tolerance"), rays, strict=True))
    return settings({"visibility": "rays", **values, **WORK[work]}, resolution=resolution)


def plain_scene(scene: Scene) -> Scene:
    """Return a scene of opaque constant materials below a constant world, without lamps."""
    from engine import Material

    materials = tuple(
        Material(
            made.name,
            np.minimum(made.reflectance, np.float32(_LARGEST_REFLECTANCE)),
            np.zeros(3, np.float32) if made.emission_map else made.emission,
        )
        for made in scene.materials
    )
    world = scene.world if scene.world.ndim == 1 else np.ones(3, np.float32)
    meshes = tuple(replace(mesh, texture_uvs={}) for mesh in scene.meshes)
    return replace(scene, meshes=meshes, materials=materials, world=world, lights=())


def glim_scene(scene: Scene, resolution: int) -> GlimScene:
    """Return the arrays of a plain scene with one lightmap as glim reads them."""
    materials, meshes = scene.materials, []
    for mesh in scene.meshes:
        arrays = (mesh.positions.reshape(-1, 3), mesh.normals.reshape(-1, 3), mesh.uvs.reshape(-1, 2))
        positions, normals, uvs = (np.ascontiguousarray(array, np.float32) for array in arrays)
        emissive = any(materials[number].emission.any() for number in np.unique(mesh.material))
        meshes.append((positions, normals, uvs, emissive))
    reflectance, emission = _drawn(scene, resolution)
    albedo = np.rint(255 * reflectance).astype(np.uint8)
    return GlimScene(meshes, albedo, emission, scene.world)


def _drawn(scene: Scene, resolution: int) -> list[np.ndarray]:
    """Return reflectance and emission at the texels of the lightmap, (r, r, 4) float32, with a margin."""
    from engine.device.devices import Devices
    from engine.patches.patch_scene import make_patch_scene

    devices = Devices()
    made = make_patch_scene(devices.graphics, devices.compute, scene, _settings(resolution, "G", _RAYS[0]))
    numbers = made.texel_to_patch[0].astype(np.int64)
    images = []
    for values in (made.surfaces.reflectance, made.surfaces.emission):
        rows = np.asarray(values.host() if hasattr(values, "host") else values)
        image = np.zeros((resolution, resolution, 4), np.float32)
        image[numbers > 0] = np.column_stack([rows, np.ones(len(rows), np.float32)])[numbers[numbers > 0] - 1]
        images.append(_with_margin(image))
    devices.release()
    return images


def _with_margin(image: np.ndarray) -> np.ndarray:
    """Return an image, (r, r, 4), whose empty texels near others have the values of one of these."""
    for turn in range(4 * _MARGIN):
        shifted = np.roll(image, 1 if turn % 2 else -1, axis=turn // 2 % 2)
        image = np.where(image[..., 3:] > 0, image, shifted)
    return image


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=Path, help="glim's shared library")
    parser.add_argument("--arrays", type=Path, help="folder that benchmarks.scene_arrays has written")
    parser.add_argument("--scene", nargs="+", default=list(_SCENES), choices=_SCENES)
    parser.add_argument("--goal", nargs="+", type=float, default=[5.0, 2.0], help="errors to reach, %%")
    parser.add_argument("--bakes", type=int, default=8, help="bakes of each program for the medians")
    parser.add_argument(
        "--width", type=int, help="width of the lightmaps, texels, instead of the scenes' own"
    )
    return parser.parse_args()


if __name__ == "__main__":
    main()
