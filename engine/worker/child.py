"""Main module of the worker process: `python -m engine.worker.child HANDLE`, with an inherited connection.

The parent owns one block of shared memory for each bake; parent and worker take turns to use it:

    parent                            worker
                                  <-  ready
    bake BLOCK (its arguments)    ->
                                  <-  grow SIZE                   a large block has been read: a small one,
                                                                  or the next object is too large
    turn BLOCK (of that size)     ->
                                  <-  progress (in the block)     the newest
    turn BLOCK (taken)            ->
                                  <-  lightmap or error (in the block); the bake is over
    cancel                        ->
                                  <-  cancelled; the bake is over
    follow BLOCK MODULE:FUNCTION  ->                              like bake, until cancelled
                                  <-  settled COUNT (a lightmap in the block, after COUNT changes)
    update BLOCK (changes)        ->                              during follow; a block for each
                                  <-  read BLOCK                  the block is free
    call MODULE:FUNCTION (builtins) ->                            between bakes, without a reply
    prepare MODULE:FUNCTION (builtins) ->                         between bakes, until the next message
                                  <-  preparing STAGE SECONDS     its stage and remaining time
"""

from __future__ import annotations

import argparse
import faulthandler
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Callable, Generator
from contextlib import closing, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from ..bake_result import BakeResult
from ..device.freed_memory import give_back_freed_memory, keep_freed_memory
from ..progress import Progress
from ..scene.model import Scene
from . import messages
from .shared_block import BorrowedBlock

#: Increase of the worker's nice value (chosen): Blender's threads then keep nine tenths of a core that both
#: use. A redraw of a window by llvmpipe took 0.22 s alone, and 0.46, 0.27 and 0.25 s beside two busy threads
#: of nice value 0, 5 and 10 (medians of 32 on two cores with other load).
_NICENESS = 10

#: Maximum of the worker's nice value (chosen), so that it gets time on a busy machine if Blender's value is
#: positive.
_MOST_NICE = 15

#: A block larger than _LARGE_BLOCK, bytes, is replaced by one of _SMALL_BLOCK bytes once its content has been
#: read, since it may hold as much as the scene.
_LARGE_BLOCK, _SMALL_BLOCK = 1 << 24, 1 << 16

#: Triangles of a scene from which on the process returns free memory after each stage (chosen): pages of
#: 100 MiB of arrays take about 0.05 s to be mapped again.
_LARGE_SCENE = 1 << 19

#: Idle time in seconds after which the process returns its free memory.
_IDLE = 20.0

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection

#: Generator of a bake or other work with progress; its result is sent like a lightmap. A generator that
#: follows its scene yields each finished lightmap and receives lists of changes.
Job = Generator[Progress | BakeResult, list[Any] | None, Any]
Bake = Callable[..., Job]


class _CancelError(Exception):
    """Signal that the parent has cancelled the bake."""


class _Outbox:
    """Worker's side of the protocol during a bake, after the arguments have been read.

    taken:  number of changes that the bake has received
    """

    def __init__(self, connection: Connection[Any, Any], block: str, size: int) -> None:
        """Use the block of the arguments, or let the parent replace it if its size, bytes, is large."""
        self._connection = connection
        self._block: str | None = block
        self._changes: list[Any] = []
        self.taken = 0
        if size > _LARGE_BLOCK:
            connection.send(("grow", _SMALL_BLOCK))
            self._block = None

    def offer(self, kind: str, value: object, *facts: int) -> bool:
        """Send an object if the worker has the turn and the block is large enough; return True if sent."""
        if self._block is None:
            return False
        parcel = messages.PackedMessage(value)
        with BorrowedBlock(self._block) as block:
            fits = block.write(parcel)
        self._connection.send((kind, *facts) if fits else ("grow", parcel.size))
        self._block = None
        return fits

    def send(self, kind: str, value: object, *facts: int) -> None:
        """Send an object after waiting for the turn and a large enough block."""
        while not self.offer(kind, value, *facts):
            self.listen(None)

    def listen(self, patience: float | None = 0) -> None:
        """Process a message within `patience` s (None: no limit); raise _CancelError on a cancel."""
        if self._connection.poll(patience):
            request, *names = self._connection.recv()
            if request == "cancel":
                raise _CancelError
            if request == "update":
                self._read_changes(*names)
            else:
                (self._block,) = names

    def changes(self, patience: float | None = 0) -> list[Any] | None:
        """Return the changes since the last call; None if there are none.

        patience:  0 to return at once, None to wait for changes
        """
        self.listen(0)
        while patience is None and not self._changes:
            self.listen(None)
        changes, self._changes = self._changes, []
        self.taken += len(changes)
        return changes or None

    def _read_changes(self, name: str) -> None:
        """Read changes from their own block."""
        with BorrowedBlock(name) as block:
            self._changes.append(block.read())
        self._connection.send(("read", name))


def serve(connection: Connection[Any, Any], bake: Bake) -> None:
    """Serve the parent's requests; raise EOFError or OSError when the parent is gone."""
    while True:
        if not connection.poll(_IDLE):
            give_back_freed_memory()
        request, *names = connection.recv()
        if request == "bake":
            _answer(connection, bake, *names)
        elif request == "follow":
            block, function = names
            _answer(connection, found(function), block)
        elif request == "cancel":
            connection.send(("cancelled",))
        elif request == "call":
            _call(*names)
        elif request == "prepare":
            _prepare(connection, *names)


def _call(function: str, *arguments: object) -> None:
    """Run a function without a reply; print its error."""
    try:
        found(function)(*arguments)
    except Exception:  # noqa: BLE001
        traceback.print_exc()


def _prepare(connection: Connection[Any, Any], function: str, *arguments: object) -> None:
    """Run a generator of Progress, report its stages, and close it when the parent sends a message."""
    stage = ""
    try:
        with closing(found(function)(*arguments)) as work:
            for progress in work:
                if progress.stage != stage:
                    stage = progress.stage
                    connection.send(("preparing", stage, progress.seconds_left))
                if connection.poll():
                    return
    except (EOFError, OSError):
        raise
    except Exception:  # noqa: BLE001
        traceback.print_exc()
    connection.send(("preparing", "", 0.0))


def _answer(connection: Connection[Any, Any], bake: Bake, name: str) -> None:
    """Run one bake and send its outcome."""
    with BorrowedBlock(name) as block:
        arguments, size = block.read(), block.size
    outbox = _Outbox(connection, name, size)
    try:
        outbox.send(*_outcome(bake, arguments, outbox))
    except _CancelError:
        connection.send(("cancelled",))


def _outcome(bake: Bake, arguments: tuple[object, ...], outbox: _Outbox) -> tuple[str, object]:
    """Return "lightmap" and the result, or "error" and its description."""
    try:
        with closing(bake(*arguments)) as job:
            _report(_trimmed(job) if _is_large(arguments) else job, outbox)
    except StopIteration as end:
        return "lightmap", end.value
    except _CancelError:
        raise
    except Exception as error:  # noqa: BLE001
        return "error", messages.describe_error(error, traceback.format_exc())


def _is_large(arguments: tuple[object, ...]) -> bool:
    """Return True if the arguments of a bake contain a large scene."""
    scenes = [each for each in arguments if isinstance(each, Scene)]
    return any(sum(len(mesh.face) for mesh in scene.meshes) >= _LARGE_SCENE for scene in scenes)


def _trimmed(job: Job) -> Job:
    """Run a bake, and return free memory to the system whenever its stage changes."""
    stage, changes = "", None
    while True:
        try:
            newest = job.send(changes)
        except StopIteration as end:
            return end.value
        if isinstance(newest, Progress) and newest.stage != stage:
            stage = newest.stage
            give_back_freed_memory()
        changes = yield newest


def _report(job: Job, outbox: _Outbox) -> NoReturn:
    """Run a bake until StopIteration; after each slice offer the newest progress and lightmaps."""
    newest = next(job)
    while True:
        if isinstance(newest, BakeResult):
            outbox.send("settled", newest, outbox.taken)
            newest = job.send(outbox.changes(None))
            continue
        changes = outbox.changes()
        sent = outbox.offer("progress", newest)
        intermediate = None if sent else newest.intermediate
        newest = job.send(changes)
        if isinstance(newest, Progress) and newest.intermediate is None and intermediate is not None:
            newest = replace(newest, intermediate=intermediate)


def _inherited(handle: int) -> Connection[Any, Any]:
    """Return the connection of a handle from the parent; child processes do not inherit it."""
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, False)
        return PipeConnection(handle)
    os.set_inheritable(handle, False)
    return Connection(handle)


def _yield_to_the_window() -> None:
    """Lower this process's priority below Blender's; on Windows the parent does so."""
    if sys.platform != "win32":
        os.nice(max(0, min(_NICENESS, _MOST_NICE - os.nice(0))))


def found(name: str) -> Callable[..., Any]:
    """Return the function named "module:function"."""
    module, function = name.split(":")
    return getattr(importlib.import_module(module), function)


def main() -> None:
    """Serve one parent until it closes the connection or dies."""
    parser = argparse.ArgumentParser(prog="engine.worker.child", description=__doc__)
    parser.add_argument("handle", type=int, help="inherited: a file descriptor, a pipe's handle on Windows")
    parser.add_argument(
        "--bake", default="engine.session:bake", help="module:function of the generator to run"
    )
    arguments = parser.parse_args()

    # The parent handles Ctrl-C and then sends requests.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.enable()
    _yield_to_the_window()
    keep_freed_memory()

    connection = _inherited(arguments.handle)
    bake = found(arguments.bake)
    with connection, suppress(EOFError, OSError):
        connection.send(("ready",))
        serve(connection, bake)


if __name__ == "__main__":
    main()
