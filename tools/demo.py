"""Bakes the Cornell box with the Bake operator and renders it lit by its lightmap alone.

python tools/demo.py --out out/demo
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from headless import ROOT, blender, load


def main() -> None:
    """Write the lightmap (.exr, .png) and the render (.png), and print the figures."""
    options = parse()
    options.out.mkdir(parents=True, exist_ok=True)
    with blender():
        import bpy

        sys.path.insert(0, str(ROOT / "examples"))
        import cornell_box

        cornell_box.build()
        report = bake(bpy.context, options)
        picture = lightmap_picture(report["images"][0], options.out)
        bpy.ops.hemibake.preview()
        render, seconds = render_room(bpy.context.scene, options)
    tell(report, [*report["files"], str(picture), str(render)], seconds)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for the results")
    parser.add_argument("--resolution", type=int, default=192, help="of the lightmap, texels")
    parser.add_argument("--hemicube", type=int, default=32, help="width of the hemicubes, texels")
    parser.add_argument("--samples", type=int, default=32, help="per pixel of the render")
    options = parser.parse_args()
    options.out = options.out.resolve()
    return options


def bake(context, options: argparse.Namespace) -> dict:
    """Bake the scene and return the report."""
    import bpy

    settings = context.scene.hemibake
    settings.quality = "high"
    settings.resolution, settings.hemicube = options.resolution, str(options.hemicube)
    settings.directory = str(options.out)
    bpy.ops.hemibake.bake()
    return json.loads(settings.report)


def lightmap_picture(image: str, folder: Path) -> Path:
    """Write a picture of a lightmap."""
    import bpy

    pictures = load("operators.result.pictures")

    path = folder / f"{image}.png"
    pictures.write_png(pictures.exposed(pictures.rec709_pixels(bpy.data.images[image])), path)
    return path


def render_room(scene, options: argparse.Namespace) -> tuple[Path, float]:
    """Render with Cycles; surfaces only emit, so one bounce-free sample is free of noise."""
    import bpy

    start = time.perf_counter()
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", options.samples
    scene.cycles.max_bounces, scene.cycles.use_denoising = 0, False
    scene.render.resolution_x = scene.render.resolution_y = 960
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", 0.6
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(options.out / "render.png")
    bpy.ops.render.render(write_still=True)
    return Path(scene.render.filepath), time.perf_counter() - start


def tell(report: dict, files: list[str], render_seconds: float) -> None:
    print(
        f"{report['objects']} objects, {report['patches']} patches, {report['iterations']} iterations, "
        f"remaining error {report['convergence_error']:.2%}"
    )
    print(f"baked in {report['seconds']['total']:.1f} s, rendered in {render_seconds:.1f} s")
    print(f"devices: {', '.join(report['devices'].values())}")
    for path in files:
        print(path)


if __name__ == "__main__":
    main()
