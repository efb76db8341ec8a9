"""Blender installations of this machine, without the packages of the tests."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]

#: The environments of Blender as a Python module.
_ENVIRONMENTS = (".venv-bpy42", ".venv-bpy45", ".venv", ".venv-bpy51", ".venv-bpy52")

#: Prints paths of the module and of the packages that it needs, in its environment.
_PACKAGES_OF_BPY = """
import json, re
from importlib.metadata import PackageNotFoundError, distribution
names, paths = ["bpy"], []
for name in names:
    try: found = distribution(name)
    except PackageNotFoundError: continue
    needs = [need for need in found.requires or [] if "extra" not in need]
    names += [need for need in (re.match(r"[\\w.-]+", need)[0] for need in needs) if need not in names]
    tops = {file.parts[0] for file in found.files} - {"..", "__pycache__"}
    paths += [str(found.locate_file(top)) for top in tops]
print(json.dumps(sorted(set(paths))))
"""


@dataclass(frozen=True)
class Blender:
    """A Blender to start.

    command:  what starts it with the script of a session, without the session's arguments
    path:     of Python modules, None for those of a Blender program
    """

    command: tuple[str, ...]
    path: str | None

    def run(self, user: Path, *steps: tuple, driver: str | None = None) -> list:
        """Do the steps of a session with a user folder and no network; return their answers.

        driver:  folder of OpenCL drivers' .icd files, None for those of this machine
        """
        user.mkdir(parents=True, exist_ok=True)
        answers = user.parent / f"{user.name}.json"
        answers.unlink(missing_ok=True)
        command = [*_no_network(), *self.command, json.dumps(steps), str(answers)]
        ended = subprocess.run(
            command, env=self._environment(user, driver), capture_output=True, text=True, timeout=300
        )
        assert answers.exists(), f"{ended.stdout}\n{ended.stderr}"
        answer = json.loads(answers.read_text())
        assert answer["network"] == []
        return answer["steps"]

    def _environment(self, user: Path, driver: str | None) -> dict[str, str]:
        """Return the environment of a person who has nothing but this Blender."""
        hidden = ("PYTHON", "BLENDER", "XDG", "VIRTUAL_ENV")
        environment = {key: value for key, value in os.environ.items() if not key.startswith(hidden)}
        environment |= {
            "HOME": str(user),
            "USERPROFILE": str(user),
            "BLENDER_USER_RESOURCES": str(user / "blender"),
            # What drivers keep of shaders and kernels is theirs, whoever had them built.
            "POCL_CACHE_DIR": str(user.parents[1] / "pocl-cache"),
            "MESA_SHADER_CACHE_DIR": str(user.parents[1] / "mesa-cache"),
        }
        if self.path:
            environment["PYTHONPATH"] = self.path
        if driver:
            environment["OCL_ICD_VENDORS"] = driver
        return environment


def installed() -> list[str]:
    """Return where the Blenders of this machine are: environments of the checkout, and a program."""
    program = os.environ.get("BLENDER") or shutil.which("blender")
    environments = [name for name in _ENVIRONMENTS if (ROOT / name / ".ready").exists()]
    return [*environments, *([program] if program else [])]


def blender_of(path: str, folder: Path) -> Blender:
    """Return a Blender of `installed`; links to the packages that it needs go to a folder."""
    return _module(ROOT / path, folder) if path in _ENVIRONMENTS else _program(path)


def _module(environment: Path, folder: Path) -> Blender:
    """Return Blender as a module of an environment, whose other packages are not to be found."""
    python = environment / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    printed = subprocess.run([python, "-c", _PACKAGES_OF_BPY], capture_output=True, text=True, check=True)
    for path in map(Path, json.loads(printed.stdout)):
        (folder / path.name).symlink_to(path)
    return Blender((str(python), "-S", "-s", str(_session())), str(folder))


def _program(program: str) -> Blender:
    """Return the Blender of a path."""
    options = ("-b", "--python-exit-code", "1", "--python", str(_session()), "--")
    return Blender((program, *options), None)


def _session() -> Path:
    return Path(__file__).with_name("session.py")


def _no_network() -> list[str]:
    """Return the command that takes the network from another command, where the system permits that."""
    for command in (["unshare", "-n"], ["unshare", "-rn"]):
        if (
            shutil.which("unshare")
            and subprocess.run([*command, "true"], capture_output=True).returncode == 0
        ):
            return command
    return []
