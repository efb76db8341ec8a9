"""Opens the scene file of a command, and replaces the world."""

from __future__ import annotations

from pathlib import Path

from .options import CommandError


def check_scene(scene: Path) -> None:
    """Raise CommandError if there is no scene file at a path."""
    if scene.is_dir():
        raise CommandError(f"'{scene}' is a folder. Name a scene file in it.")
    if scene.suffix.lower() not in _OPENERS:
        raise CommandError(f"'{scene.name}' is not a scene this can open: use {', '.join(_OPENERS)}.")
    if not scene.is_file():
        raise CommandError(f"There is no file '{scene}'.")


def open_scene(path: Path) -> None:
    """Open a scene file; raises CommandError if Blender cannot open it."""
    try:
        _OPENERS[path.suffix.lower()](str(path))
    except RuntimeError as error:
        raise CommandError(f"'{path}' cannot be opened: {error}".strip()) from error


def replace_world(radiance: tuple[float, float, float]) -> None:
    """Replace the scene's world by a constant radiance, linear Rec.709."""
    import bpy

    world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Color"].default_value = (*radiance, 1.0)
    background.inputs["Strength"].default_value = 1.0
    bpy.context.scene.world = world


def _open_blend(path: str) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)


def _import_gltf(path: str) -> None:
    import bpy

    _start_empty()
    bpy.ops.import_scene.gltf(filepath=path)


def _import_obj(path: str) -> None:
    import bpy

    _start_empty()
    bpy.ops.wm.obj_import(filepath=path)


def _start_empty() -> None:
    """Replace the open file by an empty one, so that an imported scene is baked alone."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


#: Function that opens a scene file, by suffix.
_OPENERS = {".blend": _open_blend, ".glb": _import_gltf, ".gltf": _import_gltf, ".obj": _import_obj}
