"""CPU seconds of the processes of a session, from Linux's /proc (proc_pid_stat(5))."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

#: Fields after the name: session, user and system time, and these times of children that have ended.
_SESSION, _TIMES = 3, slice(11, 15)


def cpu_seconds(session: int) -> float:
    """Return the CPU seconds that the processes of a session and their ended children have used."""
    ticks = 0
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with suppress(OSError):
                fields = (process / "stat").read_text().rpartition(")")[2].split()
                if int(fields[_SESSION]) == session:
                    ticks += sum(map(int, fields[_TIMES]))
    return ticks / os.sysconf("SC_CLK_TCK")
