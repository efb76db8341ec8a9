"""Contents of each package: complete, minimal and reproducible."""

import ast
import os
import sys
import time
import tomllib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging import tags
from packaging.requirements import Requirement
from packaging.utils import parse_wheel_filename

from tests.packaging.conftest import locked, names
from tools.packages.archive import MANIFEST, ROOT, build
from tools.packages.contents import page
from tools.packages.platforms import MISSING, PLATFORMS
from tools.packages.wheels import wheels_in

#: What Blender has itself.
BLENDERS = {"numpy", "requests", "urllib3", "certifi", "idna", "charset-normalizer", "zstandard", "cython"}

#: The newest tags that the oldest systems of Blender run, as pip lists them.
SYSTEMS = {
    "linux-x64": [
        *(f"manylinux_2_{minor}_x86_64" for minor in range(28, 4, -1)),
        *("manylinux2014_x86_64", "manylinux2010_x86_64", "manylinux1_x86_64", "linux_x86_64"),
    ],
    "windows-x64": ["win_amd64"],
    "macos-arm64": list(tags.mac_platforms((11, 0), "arm64")),
}

#: What the engine and the operators import, or have imported while they bake.
IMPORTED = ("moderngl", "moderngl.mgl", "glcontext", "pyopencl", "pyopencl.invoker", "platformdirs", "xatlas")

SHIPPED = {
    "LICENSE", "README.md", "__init__.py", MANIFEST, "clients", "engine", "guide", "kernels", "licenses",
    "operators", "panels", "presets", "shaders", "wheels",
}  # fmt: skip

TARGETS = [(platform, python) for platform in PLATFORMS for python in platform.pythons]


@pytest.fixture(params=names())
def archive(request, packages) -> Iterator[ZipFile]:
    with ZipFile(packages[request.param]) as opened:
        yield opened


@pytest.fixture(params=TARGETS, ids=lambda target: f"{target[0].name}-{target[1]}")
def target(request):
    return request.param


@pytest.fixture
def installed(target, packages, tmp_path) -> list:
    """Return the wheels that Blender would install on a platform for a Python: by their tags."""
    platform, python = target
    version = tuple(map(int, python.split(".")))
    supported = {*tags.cpython_tags(version, platforms=SYSTEMS[platform.name])}
    supported |= {*tags.compatible_tags(version, platforms=SYSTEMS[platform.name])}
    with ZipFile(packages[platform.name]) as opened:
        for name in opened.namelist():
            if name.endswith(".whl") and supported & parse_wheel_filename(Path(name).name)[3]:
                (tmp_path / Path(name).name).write_bytes(opened.read(name))
    return wheels_in(tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="its time zone cannot be changed")
def test_two_builds_are_the_same_byte_for_byte(wheels, packages, tmp_path, monkeypatch):
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    time.tzset()
    mask = os.umask(0o077)
    try:
        again = build(list(reversed(wheels)), tmp_path)
    finally:
        os.umask(mask)
        monkeypatch.undo()
        time.tzset()
    assert [path.name for path in again] == sorted(path.name for path in packages.values())
    for path in again:
        twin = next(twin for twin in packages.values() if twin.name == path.name)
        assert path.read_bytes() == twin.read_bytes(), path.name


def test_it_holds_what_blender_loads_and_nothing_of_development(archive):
    held = archive.namelist()
    assert {name.split("/")[0] for name in held} == SHIPPED
    assert not [name for name in held if "__pycache__" in name or name.split("/")[-1].startswith(".")]
    for folder in ("engine", "operators", "panels", "kernels", "shaders", "presets"):
        files = {path for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix != ".pyc"}
        assert {path.relative_to(ROOT).as_posix() for path in files} <= set(held)


def test_manifest_names_the_wheels_that_are_there_and_one_platform(archive):
    manifest = tomllib.loads(archive.read(MANIFEST).decode())
    generated = manifest.pop("build")["generated"]
    (platform,) = generated["platforms"]
    assert archive.filename.endswith(f"{platform.replace('-', '_')}.zip")
    held = {f"./{name}" for name in archive.namelist() if name.startswith("wheels/")}
    assert set(generated["wheels"]) == held <= set(manifest["wheels"])

    # The rest is the manifest of the checkout, which has no wheels.
    checkout = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    assert manifest | {"wheels": 0, "platforms": 0} == checkout | {"wheels": 0, "platforms": 0}
    assert not {"wheels", "platforms", "build"} & checkout.keys()


def test_each_python_gets_one_wheel_of_each_package_and_none_that_blender_has(target, installed):
    found = [wheel.name for wheel in installed]
    assert sorted(found) == sorted(set(locked()) - set(MISSING.get(target[1], ())))
    assert not BLENDERS & set(found)


def test_what_the_wheels_require_is_there(target, installed):
    platform, python = target
    held = {wheel.name: wheel.version for wheel in installed}
    system = {"linux": ("Linux", "posix"), "win32": ("Windows", "nt"), "darwin": ("Darwin", "posix")}
    environment = {
        "extra": "",
        "python_version": python,
        "python_full_version": f"{python}.0",
        "sys_platform": platform.system,
        "platform_system": system[platform.system][0],
        "os_name": system[platform.system][1],
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
        "platform_machine": {"windows-x64": "AMD64", "macos-arm64": "arm64"}.get(platform.name, "x86_64"),
    }
    for wheel in installed:
        assert python in Requirement(f"python{wheel.metadata['Requires-Python'] or ''}").specifier
        for text in wheel.metadata.get_all("Requires-Dist") or []:
            need = Requirement(text)
            name = need.name.lower().replace("_", "-")
            if (need.marker is None or need.marker.evaluate(environment)) and name not in BLENDERS:
                assert need.specifier.contains(held[name]), f"{wheel.path.name} needs {text}"


def test_what_the_wheels_import_is_there(target, installed):
    modules = {name: text for wheel in installed for name, text in modules_of(wheel.path)}
    roots = {name.split(".")[0] for name in modules}
    known = roots | BLENDERS | sys.stdlib_module_names | {"annotationlib"}  # of Python 3.14, if it is that
    imported = set(IMPORTED) - set(MISSING.get(target[1], ()))
    wanted, seen = [*imported], set()
    while wanted:
        name = wanted.pop()
        assert name.split(".")[0] in known, name
        if name in modules and name not in seen:
            seen.add(name)
            wanted += imported_by(name, modules[name], modules)
    assert {"pyopencl._cl", "pytools.persistent_dict", "siphash24", *imported} <= seen


def modules_of(wheel: Path) -> Iterator[tuple[str, str]]:
    """Yield the modules of a wheel by dotted names, with their source; compiled ones have none."""
    with ZipFile(wheel) as archive:
        for path in map(Path, archive.namelist()):
            if path.suffix in {".py", ".so", ".pyd"} and ".libs" not in str(path):
                parts = (*path.parts[:-1], path.name.split(".")[0])
                name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
                yield name, archive.read(path.as_posix()).decode() if path.suffix == ".py" else ""


def imported_by(name: str, source: str, modules: dict[str, str]) -> list[str]:
    """Return what a module imports when it is imported itself, unless it goes on without."""
    statements, found = list(ast.parse(source).body), []
    package = name if is_package(name, modules) else name.rpartition(".")[0]
    for node in statements:
        if isinstance(node, ast.If) and "TYPE_CHECKING" not in ast.unparse(node.test):
            statements += node.body + node.orelse
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            up = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            origin = ".".join([*up, *([node.module] if node.module else [])])
            found += [origin, *(f"{origin}.{alias.name}" for alias in node.names)]
    return found


def is_package(name: str, modules: dict[str, str]) -> bool:
    return any(other.startswith(f"{name}.") for other in modules)


def test_the_licence_of_each_wheel_is_in_the_package(archive):
    texts = " ".join(
        archive.read(name).decode() for name in archive.namelist() if name.startswith("licenses/")
    )
    for name in (name for name in archive.namelist() if name.endswith(".whl")):
        with ZipFile(BytesIO(archive.read(name))) as wheel:
            inside = [path for path in wheel.namelist() if "/licenses/LICENSE" in path]
            metadata = next(path for path in wheel.namelist() if path.endswith(".dist-info/METADATA"))
            licence = wheel.read(metadata).decode()
        assert inside or ("Apache-2.0" in licence and "Apache License" in texts), name


def test_page_lists_every_package_and_wheel(wheels, packages):
    text = page(sorted(packages.values()), wheels)
    for path in (*packages.values(), *(wheel.path for wheel in wheels)):
        assert f"`{path.name}` | {path.stat().st_size:,} |" in text
    assert all(line.count("|") >= 4 for line in text.splitlines() if line.startswith("|"))
