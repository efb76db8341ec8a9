"""Measures Unwrap: used area, time, stalls of the window, and time to cancel.

    python tools/unwrapping.py [--only NAME ...] [--scenes FOLDER] [--cancel SECONDS]

Times have meaning on an idle machine only; processor time is that of all processes.
"""

from __future__ import annotations

import argparse
import importlib
import resource
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from engine.unwrap.polygon_mesh import signed_areas  # noqa: E402
from tools.headless import MODULE, blender, quiet_stdout  # noqa: E402
from tools.page_table import table_row  # noqa: E402

_TITLES = (
    "scene",
    "objects",
    "faces",
    "width",
    "lightmaps",
    "texels used",
    "s",
    "s of processors",
    "longest slice",
)


def main() -> None:
    """Unwrap every scene."""
    options = parse()
    with blender():
        import bpy

        from tools.verification import unwrap_scenes

        unwrap_scenes.register_files(options.scenes)
        print(table_row(*_TITLES))
        for name in options.only or unwrap_scenes.SCENES:
            build = unwrap_scenes.SCENES[name]
            with quiet_stdout():
                bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
                width = build()
                bpy.context.scene.hemibake.resolution = options.resolution or width
            if options.cancel:
                seconds = seconds_to_cancel(options.cancel)
                told = "ended before it was cancelled" if seconds is None else f"cancelled in {seconds:.3f} s"
                print(f"{name}: {told}", flush=True)
            print(_line(build.__doc__.rstrip(".")), flush=True)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", help="names of scenes")
    parser.add_argument("--resolution", type=int, help="of the lightmaps; of each scene its own without it")
    parser.add_argument("--cancel", type=float, help="seconds after which a first unwrapping is cancelled")
    parser.add_argument(
        "--scenes", type=Path, default=ROOT.parent / "shared" / "scenes", help="folder of files"
    )
    return parser.parse_args()


def _line(title: str) -> str:
    """Unwrap the scene that is open; return its line of the table."""
    import bpy

    work = unwrapping()
    began, before, longest = time.perf_counter(), processor_time(), 0.0
    while True:
        sliced = time.perf_counter()
        try:
            work.step()
        except StopIteration:
            break
        longest = max(longest, time.perf_counter() - sliced)
    wall, busy = time.perf_counter() - began, processor_time() - before
    objects = [obj for obj in bpy.context.scene.objects if obj.type == "MESH"]
    faces = sum(len(obj.data.polygons) for obj in objects)
    used = used_texels(objects)
    return table_row(
        title, str(len(objects)), f"{faces:,}", str(bpy.context.scene.hemibake.resolution), str(len(used)),
        f"{np.mean(list(used.values())):.1%}", f"{wall:.1f}", f"{busy:.1f}", f"{longest:.2f} s",
    )  # fmt: skip


def seconds_to_cancel(after: float) -> float | None:
    """Return the seconds that cancelling takes after so many of unwrapping; None if that ended before."""
    work, began = unwrapping(), time.perf_counter()
    while time.perf_counter() - began < after:
        try:
            work.step()
        except StopIteration:
            work.cancel()
            return None
    began = time.perf_counter()
    work.cancel()
    return time.perf_counter() - began


def unwrapping():
    """Return the work of the Unwrap operator for all objects, as a window does it slice by slice."""
    import bpy

    unwrap = importlib.import_module(f"{MODULE}.operators.unwrap")
    return unwrap.Unwrapping(bpy.context, [obj for obj in bpy.context.scene.objects if obj.type == "MESH"])


def processor_time() -> float:
    """Return the seconds that processors have worked for this process and those it has waited for."""
    usages = (resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def used_texels(objects) -> dict[str, float]:
    """Return the part of each lightmap that surfaces cover."""
    import bpy

    layer, used = bpy.context.scene.hemibake.uv_layer, {}
    for obj in objects:
        mesh, atlas = obj.data, obj.hemibake.atlas
        uvs = np.empty((len(mesh.loops), 2), np.float32)
        mesh.uv_layers[layer].uv.foreach_get("vector", uvs.reshape(-1))
        mesh.calc_loop_triangles()
        triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
        mesh.loop_triangles.foreach_get("loops", triangles.reshape(-1))
        area = np.abs(signed_areas(uvs[triangles].astype(np.float64))).sum()
        used[atlas] = used.get(atlas, 0.0) + float(area)
    return used


if __name__ == "__main__":
    main()
