"""Processes that build OpenCL programs: a driver may build one at a time in each."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from .opencl import cl

#: What runs in each process; a script, so that nothing else is imported there.
_SCRIPT = Path(__file__).with_name("build_programs.py")

#: Most processes; memory that the device has to have for any, and for each, bytes: they have contexts there.
_MOST, _LEAST_ROOM, _ROOM = 6, 4 << 30, 5 << 28

#: A program takes about so long, s, and one of this many characters a second more; that grows by its square.
_EACH, _LONG = 0.2, 60_000

#: A driver that hangs is not waited for any longer, s; nor does a process that was ended keep anybody.
_PATIENCE, _ENDING = 60.0, 2.0

#: Source and options of a program.
Program = tuple[str, Sequence[str]]


class Builders:
    """Builds programs in processes beside this one, until all are built or `stop`.

    device    whose programs they are
    programs  by name, in the order in which they will be asked for
    built     called in a thread with the name and the binary of each
    """

    def __init__(
        self, device: cl.Device, programs: Mapping[str, Program], built: Callable[[str, bytes], None]
    ) -> None:
        self._built, self._binaries = built, dict[str, bytes]()
        self._changed, self._owner = threading.Condition(), dict[str, subprocess.Popen[bytes]]()
        self._processes: list[subprocess.Popen[bytes]] = []
        for share in _shares(programs, _processes(device)):
            with suppress(OSError):
                self._start(device, {name: programs[name] for name in share})

    def binary(self, name: str) -> bytes | None:
        """Return the binary of a program once it is built; None if no process builds it, or it cannot."""
        process = self._owner.get(name)
        with self._changed:
            self._changed.wait_for(
                lambda: name in self._binaries or name not in self._owner, timeout=_PATIENCE
            )
            binary = self._binaries.pop(name, None)
        if binary is None and process is not None:
            process.kill()
        return binary

    def stop(self) -> None:
        """End the processes, and wait until they are gone."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)

    def _start(self, device: cl.Device, programs: Mapping[str, Program]) -> None:
        """Start a process, and a thread that takes what it builds; raises OSError if it cannot be started."""
        command = [sys.executable, "-s", "-P", str(_SCRIPT)]
        search_path = os.pathsep.join(path for path in sys.path if path)
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": search_path}, creationflags=_flags(),
        )  # fmt: skip
        self._processes.append(process)
        self._owner.update(dict.fromkeys(programs, process))
        request = {
            "platform": device.platform.name, "device": device.name,
            "programs": [[name, source, list(options)] for name, (source, options) in programs.items()],
        }  # fmt: skip
        arguments = process, json.dumps(request).encode(), list(programs)
        threading.Thread(target=self._follow, args=arguments, name="builders", daemon=True).start()

    def _follow(self, process: subprocess.Popen[bytes], request: bytes, names: Sequence[str]) -> None:
        """Take binaries from a process until it ends: the name and the size in a line, then the bytes."""
        assert process.stdin is not None and process.stdout is not None
        with suppress(OSError, ValueError):
            process.stdin.write(request)
            process.stdin.close()
            for line in process.stdout:
                name, size = line.split()
                binary = process.stdout.read(int(size))
                if len(binary) == int(size):
                    self._built(name.decode(), binary)
                    with self._changed:
                        self._binaries[name.decode()] = binary
                        self._changed.notify_all()
        process.stdout.close()
        process.wait()
        with self._changed:
            for left in names:
                self._owner.pop(left, None)
            self._changed.notify_all()


def _processes(device: cl.Device) -> int:
    """Return how many processes build for a device: none where they would take what it needs itself."""
    if device.global_mem_size < _LEAST_ROOM:
        return 0
    return min(_MOST, device.global_mem_size // _ROOM, (os.cpu_count() or 1) - 1)


def _shares(programs: Mapping[str, Program], count: int) -> list[list[str]]:
    """Return the names of the programs of each process, in the order of `programs`.

    The longest are dealt out first, each to whom least has been dealt (Graham 1969).
    """
    shares: list[list[str]] = [[] for _ in range(count)]
    seconds = [0.0] * count
    for name in sorted(programs, key=lambda name: -len(programs[name][0])) if count else ():
        least = seconds.index(min(seconds))
        shares[least].append(name)
        seconds[least] += _EACH + (len(programs[name][0]) / _LONG) ** 2
    order = list(programs)
    return [sorted(share, key=order.index) for share in shares if share]


def _flags() -> int:
    """Return the flags of a process without a console, less urgent than this one; Windows alone has any."""
    if sys.platform == "win32":
        return subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS
    return 0
