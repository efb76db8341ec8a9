"""Builder processes for OpenCL programs; a driver often builds only one program at a time in each process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from .opencl import cl
from .planned_program import Launch

#: Script of each process; it imports nothing of the engine.
_SCRIPT = Path(__file__).with_name("build_programs.py")

#: Maximum number of processes; device memory in bytes that is required for any process, and for each, since
#: each opens a context.
_MOST, _LEAST_ROOM, _ROOM = 6, 4 << 30, 5 << 28

#: Expected build time of a program by a GPU driver: seconds for each program, and the source length in
#: characters at which the length adds one second, quadratically. Measured on an H100.
_EACH, _LONG = 0.2, 60_000

#: Expected CPU seconds of PoCL for each program and each of its kernels, and source length in characters that
#: adds one second. Fitted to all common programs with PoCL 6.0 on an EPYC; RMS error 0.18 s.
_PARSED, _COMPILED, _PARSED_SOURCE = 0.06, 0.08, 62_000

#: Weight of the prior in the estimate of the build speed: the pace of earlier builds counts as much as this
#: many expected seconds of finished builds.
_PRIOR = 2.0

#: Seconds to wait for a driver that hangs, and for the end of a process after it was killed.
_PATIENCE, _ENDING = 60.0, 2.0


class Program(NamedTuple):
    """Source and options of a program, and launches of its kernels if PoCL caches them, else None."""

    source: str
    options: Sequence[str]
    launches: Sequence[Launch] | None = None


class Builders:
    """Builds programs in other processes, until all are built or `stop` is called.

    device:    device for which programs are built
    programs:  programs by name, in the order in which a bake needs them
    built:     called in a thread with name and binary of each program; the binary is empty for programs with
               launches
    pace:      duration of earlier builds as a multiple of the expected one
    """

    def __init__(
        self,
        device: cl.Device,
        programs: Mapping[str, Program],
        built: Callable[[str, bytes], None],
        pace: float = 1.0,
    ) -> None:
        self._built, self._binaries = built, dict[str, bytes]()
        self._changed, self._owner = threading.Condition(), dict[str, subprocess.Popen[bytes]]()
        self._processes: list[subprocess.Popen[bytes]] = []
        self._costs = {name: _cost(program) for name, program in programs.items()}
        self._start_time, self._pace, self._done = time.perf_counter(), pace, set[str]()
        for share in _shares(programs, _processes(device)):
            with suppress(OSError):
                self._start(device, {name: programs[name] for name in share})

    @property
    def names(self) -> set[str]:
        """Names of the programs that processes build or have built."""
        with self._changed:
            return self._done | self._owner.keys()

    @property
    def pending(self) -> set[str]:
        """Names of the programs that are not built yet."""
        with self._changed:
            return self._owner.keys() - self._done

    @property
    def pace(self) -> float:
        """Duration of the builds as a multiple of the expected one; initially the pace of earlier builds."""
        done = sum(self._costs[name] for name in self.names - self.pending) / max(1, len(self._processes))
        elapsed = time.perf_counter() - self._start_time
        return (elapsed + _PRIOR * self._pace) / (done + _PRIOR) if done else self._pace

    @property
    def seconds_left(self) -> float:
        """Estimated seconds until all programs are built."""
        left = sum(self._costs[name] for name in self.pending)
        return left * self.pace / max(1, len(self._processes))

    def binary(self, name: str) -> bytes | None:
        """Return the binary of a program once it is built; None if no process builds it or it fails."""
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
        """Kill the processes and wait for their end."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(_ENDING)

    def _start(self, device: cl.Device, programs: Mapping[str, Program]) -> None:
        """Start a process and a thread that receives its binaries; raises OSError."""
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
            "programs": [[name, *program] for name, program in programs.items()],
        }  # fmt: skip
        arguments = process, json.dumps(request).encode(), list(programs)
        threading.Thread(target=self._follow, args=arguments, name="builders", daemon=True).start()

    def _follow(self, process: subprocess.Popen[bytes], request: bytes, names: Sequence[str]) -> None:
        """Receive binaries from a process until it ends: a line with name and size, then the bytes."""
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
                        self._done.add(name.decode())
                        self._changed.notify_all()
        process.stdout.close()
        process.wait()
        with self._changed:
            for left in names:
                self._owner.pop(left, None)
            self._changed.notify_all()


def _processes(device: cl.Device) -> int:
    """Return the number of processes for a device; 0 if they would take memory that a bake needs.

    For a CPU it is one for each core, since this process waits. For a GPU one core is left to this process.
    """
    if device.global_mem_size < _LEAST_ROOM:
        return 0
    cores = os.cpu_count() or 1
    if device.type & cl.device_type.CPU:
        return min(_MOST, cores)
    return min(_MOST, device.global_mem_size // _ROOM, cores - 1)


def _cost(program: Program) -> float:
    """Return the expected build time of a program in seconds."""
    if program.launches is None:
        return _EACH + (len(program.source) / _LONG) ** 2
    return _PARSED + _COMPILED * len(program.launches) + len(program.source) / _PARSED_SOURCE


def _shares(programs: Mapping[str, Program], count: int) -> list[list[str]]:
    """Return the names of the programs of each process, in the order of `programs`.

    Assigns each program to the process with the least work, the longest first (LPT scheduling, Graham 1969).
    Programs with launches keep their order, since a bake waits for the first ones.
    """
    shares: list[list[str]] = [[] for _ in range(count)]
    seconds = [0.0] * count
    in_order = all(program.launches is not None for program in programs.values())
    names = list(programs) if in_order else sorted(programs, key=lambda name: -len(programs[name].source))
    for name in names if count else ():
        least = seconds.index(min(seconds))
        shares[least].append(name)
        seconds[least] += _cost(programs[name])
    order = list(programs)
    return [sorted(share, key=order.index) for share in shares if share]


def _flags() -> int:
    """Return the creation flags of a low-priority process without console; 0 except on Windows."""
    if sys.platform == "win32":
        return subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS
    return 0
