"""A window of Blender with Hemibake's package, on a virtual screen."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from .machines import Machine
from .processes import cpu_seconds
from .screen import difference, read_screen

#: Size of the screen, pixels.
WIDTH, HEIGHT = 1400, 900

#: Longest time until Blender answers, s: software draws it, and other processes may be at work.
_PATIENCE = 900.0

#: Time in which Blender must compute little to count as idle, s.
_QUIET = 3.0

#: Fraction of a CPU that Blender uses at most while it is idle (chosen).
_BUSY = 0.1

_INSIDE = Path(__file__).with_name("inside.py")


class Window:
    """Blender on a screen of its own; a context manager ends both.

    machine      the system whose Blender it is
    package      Hemibake's package for it
    is_new       True for a new user: no package installed, no network, no cached kernels
    environment  further environment variables
    """

    def __init__(
        self,
        machine: Machine,
        package: Path,
        is_new: bool = False,
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._machine = machine
        self._folder = machine.new_folder()
        self._outside = machine.outside(self._folder)
        self._programs: list[subprocess.Popen] = []
        self._is_new = is_new
        for file in (package, _INSIDE):
            shutil.copy(file, self._outside)
        self._package = self._folder / package.name
        self._environment = {
            "PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin",
            "HOME": str(self._folder),
            "TMPDIR": str(self._folder),
            "LANG": "C.UTF-8",
            "XDG_RUNTIME_DIR": str(self._folder),
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "POCL_CACHE_DIR": str(self._folder / "kernels") if is_new else "/tmp/hemibake-kernels",
            "BLENDER_GUI": str(self._folder),
            **environment,
        }

    def __enter__(self) -> Window:
        try:
            self._environment["DISPLAY"] = f":{self._start_screen()}"
            if not self._is_new:
                install = ("extension", "install-file", "--repo", "user_default", "--enable")
                self.command("blender", "--command", *install, str(self._package))
            self._start_blender()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for program in reversed(self._programs):
            os.killpg(program.pid, signal.SIGKILL)
            program.wait()
        shutil.rmtree(self._outside, ignore_errors=True)

    @property
    def folder(self) -> Path:
        """Path of the folder for files, as seen by Blender."""
        return self._folder

    @property
    def package(self) -> Path:
        """The package, as Blender sees it."""
        return self._package

    @property
    def cpu_seconds(self) -> float:
        """CPU seconds of Blender and its child processes."""
        return cpu_seconds(self._programs[-1].pid)

    def run(self, code: str) -> Any:
        """Run Python code in Blender between two events; return the argument of its call of `answer`."""
        reply = self._outside / "answer.json"
        reply.unlink(missing_ok=True)
        question = self._outside / "question.tmp"
        question.write_text(code)
        question.replace(self._outside / "question.py")
        wait_until(lambda: self._is_alive() and reply.exists(), "Blender answers")
        answer = json.loads(reply.read_text())
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer["value"]

    def ask(self, expression: str) -> Any:
        """Return the value of an expression in Blender."""
        return self.run(f"answer = {expression}")

    def wait_for(self, expression: str) -> None:
        """Wait until an expression is true."""
        wait_until(lambda: self.ask(f"bool({expression})"), expression)

    def command(self, *command: str) -> str:
        """Run a program to its end and return its standard output; raises RuntimeError if it fails."""
        ended = subprocess.run(
            self._machine.command(*command), env=self._environment, capture_output=True, text=True
        )
        if ended.returncode:
            raise RuntimeError(f"{' '.join(command)}:\n{ended.stdout}{ended.stderr}")
        return ended.stdout

    def move(self, x: float, y: float) -> None:
        """Move the pointer to a pixel, counted from the top left."""
        self.command("xdotool", "mousemove", str(round(x)), str(round(y)))

    def move_second_window(self, x: int, y: int) -> None:
        """Move the second window to a pixel of the screen, counted from the top left."""
        self.command(
            "xdotool", "search", "--onlyvisible", "--class", "blender", "windowmove", "%2", str(x), str(y)
        )

    def click(self, x: float, y: float) -> None:
        """Click a pixel, after Blender has noticed the pointer there."""
        self.move(x, y)
        self._settle()
        self.command("xdotool", "click", "1")

    def key(self, keys: str) -> None:
        """Press keys, such as "ctrl+z"; they go to the editor below the pointer."""
        self.command("xdotool", "key", keys)

    def picture(self) -> np.ndarray:
        """Return a screenshot after everything is drawn, (h, w, 3) uint8, top row first."""
        self.run("redraw()")
        self._settle()
        return self.screen()

    def screen(self) -> np.ndarray:
        """Return what the screen shows now; see `picture`."""
        return read_screen(self._outside / "Xvfb_screen0")

    def still_picture(self, idle: bool = False) -> np.ndarray:
        """Return a screenshot after nothing changes any more, so that renders are finished.

        idle: True to wait first until Blender computes nothing, such as shaders of materials
        """
        if idle:
            wait_until(self._is_idle, "Blender has nothing to do")
        before, same = self.picture(), 0
        while same < 5:
            now = self.picture()
            same = same + 1 if (now == before).all() else 0
            before = now
        return before

    def button(self, changed: str, restored: str) -> tuple[float, float]:
        """Return the middle of a button: where the sidebar differs after code that changes its looks."""
        self.move(*self.middle())
        before = self.picture()
        self.run(changed)
        after = self.picture()
        self.run(f"{restored}\nredraw()")
        self._settle()
        box = difference(before, after, self.ask("rectangle('UI')"))
        if box is None:
            raise RuntimeError("The sidebar does not show the button.")
        left, top, right, bottom = box
        return (left + right) / 2, (top + bottom) / 2

    def middle(self) -> tuple[float, float]:
        """Return the middle of the 3D view, left of the sidebar."""
        left, top, _, bottom = self.ask("rectangle()")
        return (left + self.ask("rectangle('UI')[0]")) / 2, (top + bottom) / 2

    def console(self) -> str:
        """Return the output of Blender."""
        return (self._outside / "console.txt").read_text(errors="replace")

    def _is_idle(self) -> bool:
        """Return True if Blender and its child processes used little of a CPU in the last seconds.

        Other processes may leave them little, so the limit is low.
        """
        before = self.cpu_seconds
        time.sleep(_QUIET)
        return self.cpu_seconds - before < _BUSY * _QUIET

    def _settle(self) -> None:
        """Let Blender handle events and draw: it answers between two of its rounds."""
        for _ in range(3):
            self.run("")
            time.sleep(0.1)

    def _start_screen(self) -> int:
        """Start an X server; return the display number that it chose."""
        size = f"{WIDTH}x{HEIGHT}x24"
        picture = ("-fbdir", str(self._folder))
        command = ("Xvfb", "-displayfd", "1", "-screen", "0", size, "-nolisten", "tcp", *picture)
        server = self._start(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        number = server.stdout.readline().strip()
        if not number:
            raise RuntimeError("The X server has not started.")
        return int(number)

    def _start_blender(self) -> None:
        place = ("-p", "0", "0", str(WIDTH), str(HEIGHT))
        with (self._outside / "console.txt").open("w") as console:
            script = ("--python", str(self._folder / _INSIDE.name))
            self._start(("blender", *place, *script), stdout=console, stderr=subprocess.STDOUT)
        self.run("")

    def _start(self, command: tuple[str, ...], **pipes: Any) -> subprocess.Popen:
        """Start a program as a group of processes, which `__exit__` ends."""
        ends_with_this_process = ("setpriv", "--pdeathsig", "KILL")
        without_network = ("unshare", "--net") if self._is_new else ()
        program = subprocess.Popen(
            [*ends_with_this_process, *without_network, *self._machine.command(*command)],
            env=self._environment,
            start_new_session=True,
            text=True,
            **pipes,
        )
        self._programs.append(program)
        return program

    def _is_alive(self) -> bool:
        """Return True while Blender runs; raises RuntimeError with what it printed once it has ended."""
        if self._programs[-1].poll() is not None:
            raise RuntimeError(f"Blender has ended:\n{self.console()[-3000:]}")
        return True


def wait_until(happens: Callable[[], bool], what: str) -> None:
    """Wait until something happens; raises TimeoutError if it does not for minutes."""
    limit = time.monotonic() + _PATIENCE
    while not happens():
        if time.monotonic() > limit:
            raise TimeoutError(f"Not within {_PATIENCE:.0f} s: {what}")
        time.sleep(0.05)
