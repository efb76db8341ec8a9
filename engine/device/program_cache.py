"""Built OpenCL programs, kept in files: a device builds each source once, whichever process asks for it.

PyOpenCL leaves that to NVIDIA's driver, which does it as its own settings say.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from .builders import Builders
from .opencl import cl

#: Threads that load programs of earlier processes, and the most programs that are kept of a device.
_THREADS, _MOST = 4, 96

#: So many programs are worth processes of their own, which leave the first ones to this one.
_MANY, _OWN = 8, 3

#: Bytes of the checksum of a program.
_CHECKSUM = 16


class ProgramCache:
    """The programs of a device; of a context of it once that is given by `open`.

    folder  where programs are kept, in a folder for each device and driver; None keeps none
    """

    def __init__(self, device: cl.Device, folder: str | None) -> None:
        self._device = device
        self._folder = None if folder is None else Path(folder) / device_digest(device)
        self._files, self._loading = _newest(self._folder), dict[str, Future[cl.Program]]()
        self._known, self._builders = {path.name for path in self._files}, list[Builders]()

    def open(self, context: cl.Context) -> None:
        """Take the device's context, and load the programs of earlier processes.

        Threads do that at once: building does not hold Python's lock.
        """
        self._context = context
        if self._files:
            threads = ThreadPoolExecutor(_THREADS, "programs")
            self._loading = {path.name: threads.submit(self._load, path) for path in self._files}
            threads.shutdown(wait=False)

    def build(self, source: str, options: Sequence[str] = ()) -> cl.Program:
        """Return a program of some source, ready for kernels; raises cl.Error if it cannot be built."""
        name = _name(source, options)
        self._known.add(name)
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

    def begin(self, programs: Iterable[tuple[str, Sequence[str]]]) -> None:
        """Begin to build what `build` will be asked for in other processes, where these can keep it.

        programs: source and options of each, in the order in which they will be asked for. The first ones are
        left to this process, which would wait for others to start; so are few.
        """
        named = {_name(source, options): (source, options) for source, options in programs}
        missing = {name: named[name] for name in named if name not in self._known}
        self._known.update(missing)
        if self._folder is not None and len(missing) >= _MANY:
            others = dict(list(missing.items())[_OWN:])
            self._builders.append(Builders(self._device, others, self._keep))

    def stop(self) -> None:
        """Have nothing built ahead any more."""
        for builders in self._builders:
            builders.stop()

    def _built_ahead(self, name: str) -> cl.Program | None:
        """Return a program that another process has built, or is building; None if none does."""
        for builders in self._builders:
            binary = builders.binary(name)
            if binary is not None:
                with suppress(cl.Error):
                    return cl.Program(self._context, [self._device], [binary]).build()
        return None

    def _load(self, path: Path) -> cl.Program:
        """Return the program of a file; raises cl.Error or OSError if it is none of this device, or damaged.

        A driver may crash on a binary that is not whole, so that its checksum is looked at before.
        """
        content = path.read_bytes()
        checksum, binary = content[:_CHECKSUM], content[_CHECKSUM:]
        if checksum != _checksum(binary):
            raise OSError(f"'{path}' is damaged")
        return cl.Program(self._context, [self._device], [binary]).build()

    def _mark(self, name: str) -> None:
        """Note that a program is in use: those that are not for long are removed."""
        if self._folder is not None:
            with suppress(OSError):
                os.utime(self._folder / name)

    def _store(self, name: str, program: cl.Program) -> None:
        """Keep a program; a folder that cannot be written stops nothing. Under its name a file is whole."""
        if self._folder is not None:
            with suppress(cl.Error):
                self._keep(name, program.get_info(cl.program_info.BINARIES)[0])

    def _keep(self, name: str, binary: bytes) -> None:
        """Write the file of a program, as `_store`."""
        if self._folder is None:
            return
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            partial = self._folder / f".{name}.{os.getpid()}"
            partial.write_bytes(_checksum(binary) + binary)
            partial.replace(self._folder / name)


def _name(source: str, options: Sequence[str]) -> str:
    """Return the name of a program: a digest of all that it is built from."""
    return hashlib.blake2b("\0".join([source, *options]).encode(), digest_size=20).hexdigest()


def build(context: cl.Context, source: str, options: Sequence[str] = ()) -> cl.Program:
    """Return a program built from source, and kept by nobody but the driver; raises cl.Error."""
    return cl.Program(context, source).build(list(options), cache_dir=False)


def _checksum(binary: bytes) -> bytes:
    """Return what a file of a program begins with."""
    return hashlib.blake2b(binary, digest_size=_CHECKSUM).digest()


def _newest(folder: Path | None) -> list[Path]:
    """Return the programs in a folder that were used last; remove the others."""
    if folder is None or not folder.is_dir():
        return []
    with suppress(OSError):
        files = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in files[_MOST:]:
            path.unlink(missing_ok=True)
        return [path for path in files[:_MOST] if not path.name.startswith(".")]
    return []


def device_digest(device: cl.Device) -> str:
    """Return a name for all that binaries of a device depend on beside their source."""
    platform = device.platform
    facts = (
        platform.vendor, platform.name, platform.version, device.vendor, device.name, device.version,
        device.driver_version,
    )  # fmt: skip
    return hashlib.blake2b("\0".join(facts).encode(), digest_size=10).hexdigest()
