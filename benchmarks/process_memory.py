"""Memory and CPU time of this process and its children by stage, as Linux reports them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock, Thread
from types import TracebackType

#: Interval of the samples, s.
_INTERVAL = 0.02

_PROC = Path("/proc")

#: Folder of the blocks of shared memory, as it appears in the maps of processes.
_BLOCKS = "/dev/shm/"


@dataclass
class StageUse:
    """Use of a stage.

    cpu:   CPU time of all processes, s
    peak:  largest memory above the memory at the start, bytes
    """

    cpu: float = 0.0
    peak: int = 0


@dataclass
class ProcessMemory:
    """Measures anonymous memory and blocks of shared memory inside a `with` block; each block counts once.

    Other mapped files, such as libraries, do not count.

    stages:  use of each stage, by name
    """

    stages: dict[str, StageUse] = field(default_factory=dict)

    def __enter__(self) -> ProcessMemory:
        self._end, self._lock, self._stage = Event(), Lock(), ""
        self._first, self._cpu = used_memory(), _cpu()
        self._thread = Thread(target=self._follow, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.begin("")
        self._end.set()
        self._thread.join()

    def begin(self, stage: str) -> None:
        """End the current stage and begin another one, or continue one of this name."""
        if stage == self._stage:
            return
        now = _cpu()
        with self._lock:
            self._of(self._stage).cpu += now - self._cpu
            self._stage, self._cpu = stage, now

    def _of(self, stage: str) -> StageUse:
        return self.stages.setdefault(stage, StageUse())

    def _follow(self) -> None:
        while not self._end.wait(_INTERVAL):
            used = used_memory() - self._first
            with self._lock:
                use = self._of(self._stage)
                use.peak = max(use.peak, used)


def used_memory() -> int:
    """Return the memory of this process and its children, bytes."""
    anonymous, blocks = 0, dict[str, int]()
    for pid in _processes():
        anonymous += _status(pid).get("RssAnon", 0)
        blocks.update(_blocks(pid))
    return anonymous + sum(blocks.values())


def _blocks(pid: int) -> dict[str, int]:
    """Return the sizes of the blocks of shared memory that a process maps, bytes, by inode.

    The sizes are of the mappings: to count written pages, Linux walks the page tables, which takes long.
    """
    try:
        lines = (_PROC / str(pid) / "maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    sizes: dict[str, int] = {}
    for fields in (line.split(maxsplit=5) for line in lines if f" {_BLOCKS}" in line):
        first, last = (int(address, 16) for address in fields[0].split("-"))
        sizes[fields[4]] = sizes.get(fields[4], 0) + last - first
    return sizes


def _status(pid: int) -> dict[str, int]:
    """Return the sizes in a process's status, bytes; none if it has ended."""
    try:
        lines = (_PROC / str(pid) / "status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return {}
    pairs = (line.partition(":") for line in lines if line.endswith(" kB"))
    return {name: 1024 * int(size.split()[0]) for name, _, size in pairs}


def _cpu() -> float:
    """Return the CPU time of this process and its children, also of those that have ended, s."""
    own = os.times()
    spent = own.user + own.system + own.children_user + own.children_system
    tick = os.sysconf("SC_CLK_TCK")
    for pid in _processes():
        if pid == os.getpid():
            continue
        try:
            fields = (_PROC / str(pid) / "stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            continue
        user, system = fields.rpartition(")")[2].split()[11:13]
        spent += (int(user) + int(system)) / tick
    return spent


def _processes() -> Iterator[int]:
    """Yield the numbers of this process and of its children."""
    yield os.getpid()
    for thread in (_PROC / "self" / "task").iterdir():
        try:
            yield from map(int, (thread / "children").read_text(encoding="ascii").split())
        except OSError:
            continue
