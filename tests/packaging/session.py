"""Steps in a Blender with the package: a JSON list of steps, answered by a JSON file.

python session.py STEPS ANSWERS                              # with the module bpy
blender -b --python session.py -- STEPS ANSWERS

It stands alone: a Blender that has only the package knows nothing of this checkout.
"""

import json
import sys
import tomllib
from importlib import import_module
from pathlib import Path

#: What asks a network for something, as Python's audit events call it.
_NETWORK = {"socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "urllib.Request"}

_REPOSITORY, _ID = "user_default", "hemibake"
_MODULE = f"bl_ext.{_REPOSITORY}.{_ID}"
_WHEELS = ("moderngl", "glcontext", "pyopencl", "pytools", "xatlas")

_CUBE = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
_INWARD = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def main() -> None:
    """Do the steps; each is the name of a function of this file and its arguments."""
    steps, answers = sys.argv[-2:]
    asked: list[str] = []
    sys.addaudithook(lambda event, values: asked.append(f"{event} {values}") if event in _NETWORK else None)
    import bpy  # noqa: F401  Blender's own modules are found once it has started

    done = [globals()[name](*arguments) for name, *arguments in json.loads(steps)]
    Path(answers).write_text(json.dumps({"steps": done, "network": asked, "python": sys.version}))


def nothing() -> None:
    """Start Blender and end it."""
    import bpy

    bpy.ops.wm.save_userpref()


def install(package: str) -> dict:
    """Install a package, over an older one if there is one, and enable it; return what Blender then has."""
    import bpy

    bpy.ops.extensions.package_install_files(
        filepath=package, repo=_REPOSITORY, enable_on_install=True, overwrite=True
    )
    return _state()


def chosen(wheels: list[str], platform: str, python: list[int]) -> list[str]:
    """Return which wheels Blender would install for a Python on a platform, as sysconfig calls it."""
    import sysconfig

    from bl_pkg.bl_extension_ops import _extensions_wheel_filter_for_this_system

    real = sysconfig.get_platform, sys.version_info
    sysconfig.get_platform, sys.version_info = lambda: platform, tuple(python)
    try:
        return _extensions_wheel_filter_for_this_system(wheels)
    finally:
        sysconfig.get_platform, sys.version_info = real


def enable() -> dict:
    """Enable what an earlier session installed."""
    import addon_utils

    addon_utils.extensions_refresh(ensure_wheels=True)
    addon_utils.enable(_MODULE, default_set=True)
    return _state()


def _state() -> dict:
    import addon_utils
    import bpy

    folder = Path(import_module(_MODULE).__file__).parent
    manifest = tomllib.loads((folder / "blender_manifest.toml").read_text(encoding="utf-8"))
    return {
        "version": manifest["version"],
        "enabled": _MODULE in bpy.context.preferences.addons and hasattr(bpy.types.Scene, "hemibake"),
        "warnings": addon_utils._extensions_warnings_get(),
        "online": bpy.app.online_access,
    }


def bake(in_worker: bool) -> dict:
    """Bake a room in which E/pi is 2 everywhere: a closed cube of reflectance 0.5 and radiance 1."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    mesh = bpy.data.meshes.new("Furnace")
    mesh.from_pydata(_CUBE, [], _INWARD)
    mesh.materials.append(_glow())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Furnace", mesh))
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.hemicube = 32, "16"

    # A window bakes in a process of its own.
    owner = import_module(f"{_MODULE}.operators.worker_manager").owner
    if in_worker:
        owner.bake = lambda: owner.worker().bake
    try:
        bpy.ops.hemibake.bake()
    finally:
        vars(owner).pop("bake", None)
    report = json.loads(settings.report)
    found = {name: sys.modules[name].__file__ for name in _WHEELS if name in sys.modules}
    return {
        "values": _values(),
        "devices": report["devices"],
        "wheels": found,
        "warnings": report["warnings"],
    }


def _glow():
    import bpy

    material = bpy.data.materials.new("Glow")
    if material.node_tree is None:
        material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    node.inputs["Emission Strength"].default_value = 1.0
    return material


def _values() -> list[float]:
    """Return the lightmap's values: red, green and blue of all texels, which are filled from neighbours."""
    import bpy

    (entry,) = bpy.context.scene.hemibake.lightmaps
    return [value for index, value in enumerate(entry.image.pixels) if index % 4 < 3]


def save(path: str) -> None:
    """Give the settings values that are nobody's defaults, and save the .blend."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.max_bounces, settings.tolerance = 7, 0.0125
    bpy.ops.wm.save_as_mainfile(filepath=path)


def load(path: str) -> dict:
    """Open a .blend and return its settings and lightmap."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=path)
    settings = bpy.context.scene.hemibake
    return {
        "resolution": settings.resolution,
        "iterations": settings.max_bounces,
        "tolerance": settings.tolerance,
        "uvs": [layer.name for layer in bpy.data.objects["Furnace"].data.uv_layers],
        "values": _values(),
    }


def disable() -> dict:
    """Disable it; return what of it Blender still has."""
    import addon_utils
    import bpy

    addon_utils.disable(_MODULE, default_set=True)
    types = [name for name in dir(bpy.types) if name.lower().startswith("hemibake")]
    kinds = [kind for kind in ("Scene", "Object") if hasattr(getattr(bpy.types, kind), "hemibake")]
    return {"left": types + kinds + dir(bpy.ops.hemibake)}


def uninstall() -> None:
    """Remove it."""
    import bpy

    repositories = bpy.context.preferences.extensions.repos
    index = next(i for i, repository in enumerate(repositories) if repository.module == _REPOSITORY)
    bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id=_ID)
    bpy.ops.wm.save_userpref()


if __name__ == "__main__":
    main()
