"""Imports point down the list of rooms without circles; pages name existing files."""

import ast
import re
import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TypeVar

import pytest

Node = TypeVar("Node")

ROOT = Path(__file__).resolve().parents[2]

#: Rooms and files of each package, from the top down.
ORDERS = {
    "engine": [
        "worker", "__init__", "warm_up", "self_test", "session", "live", "cluster", "pipeline",
        "texel_trace", "bake_state", "probes", "reflections", "texel_gather", "plan",
        "vertex_light", "postprocess", "solve", "gather", "direct", "validity", "visibility", "patches",
        "denoise",
        "device", "unwrap", "encoding", "scene", "resume", "settings", "outputs", "setting_types", "quality",
        "bake_result",
        "object_message", "progress", "errors", "nonzero", "array_ops", "numpy_pickle", "json_file",
    ],
    "engine/visibility": [
        "__init__", "raster", "rays", "sampler", "unoccluded_sky", "sample_counts", "views",
        "morton",
    ],
    "operators": [
        "__init__", "lightmaps", "live", "bake", "self_test", "unwrap", "modal", "warm_up", "live_run",
        "window_bake", "bake_run", "checks", "check", "bake_settings", "export", "gltf",
        "properties", "export_engines", "export_options",
        "command_line", "light_states", "preferences", "presets", "quality_property", "uv_modifiers",
        "applied_copies",
        "changed_objects", "lightmap_list", "lightmap_size", "live_watch", "preview", "preview_switch",
        "setting_properties", "bake_report", "devices", "file_handlers", "log",
        "probe_spheres", "probes", "result", "scene", "light_state_names",
        "file_format", "worker_manager", "object_properties", "translations", "user_files",
        "chart_settings", "compat", "denoise_library", "extension", "handlers", "last_bake", "lookup",
        "levels", "original_slots", "output_switches", "report_message", "rollback", "run_stages", "select",
        "viewports", "working_space",
    ],
    "operators/scene": [
        "__init__", "sun_path", "overlaps", "light_changes", "bake_targets", "density", "read_moved", "read",
        "read_lights",
        "read_stages", "fingerprints", "probe_volumes", "reflection_spheres", "light_probes", "room",
        "ignored_settings", "invalid_values", "world_mesh", "uv_layout",
        "overlap_layout", "uv_transform", "skyline_packing",
        "scene_objects", "light", "materials", "uvs", "scene_watch", "objects", "messages",
        "temporary_scene", "scene_context",
        "slice_timer", "units", "bake_records",
    ],
}  # fmt: skip


def modules(package: str) -> dict[str, Path]:
    """Return the files of a package by their dotted names from the root."""
    paths = (ROOT / package).rglob("*.py")
    return {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in paths}


def imports(package: str) -> set[tuple[str, str]]:
    """Return pairs of modules of a package of which the first imports the second."""
    known = modules(package)
    found = set()
    for name, path in known.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                base = name.split(".")[: -node.level] if node.level else []
                source = base + (node.module.split(".") if node.module else [])
                targets = (module(known, source, alias.name) for alias in node.names)
                found |= {(name, target) for target in targets if target and target != name}
    return found


def module(known: dict[str, Path], source: list[str], name: str) -> str | None:
    """Return the module that `from source import name` imports, None if it is not in the package."""
    candidates = ([*source, name], [*source, name, "__init__"], source, [*source, "__init__"])
    return next((path for parts in candidates if (path := ".".join(parts)) in known), None)


def room(package: str, module: str) -> str:
    """Return the room or file of a package that a module belongs to."""
    return module.split(".")[len(package.split("/"))]


def reachable(start: Node, follows: Mapping[Node, Collection[Node]]) -> set[Node]:
    """Return all that follows a start directly or by way of others."""
    reached, open_ends = set(), [start]
    while open_ends:
        new = set(follows.get(open_ends.pop(), ())) - reached
        reached |= new
        open_ends += new
    return reached


@pytest.mark.parametrize("package", ORDERS)
def test_imports_point_down(package):
    order = ORDERS[package]
    assert {room(package, name) for name in modules(package)} == set(order)
    upward = [
        f"{name} -> {target}"
        for name, target in imports(package)
        if order.index(room(package, name)) > order.index(room(package, target))
    ]
    assert not upward


@pytest.mark.parametrize("package", ["engine", "operators", "panels", "tools", "benchmarks", "tests"])
def test_neither_modules_nor_sub_rooms_import_each_other_in_circles(package):
    """At each depth of folders: depth 1 has rooms, the next one their sub-rooms, the last one modules."""
    pairs = imports(package)
    for depth in range(1, max(name.count(".") for name in modules(package)) + 1):
        follows: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
        for names in pairs:
            here, there = (tuple(name.split(".")[: depth + 1]) for name in names)
            if here != there and here[:depth] == there[:depth]:
                follows.setdefault(here, set()).add(there)
        for start in follows:
            assert start not in reachable(start, follows)


@pytest.mark.parametrize("package", ["engine", "operators", "panels"])
def test_product_imports_nothing_that_is_not_shipped(package):
    pattern = re.compile(r"^\s*(from|import) (tools|tests|benchmarks|examples|extras)\b", re.MULTILINE)
    assert not [name for name, path in modules(package).items() if pattern.search(path.read_text("utf-8"))]


def test_scripts_of_clients_import_each_other_without_circles():
    """Scripts import files by relative paths; packages of other engines import only the one for manifests."""
    follows: dict[Path, set[Path]] = {}
    packages: dict[str, set[str]] = {}
    for path in (ROOT / "clients").glob("*/src/*.js"):
        sources = re.findall(
            r"^(?:import|export)\b[^;]* from '([^']+)'", path.read_text("utf-8"), re.MULTILINE
        )
        files = {(path.parent / name).resolve() for name in sources if name.startswith(".")}
        assert all(file.is_file() and file.parent == path.parent for file in files)
        follows[path] = files
        ours = {name for name in sources if name.startswith("hemibake")}
        packages[path.parts[-3]] = packages.get(path.parts[-3], set()) | ours
    for start in follows:
        assert start not in reachable(start, follows)
    assert not packages.pop("manifest") and set().union(*packages.values()) == {"hemibake-manifest"}


@pytest.mark.parametrize("folder", ["kernels", "shaders"])
def test_includes_of_kernels_and_shaders_have_no_circles_between_folders(folder):
    found = {path.name: path for path in (ROOT / folder).rglob("*") if path.is_file()}
    follows: dict[str, set[str]] = {}
    for path in found.values():
        for name in re.findall(r'^#include "(.+)"', path.read_text("utf-8"), re.MULTILINE):
            if found[name].parent != path.parent:
                follows.setdefault(path.parent.name, set()).add(found[name].parent.name)
    for start in follows:
        assert start not in reachable(start, follows)


def test_layers_know_only_what_is_below_them():
    sources = {package: [path.read_text() for path in modules(package).values()] for package in
               ("engine", "operators", "panels")}  # fmt: skip
    above = r"^\s*((import|from) bpy|from \.+(operators|panels)\b)"
    assert not [text for text in sources["engine"] if re.search(above, text, re.MULTILINE)]
    for package in ("operators", "panels"):
        gpu = r"^\s*(import|from) (moderngl|pyopencl|glcontext)"
        assert not [text for text in sources[package] if re.search(gpu, text, re.MULTILINE)]
    assert not [text for text in sources["operators"] if re.search(r"^from \.+panels", text, re.MULTILINE)]


def test_pages_name_files_that_exist():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    folders = "engine|operators|panels|kernels|shaders|tests|tools|benchmarks|examples|extras"
    named = {
        (page.relative_to(ROOT).as_posix(), path)
        for page in pages
        for path in re.findall(rf"`((?:{folders})/[\w/.]+\.\w+)`", page.read_text(encoding="utf-8"))
    }
    assert len({path for page, path in named if page == "docs/dev/architecture.md"}) > 10
    assert not [entry for entry in sorted(named) if not (ROOT / entry[1]).exists()]


def test_python_has_the_names_of_the_standard_library():
    assert not {path.stem for path in (ROOT / "engine").glob("*.py")} & sys.stdlib_module_names
