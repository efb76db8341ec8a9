"""Used memory of a GPU as its driver reports it, for all processes together."""

from __future__ import annotations

import shutil
import subprocess
import time
from pathlib import Path
from threading import Event, Thread
from types import TracebackType

_NVIDIA = ("--query-gpu=memory.used", "--format=csv,noheader,nounits", "-lms", "100", "-i", "0")


class DeviceMemory:
    """Measures the memory of the first card inside a `with` block.

    peak:  bytes above what was in use at first, None if no driver tells
    """

    def __init__(self) -> None:
        self.peak: int | None = None
        self._first: int | None = None
        self._end = Event()
        self._process: subprocess.Popen[str] | None = None
        self._thread: Thread | None = None

    def __enter__(self) -> DeviceMemory:
        amd = sorted(Path("/sys/class/drm").glob("card*/device/mem_info_vram_used"))
        if shutil.which("nvidia-smi"):
            self._process = subprocess.Popen(
                ["nvidia-smi", *_NVIDIA], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
            self._take_nvidia(self._process.stdout.readline())
            self._thread = Thread(target=self._follow_nvidia, daemon=True)
        elif amd:
            self._take(int(amd[0].read_text()))
            self._thread = Thread(target=self._follow_amd, args=(amd[0],), daemon=True)
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        if self._thread is not None:
            self._thread.join(2)

    def _follow_nvidia(self) -> None:
        for line in self._process.stdout:
            self._take_nvidia(line)

    def _follow_amd(self, path: Path) -> None:
        while not self._end.is_set():
            self._take(int(path.read_text()))
            time.sleep(0.1)

    def _take_nvidia(self, line: str) -> None:
        if line.strip().isdigit():
            self._take(int(line) << 20)

    def _take(self, used: int) -> None:
        if self._first is None:
            self._first = used
        self.peak = max(self.peak or 0, used - self._first)
