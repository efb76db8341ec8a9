"""Measures the error of each quality, with and without Denoise: RMSE of lightmaps relative to their mean.

The truth is a bake with 32,768 rays a patch and 2,048 to each light. A quality is described by the largest
error of all rooms (engine/quality.py).

    python tools/quality.py [--rooms nine_quads cornell ...]        # about ten minutes on two cores
    python tools/quality.py --qualities draft --rays 4096           # two minutes, enough for the noisiest
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rooms import cornell_box, dark_box, hilly_room
from engine import Light, Scene, Settings, finished
from engine.quality import QUALITIES
from engine.session import bake
from tests.analytic.scenes import light_room, nine_quad_room, sphere
from tests.tools.real_denoiser import LIBRARY


def hills_under_the_sky(resolution: int) -> Scene:
    """Return hills in the open, lit by a sun and a blue sky."""
    hills = hilly_room(resolution, 5000)
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.full(3, 2, np.float32), half_angle=0.01)
    sky = np.array([0.5, 0.6, 0.8], np.float32)
    return Scene((hills.meshes[1],), hills.materials, world=sky, lights=(sun,))


#: Each with the resolution that its charts are made for.
ROOMS = {
    "nine_quads": (nine_quad_room(), 128),
    "cornell": (cornell_box(96), 96),
    "one_lamp": (dark_box(96, 1), 96),
    "nine_lamps": (dark_box(96, 9), 96),
    "small_light": (light_room(), 64),
    "sphere": (sphere(), 64),
    "hills": (hills_under_the_sky(96), 96),
}

TRUTH = {"tolerance": 1e-5, "seed": 77}


def main() -> None:
    """Bake every room in every quality."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    parser.add_argument("--qualities", nargs="+", choices=list(QUALITIES), default=list(QUALITIES))
    parser.add_argument("--rays", type=int, default=32768, help="of a patch in the truth")
    options = parser.parse_args()
    worst = {name: [0.0, 0.0] for name in options.qualities}
    for room in options.rooms:
        truth, _ = texels(room, TRUTH | {"samples": options.rays, "light_samples": options.rays // 16})
        for name in options.qualities:
            errors = []
            for denoise in (False, True):
                light, seconds = texels(room, {**QUALITIES[name].values, "denoise": denoise})
                errors.append(float(np.sqrt(np.mean((light - truth) ** 2)) / truth.mean()))
            worst[name] = np.maximum(worst[name], errors)
            figures = f"{errors[0]:.2%}, denoised {errors[1]:.2%}, {seconds:.2f} s"
            print(f"{room}, {QUALITIES[name].label}: {figures}", flush=True)
    for name, (plain, denoised) in worst.items():
        quality = QUALITIES[name]
        told = f"told as {quality.error:.1%} and {quality.denoised or 'nothing'}"
        print(f"{quality.label}: at most {plain:.2%}, denoised {denoised:.2%}; {told}")


def texels(room: str, values: dict) -> tuple[np.ndarray, float]:
    """Return E/pi of every texel of a room that is seen, (n, 3) float64, and the seconds of the bake."""
    scene, resolution = ROOMS[room]
    started = time.perf_counter()
    settings = Settings(
        resolution=resolution, visibility="rays", intermediates=False, hide_seams=False, margin=0,
        denoise_library=LIBRARY and str(LIBRARY), **values,
    )  # fmt: skip
    lightmap = finished(bake(scene, settings))
    for warning in lightmap.report.warnings:
        print(warning, flush=True)
    return lightmap.display[lightmap.known].astype(float), time.perf_counter() - started


if __name__ == "__main__":
    main()
