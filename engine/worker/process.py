"""The worker process as its parent sees it: started, connected to, spoken with, ended."""

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

from ..errors import WorkerError

#: What a person may do when the process does not come up.
START_REMEDY = "Restart Blender, or install Hemibake again; if that does not help,"


@dataclass(frozen=True)
class Job:
    """What a process is there for.

    name    as a person knows it
    remedy  what a person may do when the process dies at work
    """

    name: str
    remedy: str


BAKING = Job(
    "baking",
    "Your scene is untouched and the last image is kept. Bake again to start a new process; if it happens "
    "again, update the graphics driver, lower the resolution, or",
)
UNWRAPPING = Job("unwrapping", "Your scene is untouched. Try again; if it happens again,")

#: How much of the worker's log an error shows, bytes.
LOG_TAIL = 4000

#: How long a message is waited for before the caller gets its turn again, s.
POLL = 0.002

#: How long the process may take to end or to give up a bake before it is killed, s.
PATIENCE = 2.0


class WorkerProcess:
    """A child process that runs `engine.worker.child`, and the connection to it.

    answered  True once the process has said that it is there
    """

    def __init__(self, executable: str, search_path: Sequence[str], bake: str, job: Job = BAKING) -> None:
        """Start the process with `search_path` as its PYTHONPATH; `bake` is "module:function".

        Raise a WorkerError if the executable cannot be run.
        """
        # The process inherits its end of the connection, which closes when this one dies; its log has
        # no name. So nothing stays behind, whichever of the two is killed, and when.
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
                f"Check that '{executable}' is a Python that may be run, or install Blender again."
            ) from error

    def _spawn(self, command: list[str], environment: dict[str, str], handle: int) -> subprocess.Popen[bytes]:
        """Start a process that inherits a handle, the last word of its command line."""
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
        """Yield until the process has answered; raise a WorkerError if it has not within `limit` s."""
        deadline = time.monotonic() + limit
        while self.receive() is None:
            if time.monotonic() > deadline:
                self._fail(f"did not answer within {limit:g} s of its start", START_REMEDY)
            yield
        self.answered = True

    def send(self, *message: object) -> None:
        """Send a short message; raise a WorkerError if the process is dead."""
        try:
            with _pipe_errors():
                self._link.send(message)
        except OSError:
            self._fail_ended()

    def receive(self, patience: float = POLL) -> tuple[Any, ...] | None:
        """Return the next message, or None after `patience` s; raise a WorkerError if the process is dead."""
        try:
            if not self._link.poll(patience):
                return None
            message: tuple[Any, ...] = self._link.recv()
            return message
        except (OSError, EOFError):
            self._fail_ended()

    def preparation(self) -> tuple[str, float] | None:
        """Return the last of the waiting reports of a preparation; None if there is none."""
        last = None
        while message := self.receive(0):
            kind, *facts = message
            self.answered |= kind == "ready"
            last = (facts[0], facts[1]) if kind == "preparing" else last
        return last

    def cancel(self) -> None:
        """Have the process give up its bake, or end it if it has not within PATIENCE s."""
        deadline = time.monotonic() + PATIENCE
        with suppress(WorkerError):
            self.send("cancel")

            # What it said before it heard that is of no interest any more.
            while self.receive(max(0, deadline - time.monotonic())) != ("cancelled",):
                if time.monotonic() > deadline:
                    self.popen.kill()

    @property
    def _link(self) -> Connection[Any, Any]:
        if self._connection.closed:
            raise WorkerError(f"The {self._job.name} process was stopped. Try again to start a new one.")
        return self._connection

    def _fail_ended(self) -> NoReturn:
        """Raise a WorkerError because the process has closed its end, and so is about to leave."""
        self._wait()
        if self.answered:
            self._fail("ended in the middle of its work", self._job.remedy)
        self._fail("could not start", START_REMEDY)

    def _fail(self, what: str, remedy: str) -> NoReturn:
        """End the process and raise a WorkerError with its exit status and the end of its log."""
        code = self._end()
        tail = self._log_tail()
        self.stop()
        raise WorkerError(
            f"The {self._job.name} process {what} (exit status {code}). {remedy} report it together with "
            f"these lines.\n{tail}"
        )

    def _log_tail(self) -> str:
        """Return the end of what an ended process printed."""
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - LOG_TAIL))
        return self._log.read().decode(errors="replace")

    def printed(self) -> str:
        """Return what the process has printed since the last call; it has to be idle.

        Both have one position in the file, which has to stay at its end.
        """
        self._log.seek(self._printed)
        text = self._log.read()
        self._printed += len(text)
        return text.decode(errors="replace")

    def stop(self) -> None:
        """End the process and remove what it leaves; may be called again."""
        self._end()
        self._close()

    def _close(self) -> None:
        self._connection.close()
        self._log.close()

    def _end(self) -> int:
        # A closed connection asks the process to leave; one that has not answered yet may not hear that.
        self._connection.close()
        if not self.answered:
            self.popen.kill()
        return self._wait()

    def _wait(self) -> int:
        """Return the exit status of the process; it is killed if it does not leave within PATIENCE s."""
        try:
            return self.popen.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            return self.popen.wait()


@contextmanager
def _pipe_errors() -> Iterator[None]:
    """Make writing to a dead process an OSError: Blender lets SIGPIPE end it, as Python alone does not."""
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
    """Return the options of Popen that let a process inherit a handle: a file descriptor if not Windows."""
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        startup = subprocess.STARTUPINFO(lpAttributeList={"handle_list": [handle]})
        flags = subprocess.CREATE_NO_WINDOW | subprocess.BELOW_NORMAL_PRIORITY_CLASS
        return {"startupinfo": startup, "creationflags": flags}
    return {"pass_fds": (handle,)}


def _environment(search_path: Sequence[str]) -> dict[str, str]:
    """Return the child's environment: what this Python ignores, the child does not see either."""
    isolated = bool(sys.flags.ignore_environment)
    environment = {
        key: value for key, value in os.environ.items() if not (isolated and key.startswith("PYTHON"))
    }

    # Whatever the engine is called here, in the child it is the package `engine` of this folder.
    home = str(Path(__file__).resolve().parents[2])
    folders = [os.path.abspath(folder) for folder in search_path]
    environment["PYTHONPATH"] = os.pathsep.join([home, *folders])
    return environment
