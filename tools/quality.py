"""Measures the error of each quality: the RMSE of lightmaps relative to their mean.

The truth is a bake with 32,768 rays a patch and 2,048 to each light. A quality is described by the largest
error of all rooms (engine/quality.py).

    python tools/quality.py [--rooms nine_quads cornell ...]        # about ten minutes on two cores
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

TRUTH = {"samples": 32768, "light_samples": 2048, "tolerance": 1e-5, "seed": 77}


def main() -> None:
    """Bake every room in every quality."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    worst = dict.fromkeys(QUALITIES, 0.0)
    for room in parser.parse_args().rooms:
        truth, _ = patches(room, TRUTH)
        for name, quality in QUALITIES.items():
            light, seconds = patches(room, quality.values)
            error = float(np.sqrt(np.mean((light - truth) ** 2)) / truth.mean())
            worst[name] = max(worst[name], error)
            print(f"{room}, {quality.label}: {error:.2%}, {seconds:.2f} s", flush=True)
    for name, quality in QUALITIES.items():
        print(f"{quality.label}: at most {worst[name]:.2%}, described as {quality.error:.1%}")


def patches(room: str, values: dict) -> tuple[np.ndarray, float]:
    """Return E/pi of every patch of a room, (n, 3) float64, and the seconds that the bake took."""
    scene, resolution = ROOMS[room]
    started = time.perf_counter()
    lightmap = finished(
        bake(scene, Settings(resolution=resolution, visibility="rays", intermediates=False, **values))
    )
    return lightmap.image[lightmap.has_patch].astype(float), time.perf_counter() - started


if __name__ == "__main__":
    main()
