"""The engine is there without OpenGL and OpenCL; a bake names the package that is missing."""

import subprocess
import sys
from pathlib import Path

import pytest

from engine import DeviceError, Settings, finished
from engine.worker.worker import Worker
from tests.analytic.scenes import furnace

ROOT = Path(__file__).parents[2]
PACKAGES = ["moderngl", "glcontext", "pyopencl"]
REQUIRED = ["moderngl", "glcontext"]


def python(code: str, *search_path: Path) -> str:
    """Return the output of a new Python that searches modules in `search_path` first."""
    path = [str(folder) for folder in (*search_path, ROOT)]
    command = [sys.executable, "-c", f"import sys; sys.path[:0] = {path!r}\n{code}"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture(params=REQUIRED)
def without(request, tmp_path):
    """Return the name of a package, and a folder that makes it look as if it were not installed."""
    name = request.param
    (tmp_path / f"{name}.py").write_text(f"raise ModuleNotFoundError(\"No module named '{name}'\")\n")
    return name, tmp_path


def test_the_engine_and_its_worker_are_imported_without_gpu_packages():
    code = f"import engine.worker.child, engine.worker.worker\nprint({set(PACKAGES)} & sys.modules.keys())"
    assert python(code) == "set()"


def test_every_module_of_the_engine_is_imported_without_pyopencl():
    code = (
        "sys.modules['pyopencl'] = None\n"
        "import importlib, pkgutil, engine\n"
        "names = [module.name for module in pkgutil.walk_packages(engine.__path__, 'engine.')]\n"
        "script = 'engine.device.build_programs'\n"
        "print(len([importlib.import_module(name) for name in names if name != script]))"
    )
    assert int(python(code)) > 200


def test_attributes_of_pyopencl_wait_while_another_thread_imports_it(tmp_path):
    (tmp_path / "pyopencl.py").write_text("import time\ntime.sleep(0.3)\nBuffer = 7\n")
    code = (
        "import threading, time\n"
        "from engine.device.opencl import cl\n"
        "thread = threading.Thread(target=lambda: cl.Buffer)\n"
        "thread.start()\n"
        "while 'pyopencl' not in sys.modules:\n"
        "    time.sleep(0.01)\n"
        "print(cl.Buffer)"
    )
    assert python(code, tmp_path) == "7"


def test_a_bake_without_pyopencl_names_the_package_and_the_remedy():
    code = (
        "sys.modules['pyopencl'] = None\n"
        "from engine import Settings, bake, finished\n"
        "from tests.analytic.scenes import furnace\n"
        "settings = Settings(resolution=32, hemicube=16, max_bounces=64)\n"
        "baked = finished(bake(furnace(0.5, 1.0), settings))\n"
        "print(float(baked.image[baked.has_patch].mean()), *baked.report.warnings)"
    )
    mean, text = python(code).split(maxsplit=1)
    assert float(mean) == pytest.approx(2.0, rel=0.02)
    assert "'pyopencl'" in text and f"{sys.executable} -m pip install pyopencl" in text


def test_a_bake_is_a_function_of_the_package_also_after_a_bake():
    code = (
        "import engine\n"
        "from tests.analytic.scenes import furnace\n"
        "settings = engine.Settings(resolution=8, hemicube=8, max_bounces=1)\n"
        "for _ in range(2): print(engine.finished(engine.bake(furnace(0.5, 1.0), settings)).image.shape)"
    )
    assert python(code).splitlines() == ["(1, 8, 8, 3)"] * 2


def test_a_bake_in_this_process_names_the_missing_package_and_the_remedy(without):
    name, folder = without
    code = (
        "from engine import DeviceError, Settings, bake, finished\n"
        "from tests.analytic.scenes import furnace\n"
        "try: finished(bake(furnace(0.5, 1.0), Settings()))\n"
        "except DeviceError as error: print(error)"
    )
    text = python(code, folder)
    assert f"'{name}'" in text and f"{sys.executable} -m pip install {name}" in text


def test_a_bake_in_the_worker_names_the_missing_package_and_the_remedy(without):
    name, folder = without
    worker = Worker(search_path=[str(folder), *sys.path])
    try:
        with pytest.raises(DeviceError, match=f"'{name}'.*pip install {name}"):
            finished(worker.bake(furnace(0.5, 1.0), Settings()))
    finally:
        worker.stop()
