"""Compare a lightmap with Cycles' DIFFUSE bake (direct + indirect, no colour) on the same UVs.

    python tools/compare_cycles.py --out out/compare [--scene FILE.blend] [--resolution N] [--samples N]

Without --scene the demo room is compared. Cycles bakes twice with different seeds, unclamped and with
64 bounces. Its noise is independent in the two bakes A and B, so with Hemibake's H the mean of
(H - A)(H - B) is the squared error without the noise; RMSE is its root, relative to Cycles' mean.

Counted are the channels of texels that both bakers cover. Left out are texels hidden inside other
geometry, such as the floor below a box: their light is no one's business, and they are told by being
exactly black in both bakes of Cycles, which no texel is that light can reach.
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path

import numpy as np
from headless import MODULE, ROOT, blender


def main() -> None:
    """Print the figures and write a picture of the difference."""
    options = parse()
    options.out.mkdir(parents=True, exist_ok=True)
    with blender():
        import bpy

        load_scene(options.scene)
        settings = bpy.context.scene.hemibake
        settings.resolution, settings.hemicube = options.resolution, str(options.hemicube)
        settings.tolerance, settings.iterations = 0.0005, 200
        lightmap = bake_hemibake(bpy.context)
        if len(lightmap.atlases) != 1:
            raise SystemExit("This compares scenes with one lightmap only.")
        bakes = [bake_cycles(bpy.context, options, seed) for seed in (1, 2)]
        error = compare(lightmap, bakes, options.out)
    if options.limit is not None and error > options.limit / 100:
        raise SystemExit(f"The difference is above {options.limit} %.")


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/compare"), help="folder for the picture")
    parser.add_argument("--scene", type=Path, help=".blend to compare instead of the demo room")
    parser.add_argument("--resolution", type=int, default=128, help="of the lightmap, texels")
    parser.add_argument("--hemicube", type=int, default=64, help="width of the hemicubes, texels")
    parser.add_argument("--samples", type=int, default=256, help="per texel, in each bake of Cycles")
    parser.add_argument("--limit", type=float, help="fail if the RMSE is above so many per cent")
    options = parser.parse_args()
    options.out = options.out.resolve()
    return options


def load_scene(path: Path | None) -> None:
    import sys

    import bpy

    if path is not None:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False)
        return
    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box

    cornell_box.build()


def bake_hemibake(context):
    """Return the engine's Lightmap of the scene, after giving it lightmap UVs."""
    import bpy

    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.hemibake.unwrap()
    engine = importlib.import_module(f"{MODULE}.engine")
    scene = importlib.import_module(f"{MODULE}.operators.scene")
    read_settings = importlib.import_module(f"{MODULE}.operators.bake_settings").read_settings
    settings = context.scene.hemibake
    objects = scene.visible_meshes(context)
    gathered = scene.gather(context, objects, settings.uv_layer, settings.resolution)
    job = engine.bake(gathered.scene, read_settings(settings))
    while True:
        try:
            next(job)
        except StopIteration as end:
            return end.value


def bake_cycles(context, options: argparse.Namespace, seed: int) -> np.ndarray:
    """Return Cycles' bake, (h, w, 4) float32; alpha is 0 where it covers nothing."""
    import bpy

    image = bpy.data.images.new(f"Cycles {seed}", *[options.resolution] * 2, alpha=True, float_buffer=True)
    image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32))
    set_up_cycles(context.scene, options.samples, seed)
    objects = [obj for obj in context.visible_objects if obj.type == "MESH" and not obj.hide_render]
    for obj in objects:
        obj.select_set(True)
        aim_materials(obj, image)
    context.view_layer.objects.active = objects[0]
    bpy.ops.object.bake(
        type="DIFFUSE",
        pass_filter={"DIRECT", "INDIRECT"},
        margin=0,
        use_clear=False,
        uv_layer=context.scene.hemibake.uv_layer,
    )
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(options.resolution, options.resolution, 4)


def set_up_cycles(scene, samples: int, seed: int) -> None:
    """Take out every bias: clamping, short paths, denoising, light thresholds."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = 0.0


def aim_materials(obj, image) -> None:
    """Make an image texture node with the image the active node of each of an object's materials."""
    for slot in obj.material_slots:
        nodes = slot.material.node_tree.nodes
        node = nodes.get("Compare") or nodes.new("ShaderNodeTexImage")
        node.name, node.image = "Compare", image
        nodes.active = node


def compare(lightmap, bakes: list[np.ndarray], out: Path) -> float:
    """Print the relative RMSE and the mean bias and write the difference; return the RMSE."""
    from picture import write_png

    first, second = (bake[..., :3] for bake in bakes)
    seen = (first > 0).any(axis=-1) | (second > 0).any(axis=-1)
    both = lightmap.covered[0] & (bakes[0][..., 3] > 0)
    used = both & seen
    ours, truth = lightmap.image[0][used], (first[used] + second[used]) / 2
    error = np.sqrt(max(0.0, np.mean((ours - first[used]) * (ours - second[used]), dtype=np.float64)))
    noise = np.sqrt(np.mean((first[used] - second[used]) ** 2, dtype=np.float64)) / 2
    mean = truth.mean(dtype=np.float64)
    print(f"{used.sum()} texels compared, {(both & ~seen).sum()} hidden texels left out")
    print(f"relative RMSE {error / mean:.2%} (noise of the Cycles mean, removed from it: {noise / mean:.2%})")
    print(f"mean bias {(ours.mean(dtype=np.float64) - mean) / mean:+.2%}")
    difference = np.where(used[..., None], (lightmap.image[0] - (first + second) / 2) / mean, 0)
    path = out / "difference.png"
    write_png(np.clip(0.5 + 2.5 * difference, 0, 1), path)
    print(f"{path}: grey is equal, white and black are +-20 % of the mean")
    return error / mean


if __name__ == "__main__":
    main()
