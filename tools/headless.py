"""Blender as a Python module, with this checkout enabled as its extension."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
MODULE = "bl_ext.user_default.hemibake"

#: Name of the checkout as a package, apart from the extension that Blender enables.
_CHECKOUT = "hemibake"

#: Files of the extension: everything that Blender loads, without tests and tools.
PARTS = (
    "__init__.py", "blender_manifest.toml", "engine", "operators", "panels", "kernels", "shaders", "presets",
)  # fmt: skip


def load(name: str) -> ModuleType:
    """Return a module of the checkout; most in `operators` can be imported only once Blender runs."""
    if _CHECKOUT not in sys.modules:
        spec = spec_from_file_location(
            _CHECKOUT, ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
        )
        package = module_from_spec(spec)
        sys.modules[_CHECKOUT] = package
        spec.loader.exec_module(package)
    return import_module(f"{_CHECKOUT}.{name}")


@contextmanager
def blender() -> Iterator[None]:
    """Run Blender with user files of its own and Hemibake enabled, on an empty scene.

    Blender reads where its user files are when bpy is first imported, so this has to come first.
    """
    if "bpy" in sys.modules:
        raise RuntimeError("bpy has been imported already.")
    with tempfile.TemporaryDirectory(prefix="hemibake-") as folder:
        os.environ["BLENDER_USER_RESOURCES"] = folder
        install(Path(folder))
        import bpy

        bpy.ops.wm.read_factory_settings(use_empty=True)
        enable()
        try:
            yield
        finally:
            disable()


def install(resources: Path) -> None:
    """Put the checkout where Blender looks for extensions: as a link, else as a copy."""
    target = resources / "extensions" / "user_default" / "hemibake"
    target.parent.mkdir(parents=True)
    try:
        target.symlink_to(ROOT, target_is_directory=True)
    except OSError:
        target.mkdir()
        for part in PARTS:
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy2
            copy(ROOT / part, target / part)


def enable() -> None:
    """Enable the extension; raises RuntimeError if Blender cannot."""
    import addon_utils

    addon_utils.extensions_refresh(ensure_wheels=True)
    errors: list[Exception] = []
    if addon_utils.enable(MODULE, default_set=True, handle_error=errors.append) is None:
        raise RuntimeError(f"Hemibake cannot be enabled: {errors[0] if errors else 'unknown reason'}")


def disable() -> None:
    """Disable the extension."""
    import addon_utils

    addon_utils.disable(MODULE)


quiet_stdout = load("operators.command_line.stdout_guard").quiet_stdout
