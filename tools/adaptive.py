"""Measures time saved and error added by *Adaptive* in bakes of interiors.

Errors are RMSE relative to the mean, of all texels and off edges of light, against a bake with 2,048 rays of
every patch, which stays in a folder. Times are those of the second bake of two.

    python tools/adaptive.py [--scenes demo sealed furnished] [--resolution 512] [--quality preview]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.interiors import furnished_room, sealed_rooms
from benchmarks.rooms import cornell_box
from engine import BakeResult, Scene, Settings, finished
from engine.quality import QUALITIES
from engine.session import Session
from tools.page_table import table_row
from tools.verification.difference import edges_of_light

SCENES = {"demo": cornell_box, "sealed": sealed_rooms, "furnished": furnished_room}

TRUTH = {"samples": 2048, "light_samples": 128, "tolerance": 1e-4, "seed": 77}


def main() -> None:
    """Bake every scene with and without."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--quality", choices=list(QUALITIES), default="preview")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="keeps truths")
    options = parser.parse_args()
    titles = ("scene", "adaptive", "s", "s of processors", "off edges", "all texels", "bias")
    print(f"{table_row(*titles)}\n|{'---|' * len(titles)}")
    for name in options.scenes:
        scene = SCENES[name](options.resolution)
        path = options.folder / f"hemibake-truth-{name}-{options.resolution}-{TRUTH['samples']}.npz"
        if not path.exists():
            truth, *_ = bake(scene, options.resolution, TRUTH)
            np.savez(path, display=truth.display, known=truth.known)
        with np.load(path) as kept:
            truth = kept["display"].astype(float), kept["known"]
        for adaptive in (False, True):
            values = {**QUALITIES[options.quality].values, "adaptive": adaptive}
            bake(scene, options.resolution, values)
            lightmap, wall, busy = bake(scene, options.resolution, values)
            figures = [f"{wall:.2f}", f"{busy:.2f}", *(f"{error:.2%}" for error in errors(lightmap, *truth))]
            print(table_row(name, "on" if adaptive else "off", *figures), flush=True)


_session = Session()


def bake(scene: Scene, resolution: int, values: dict) -> tuple[BakeResult, float, float]:
    """Return a lightmap without what is only shown, its seconds of wall time and of all processors.

    What patches see is found anew.
    """
    settings = Settings(
        resolution=resolution, visibility="rays", intermediates=False, hide_seams=False, margin=0, **values
    )
    _session.forget()
    started, busy = time.perf_counter(), time.process_time()
    lightmap = finished(_session.bake(scene, settings))
    return lightmap, time.perf_counter() - started, time.process_time() - busy


def errors(lightmap: BakeResult, truth: np.ndarray, known: np.ndarray) -> tuple[float, float, float]:
    """Return RMSE off edges of light and of all texels, and the mean error, relative to the truth's mean."""
    both = known & lightmap.known
    mean = truth[both].mean()
    difference = (lightmap.display - truth) / mean
    off = both & ~edges_of_light(truth, known, mean)
    rmse = [float(np.sqrt((difference[chosen] ** 2).mean())) for chosen in (off, both)]
    return rmse[0], rmse[1], float(difference[both].mean())


if __name__ == "__main__":
    main()
