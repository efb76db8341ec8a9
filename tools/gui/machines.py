"""Blender, X server and mouse for window tests: a Debian trixie in a folder, or this machine."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

#: Where Debian goes if the environment does not say; Debian's release.
_FOLDER, _RELEASE = Path("/var/cache/hemibake/trixie"), "trixie"

#: The programs of a window, and Debian's packages of them and of OpenGL and OpenCL on the processor.
_PROGRAMS = ("blender", "Xvfb", "xdotool")
_PACKAGES = (
    "blender", "python3-numpy", "xvfb", "xdotool",
    "libegl1", "libgl1-mesa-dri", "libglx-mesa0", "pocl-opencl-icd",
)  # fmt: skip

#: Maximum number of runs of debootstrap, which stops at a failed download and keeps the earlier ones.
_TRIES = 3

#: Runs a command in a folder with a system's own file systems; they go with the command's mount namespace.
_ENTER = """
set -e; root=$1; shift
mount --rbind /dev "$root/dev"
mount --rbind /sys "$root/sys"
mount -t proc proc "$root/proc"
exec chroot "$root" "$@"
"""


class MissingError(Exception):
    """Raised if a requirement of the window is missing."""


@dataclass(frozen=True)
class Machine:
    """A system to start programs in.

    root  its folder, / for this machine
    """

    root: Path

    def command(self, *arguments: str) -> list[str]:
        """Return the command that starts a program in the machine."""
        if self.root == Path("/"):
            return list(arguments)
        enter = ("unshare", "--mount", "--propagation", "private", "sh", "-c", _ENTER, "sh", str(self.root))
        return [*enter, *arguments]

    def outside(self, path: Path) -> Path:
        """Return where this process finds a path of the system."""
        return self.root / path.relative_to("/")

    def new_folder(self) -> Path:
        """Make an empty folder and return its path in the system."""
        made = Path(tempfile.mkdtemp(prefix="hemibake-gui-", dir=self.root / "tmp"))
        return Path("/") / made.relative_to(self.root)


def find_machine() -> Machine:
    """Return a system with all programs, as root made where it is missing; raises MissingError.

    HEMIBAKE_GUI_ROOT names the folder of Debian.
    """
    root = Path(os.environ.get("HEMIBAKE_GUI_ROOT", _FOLDER))
    if os.geteuid() == 0 and _may_mount():
        if not _is_complete(root):
            _install(root)
        return Machine(root)
    missing = [program for program in _PROGRAMS if not shutil.which(program)]
    if missing:
        raise MissingError(
            f"A window of Blender needs {', '.join(missing)} here, or the rights to mount and to change the "
            f"root folder: then Debian {_RELEASE} with all of it is made in {root} (about 2.2 GB)."
        )
    return Machine(Path("/"))


def _may_mount() -> bool:
    """Return whether a mount namespace of its own is permitted."""
    if not shutil.which("unshare"):
        return False
    command = ["unshare", "--mount", "--propagation", "private", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return subprocess.run(command, capture_output=True).returncode == 0


def _is_complete(root: Path) -> bool:
    return all((root / "usr" / "bin" / program).exists() for program in _PROGRAMS)


def _install(root: Path) -> None:
    """Make Debian in a folder; one that is not finished has another name."""
    if not shutil.which("debootstrap"):
        _install_debootstrap()
    unfinished = root.with_name(f"{root.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    print(f"Making Debian {_RELEASE} with Blender in {root}, about 2.2 GB.", flush=True)
    options = ("--variant=minbase", f"--include={','.join(_PACKAGES)}")
    command = ["debootstrap", *options, _RELEASE, str(unfinished)]
    for _ in range(_TRIES):
        ended = subprocess.run(command, capture_output=True, text=True)
        if ended.returncode == 0:
            unfinished.rename(root)
            return
    raise MissingError(f"debootstrap has failed:\n{ended.stdout[-2000:]}{ended.stderr[-2000:]}")


def _install_debootstrap() -> None:
    if not shutil.which("apt-get"):
        raise MissingError("debootstrap is missing: install it, or Blender, Xvfb and xdotool.")
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for step in (["update", "-qq"], ["install", "-y", "-qq", "--no-install-recommends", "debootstrap"]):
        ended = subprocess.run(["apt-get", *step], env=environment, capture_output=True, text=True)
        if ended.returncode:
            raise MissingError(f"debootstrap is missing and apt-get cannot install it:\n{ended.stderr}")
