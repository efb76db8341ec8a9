"""Runs cases in their own process: a case that hangs or crashes fails."""

from __future__ import annotations

import faulthandler
import importlib
import os
import pickle
import re
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]

#: Bytes of a dead process's last words that are shown.
_WORDS = 6000


class CaseFailed(AssertionError):  # noqa: N818
    """A case failed in the other process; the message is its traceback."""


class Apart:
    """A process that gives one case after the other to a function, and is started anew where it ends.

    function:  "module:name"
    limit:     longest time of a case, s
    """

    def __init__(self, function: str, limit: float) -> None:
        self._function, self._limit = function, limit
        self._process: subprocess.Popen | None = None
        self._errors = tempfile.TemporaryFile("a+b")  # noqa: SIM115
        self._kinds: dict[str, type[CaseFailed]] = {}

    def run(self, case: object) -> Any:
        """Return what the function returns; raises CaseFailed, of a class of its own for each origin."""
        process = self._process = self._process or self._start()
        self._errors.truncate(0)
        try:
            pickle.dump(case, process.stdin)
            process.stdin.flush()
            result, failure = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            self.stop()
            words = self._last_words()
            hangs = "Timeout (" in words
            cause = f"more than {self._limit} s" if hangs else f"exit status {process.returncode}"
            failure = f"{'hangs' if hangs else 'dies'}: {cause}\n{words}"
        if failure is not None:
            raise self._kind(failure)(failure)
        return result

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.stdin.close()
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            process.stdout.close()

    def _start(self) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.apart", self._function, str(self._limit)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            cwd=ROOT,
        )

    def _last_words(self) -> str:
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, size - _WORDS))
        return self._errors.read().decode(errors="replace")

    def _kind(self, failure: str) -> type[CaseFailed]:
        """Return a class for failures of one origin: what hypothesis tells bugs apart by."""
        lines = re.findall(r'File "([^"]+)", line (\d+)', failure)
        line = lines[0] if failure.startswith("hangs") else lines[-1] if lines else ("", "")
        head = failure.strip().splitlines()[-1 if failure.startswith("Traceback") else 0]
        key = f"{head.split(':')[0]} {line}"
        return self._kinds.setdefault(key, type("CaseFailed", (CaseFailed,), {}))


def main(function: str, limit: float) -> None:
    """Answer the cases that come on standard input with (result, None) or (None, traceback)."""
    faulthandler.enable()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    module, name = function.split(":")
    run = getattr(importlib.import_module(module), name)
    while True:
        try:
            case = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        faulthandler.dump_traceback_later(limit, exit=True)
        try:
            answer = run(case), None
        except Exception:  # noqa: BLE001
            answer = None, traceback.format_exc()
        faulthandler.cancel_dump_traceback_later()
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
