"""Runs a function in its own process, so that crashes are results and peak memory is its own."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import tempfile
import time
import traceback
from collections import deque
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any

from benchmarks.device_memory import DeviceMemory
from benchmarks.options import ROOT


@dataclass(frozen=True)
class Outcome:
    """Result of a call in a process of its own.

    value:         what the function returned, None if it failed
    error:         a sentence, None if it did not fail
    seconds:       wall time of the process, s
    host_bytes:    peak of its resident memory, None if unknown
    device_bytes:  peak of the graphics card's used memory above what was used before, None if unknown
    """

    value: Any
    error: str | None
    seconds: float
    host_bytes: int | None
    device_bytes: int | None


def run_apart(
    function: str, arguments: dict[str, Any], limit: float | None = None, watched: bool = False
) -> Outcome:
    """Call "module:function" with keyword arguments that JSON can hold.

    limit:    wall time after which it is stopped, s
    watched:  True watches the graphics card's memory meanwhile
    """
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="hemibake-bench-") as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, "-m", "benchmarks.apart", function, json.dumps(arguments), str(answer)]
        with DeviceMemory() if watched else nullcontext() as memory:
            error = _wait(command, limit)
        seconds = time.perf_counter() - started
        outcome = json.loads(answer.read_text(encoding="utf-8")) if answer.exists() else {}
    peak = memory.peak if memory is not None else None
    return Outcome(
        outcome.get("value"),
        outcome.get("error") or error,
        seconds,
        outcome.get("host_bytes"),
        peak,
    )


def _wait(command: list[str], limit: float | None) -> str | None:
    """Run a command with its output on standard error; return why it failed, or None."""
    lines: deque[str] = deque(maxlen=20)
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    ) as process:
        reader = Thread(target=_pass_on, args=(process.stdout, lines), daemon=True)
        reader.start()
        try:
            status = process.wait(limit)
        except subprocess.TimeoutExpired:
            process.kill()
            return f"stopped after {limit:.0f} s"
        except BaseException:
            process.kill()
            raise
        reader.join(5)
    if status == 0:
        return None
    last = next((line for line in reversed(lines) if line.strip()), "no output").strip()
    return f"the process ended with status {status}: {last}"


def _pass_on(stream: Any, lines: deque[str]) -> None:
    """Keep the last lines, and write all but Blender's chatter to standard error."""
    for line in stream:
        lines.append(line)
        if not line.startswith("Info:"):
            sys.stderr.write(line)


def _peak_host_bytes() -> int | None:
    """Return the peak of this process's resident memory.

    Linux also tells ru_maxrss, but that starts with the peak of the process that started this one.
    """
    try:
        text = Path("/proc/self/status").read_text(encoding="ascii")
        return next(1024 * int(line.split()[1]) for line in text.splitlines() if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        pass
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def main() -> None:
    """Answer one call."""
    function, arguments, answer = sys.argv[1:]
    module, _, name = function.partition(":")
    outcome: dict[str, Any] = {}
    try:
        outcome["value"] = getattr(importlib.import_module(module), name)(**json.loads(arguments))
    except Exception as error:  # noqa: BLE001
        traceback.print_exc()
        outcome["error"] = f"{type(error).__name__}: {error}"
    outcome["host_bytes"] = _peak_host_bytes()
    Path(answer).write_text(json.dumps(outcome), encoding="utf-8")


if __name__ == "__main__":
    main()
