"""Worker process from the parent's side: start, connection, messages, end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, NoReturn

from ..errors import WorkerCrashError, WorkerError

#: Remedy in errors if the process does not start.
START_REMEDY = "Restart Blender, or install Hemibake again; if that does not help,"


@dataclass(frozen=True)
class Job:
    """Purpose of a process.

    name:    name for the user
    remedy:  remedy if the process dies at work
    """

    name: str
    remedy: str


BAKING = Job(
    "baking",
    "Your scene is untouched and the last image is kept. Bake again to start a new process; if it happens "
    "again, update the graphics driver, lower the resolution, or",
)
UNWRAPPING = Job("unwrapping", "Your scene is untouched. Try again; if it happens again,")

#: The least exit status of Windows for a fault, such as an access violation.
_WINDOWS_FAULT = 0xC0000000

#: Bytes of the worker's log in an error.
LOG_TAIL = 4000

#: Seconds to wait for a message before the caller regains control.
POLL = 0.002

#: Seconds to wait for the process to end or to cancel a bake before it is killed.
PATIENCE = 2.0


class WorkerProcess:
    """Child process that runs `engine.worker.child`, with its connection.

    answered:  True once the process has reported that it is ready
    """

    def __init__(self, executable: str, search_path: Sequence[str], bake: str, job: Job = BAKING) -> None:
        """Start the process with `search_path` as its PYTHONPATH; `bake` is "module:function".

        Raises WorkerError if the executable cannot be run.
        """
        # The process inherits its end of the connection, which closes when this process dies; its log has no
        # file name. Nothing remains, whichever process is killed.
        self._connection, inherited = Pipe()
        self.answered, self._job = False, job
        self._log, self._printed = tempfile.TemporaryFile(buffering=0), 0  # noqa: SIM115

        command = [executable, "-s", "-P", "-m", "engine.worker.child", "--bake", bake]
        try:
            with inherited:
                self.popen = self._spawn(command, _environment(search_path), inherited.fileno())
        except OSError as error:
            self._close()
            raise WorkerError(
                f"The {job.name} process could not be started: {error}. "
                f"Check that '{executable}' is an executable Python, or install Blender again."
            ) from error

    def _spawn(self, command: list[str], environment: dict[str, str], handle: int) -> subprocess.Popen[bytes]:
        """Start a process that inherits a handle, the last argument of its command line."""
        return subprocess.Popen(
            [*command, str(handle)],
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            env=environment,
            **_inheritance(handle),
        )

    @property
    def alive(self) -> bool:
        """True while the process runs."""
        return self.popen.poll() is None

    def connect(self, limit: float) -> Generator[None, None, None]:
        """Yield until the process is ready; raise WorkerError if it is not within `limit` s."""
        deadline = time.monotonic() + limit
        while self.receive() is None:
            if time.monotonic() > deadline:
                self._fail(f"did not answer within {limit:g} s of its start", START_REMEDY)
            yield
        self.answered = True

    def send(self, *message: object) -> None:
        """Send a short message; raise WorkerError if the process is dead."""
        try:
            with _pipe_errors():
                self._link.send(message)
        except OSError:
            self._fail_ended()

    def receive(self, patience: float = POLL) -> tuple[Any, ...] | None:
        """Return the next message, or None after `patience` s; raise WorkerError if the process is dead."""
        try:
            if not self._link.poll(patience):
                return None
            message: tuple[Any, ...] = self._link.recv()
            return message
        except (OSError, EOFError):
            self._fail_ended()

    def preparation(self) -> tuple[str, float] | None:
        """Return the latest report of a preparation; None if there is none."""
        last = None
        while message := self.receive(0):
            kind, *facts = message
            self.answered |= kind == "ready"
            last = (facts[0], facts[1]) if kind == "preparing" else last
        return last

    def cancel(self) -> None:
        """Cancel the bake; kill the process if it has not cancelled within PATIENCE s."""
        deadline = time.monotonic() + PATIENCE
        with suppress(WorkerError):
            self.send("cancel")

            # Earlier messages are obsolete.
            while self.receive(max(0, deadline - time.monotonic())) != ("cancelled",):
                if time.monotonic() > deadline:
                    self.popen.kill()

    @property
    def _link(self) -> Connection[Any, Any]:
        if self._connection.closed:
            raise WorkerError(f"The {self._job.name} process was stopped. Try again to start a new one.")
        return self._connection

    def _fail_ended(self) -> NoReturn:
        """Raise WorkerError because the process has closed its end of the connection."""
        self._wait()
        if self.answered:
            self._fail("ended in the middle of its work", self._job.remedy)
        self._fail("could not start", START_REMEDY)

    def _fail(self, event: str, remedy: str) -> NoReturn:
        """End the process and raise WorkerError with its exit status and the end of its log."""
        code = self._end()
        tail = self._log_tail()
        self.stop()
        error = WorkerCrashError if _is_crash(code) else WorkerError
        failure = error(
            f"The {self._job.name} process {event} (exit status {code}). {remedy} report it together with "
            f"these lines.\n{tail}"
        )
        if isinstance(failure, WorkerCrashError):
            failure.process = self.popen.pid
        raise failure

    def _log_tail(self) -> str:
        """Return the end of the log of an ended process."""
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - LOG_TAIL))
        return self._log.read().decode(errors="replace")

    def printed(self) -> str:
        """Return the output since the last call; the process must be idle.

        Both processes share one file position, which must stay at the end.
        """
        self._log.seek(self._printed)
        text = self._log.read()
        self._printed += len(text)
        return text.decode(errors="replace")

    def stop(self) -> None:
        """End the process and release its resources; may be called repeatedly."""
        self._end()
        self._close()

    def _close(self) -> None:
        self._connection.close()
        self._log.close()

    def _end(self) -> int:
        # Closing the connection asks the process to end; a process that is not ready may not notice.
        self._connection.close()
        if not self.answered:
            self.popen.kill()
        return self._wait()

    def _wait(self) -> int:
        """Return the exit status of the process; kill it if it does not end within PATIENCE s."""
        try:
            return self.popen.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            return self.popen.wait()


def _is_crash(code: int) -> bool:
    """Return True if the exit status of a process reports a crash: a fault, not a kill from outside."""
    if sys.platform == "win32":
        return code & 0xFFFFFFFF >= _WINDOWS_FAULT
    return -code in (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGILL, signal.SIGFPE)


@contextmanager
def _pipe_errors() -> Iterator[None]:
    """Convert writes to a dead process into OSError; Blender leaves SIGPIPE enabled, unlike Python."""
    if sys.platform == "win32":
        yield
        return
    deadly = signal.getsignal(signal.SIGPIPE) == signal.SIG_DFL
    if deadly:
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    try:
        yield
    finally:
        if deadly:
            signal.signal(signal.SIGPIPE, signal.SIG_DFL)


def _inheritance(handle: int) -> dict[str, Any]:
    """Return the Popen options to inherit a handle: a file descriptor except on Windows."""
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        startup = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]})
        flags = subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS
        return {"startupinfo": startup, "creationflags": flags}
    return {"pass_fds": (handle,)}


def _environment(search_path: Sequence[str]) -> dict[str, str]:
    """Return the child's environment, without variables that this Python ignores."""
    isolated = bool(sys.flags.ignore_environment)
    environment = {
        key: value for key, value in os.environ.items() if not (isolated and key.startswith("PYTHON"))
    }

    # In the child, this package is named `engine` whatever its name is here.
    home = str(Path(__file__).resolve().parents[2])
    folders = [os.path.abspath(folder) for folder in search_path]
    environment["PYTHONPATH"] = os.pathsep.join([home, *folders])
    return environment
