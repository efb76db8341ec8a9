"""File cache of built OpenCL programs: each source is built once for each device.

PyOpenCL leaves caching to NVIDIA's driver and its own settings. PoCL caches kernels in its own
files; in addition, an empty file records that the kernels of a program were compiled for its launches.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from ..json_file import read_json, write_json
from .builders import Builders, Program
from .opencl import cl

#: Threads that load cached programs, and maximum number of cached programs for each device.
_THREADS, _MOST = 4, 96

#: Minimum number of missing programs for which builder processes are started, on GPUs and with PoCL.
_MIN_GPU, _MIN_POCL = 8, 3

#: Number of programs that this process builds itself, the first ones, while builder processes start.
_OWN = 3

#: Size of a program's checksum, bytes.
_CHECKSUM = 16

#: File of the build pace of each device, as a multiple of the expected duration.
_PACES = "build_paces.json"


class Preparation(NamedTuple):
    """Progress of the programs that other processes build for a device.

    done, total:   numbers of programs
    seconds_left:  estimated remaining time
    """

    done: int
    total: int
    seconds_left: float


class ProgramCache:
    """Program cache of a device; `open` binds it to a context.

    folder:        folder with a subfolder for each device and driver; None for no cache
    keeps_itself:  True for PoCL, which caches compiled kernels itself
    """

    def __init__(self, device: cl.Device, folder: str | None, keeps_itself: bool = False) -> None:
        self._device, self._keeps_itself = device, keeps_itself
        self._paces = None if folder is None else Path(folder) / _PACES
        self._folder = None if folder is None else Path(folder) / device_digest(device)
        self._files, self._loading = _newest(self._folder), dict[str, Future[cl.Program]]()
        self._known, self._builders = {path.name for path in self._files}, list[Builders]()
        self._file_names = dict[str, str]()

    def open(self, context: cl.Context) -> None:
        """Set the device's context and load cached programs in threads.

        Building does not hold Python's global lock.
        """
        self._context = context
        if self._files and not self._keeps_itself:
            threads = ThreadPoolExecutor(_THREADS, "programs")
            self._loading = {path.name: threads.submit(self._load, path) for path in self._files}
            threads.shutdown(wait=False)

    def build(self, source: str, options: Sequence[str] = ()) -> cl.Program:
        """Return a program, from the cache or built from source; raises cl.Error."""
        name = program_name(source, options)
        self._known.add(self._file_name(name))
        if name in self._loading:
            with suppress(cl.Error, OSError):
                program = self._loading.pop(name).result()
                self._mark(name)
                return program
        program = self._built_ahead(name)
        if program is None:
            program = build(self._context, source, options)
            self._store(name, program)
        return program

    def begin(self, programs: Iterable[Program]) -> set[str]:
        """Start to build programs in other processes, before `build` needs them.

        The first programs of a GPU are left to this process, since it would only wait for the others to
        start. Small numbers are left to it too. Returns the names of the programs left to this process.

        programs:  programs in the order of need
        """
        named = {program_name(program.source, program.options): program for program in programs}
        self._file_names.update({name: file_name(program) for name, program in named.items()})
        missing = {name: named[name] for name in named if self._file_name(name) not in self._known}
        self._known.update(map(self._file_name, missing))
        if self._folder is None or len(missing) < (_MIN_POCL if self._keeps_itself else _MIN_GPU):
            return set() if self._keeps_itself else set(missing)
        others = missing if self._keeps_itself else dict(list(missing.items())[_OWN:])
        pace = self._read_paces().get(self._key, 1.0)
        self._builders.append(Builders(self._device, others, self._keep, pace))
        return missing.keys() - others.keys()

    def preparation(self, wanted: set[str]) -> Preparation | None:
        """Return the progress of all builds in other processes; None once the wanted ones have ended.

        wanted:  names of programs, see `program_name`
        """
        if not any(wanted & builders.pending for builders in self._builders):
            return None
        total = sum(len(builders.names) for builders in self._builders)
        done = total - sum(len(builders.pending) for builders in self._builders)
        return Preparation(done, total, max(builders.seconds_left for builders in self._builders))

    def keep_pace(self) -> None:
        """Record the pace of finished builds, for the next estimate on this device."""
        ended = [builders for builders in self._builders if builders.names and not builders.pending]
        if self._paces is not None and ended:
            with suppress(OSError):
                paces = {**self._read_paces(), self._key: ended[-1].pace}
                write_json(self._paces, paces)

    def _file_name(self, name: str) -> str:
        """Return the file name of a program by its name."""
        return self._file_names.get(name, name)

    @property
    def _key(self) -> str:
        """Key of the device in the file of build paces, independent of the driver version."""
        return f"{self._device.platform.name}: {self._device.name}"

    def _read_paces(self) -> dict[str, float]:
        """Return the build paces of devices by name; empty if the file is missing or damaged."""
        paces = read_json(self._paces).items()
        return {name: pace for name, pace in paces if isinstance(pace, float) and math.isfinite(pace)}

    def stop(self) -> None:
        """Stop all builds in other processes."""
        for builders in self._builders:
            builders.stop()

    def _built_ahead(self, name: str) -> cl.Program | None:
        """Return a program that another process has built or is building; None if there is none."""
        for builders in self._builders:
            binary = builders.binary(name)
            if binary:
                with suppress(cl.Error):
                    return cl.Program(self._context, [self._device], [binary]).build()
        return None

    def _load(self, path: Path) -> cl.Program:
        """Return the program of a file; raise cl.Error or OSError if it is damaged or of another device.

        The checksum is tested first, since a driver may crash on a damaged binary.
        """
        content = path.read_bytes()
        checksum, binary = content[:_CHECKSUM], content[_CHECKSUM:]
        if checksum != _checksum(binary):
            raise OSError(f"'{path}' is damaged")
        return cl.Program(self._context, [self._device], [binary]).build()

    def _mark(self, name: str) -> None:
        """Update the time stamp of a program; programs that are unused for long are removed."""
        if self._folder is not None:
            with suppress(OSError):
                os.utime(self._folder / name)

    def _store(self, name: str, program: cl.Program) -> None:
        """Store a program; errors are ignored. The file is written atomically."""
        if self._folder is not None and not self._keeps_itself:
            with suppress(cl.Error):
                self._keep(name, program.get_info(cl.program_info.BINARIES)[0])

    def _keep(self, name: str, binary: bytes) -> None:
        """Write a program's binary to its file; ignore errors. The write is atomic."""
        if self._folder is None:
            return
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            partial = self._folder / f".{name}.{os.getpid()}"
            partial.write_bytes(_checksum(binary) + binary if binary else b"")
            partial.replace(self._folder / self._file_name(name))


def marks_folder(cache_dir: str | None) -> str | None:
    """Return the folder for the files that mark kernels in PoCL's cache; None without `cache_dir`.

    It is inside PoCL's cache, so that kernels and marks are shared and removed together. Its path follows
    lib/CL/pocl_cache.c of PoCL 3 to 7. On Windows it is `cache_dir`.
    """
    if cache_dir is None or sys.platform == "win32":
        return cache_dir
    home = os.environ.get("HOME")
    caches = os.environ.get("XDG_CACHE_HOME") or (f"{home}/.cache" if home else "/tmp")
    kernels = os.environ.get("POCL_CACHE_DIR") or f"{caches}/pocl/kcache"
    return f"{kernels}/hemibake"


def program_name(source: str, options: Sequence[str]) -> str:
    """Return the name of a program: a hash of its source and options."""
    return hashlib.blake2b("\0".join([source, *options]).encode(), digest_size=20).hexdigest()


def file_name(program: Program) -> str:
    """Return the file name of a program: a hash of its source, options and launches.

    PoCL compiles a kernel for each kind of launch, so other launches need another build. PoCL stores the
    binary itself; the file of a program with launches is empty.
    """
    launches = () if program.launches is None else [json.dumps(program.launches)]
    return program_name(program.source, [*program.options, *launches])


def build(context: cl.Context, source: str, options: Sequence[str] = ()) -> cl.Program:
    """Return a program built from source without PyOpenCL's cache; raises cl.Error."""
    return cl.Program(context, source).build(list(options), cache_dir=False)


def _checksum(binary: bytes) -> bytes:
    """Return the checksum at the start of a program file."""
    return hashlib.blake2b(binary, digest_size=_CHECKSUM).digest()


def _newest(folder: Path | None) -> list[Path]:
    """Return the most recently used programs in a folder; remove the others."""
    if folder is None or not folder.is_dir():
        return []
    with suppress(OSError):
        files = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in files[_MOST:]:
            path.unlink(missing_ok=True)
        return [path for path in files[:_MOST] if not path.name.startswith(".")]
    return []


def device_digest(device: cl.Device) -> str:
    """Return a hash of everything that determines a device's binaries, except the source."""
    platform = device.platform
    facts = (
        platform.vendor, platform.name, platform.version, device.vendor, device.name, device.version,
        device.driver_version,
    )  # fmt: skip
    return hashlib.blake2b("\0".join(facts).encode(), digest_size=10).hexdigest()
