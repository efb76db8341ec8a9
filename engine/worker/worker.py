"""A bake in a process of its own: cancel is always possible, and a driver crash stays there."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator, Sequence
from typing import Any, Self

from ..bake_result import BakeResult
from ..errors import WorkerError
from ..progress import Progress
from ..scene.model import Scene
from ..settings import Settings
from . import messages
from .process import BAKING, Job, WorkerProcess
from .shared_block import SharedBlock

Bake = Generator[Progress | None, None, Any]

#: What a child does, lightmaps of a bake that goes on included.
Steps = Generator[Any, None, Any]


class Worker:
    """Runs `engine.bake` in a child process that stays alive between bakes.

    The process is started by the first bake or call, and again by the one after it died. It ends with
    `stop`, and by itself when the parent dies. The protocol is in `engine.worker.child`.
    """

    def __init__(
        self,
        executable: str = sys.executable,
        search_path: Sequence[str] | None = None,
        bake: str = "engine.session:bake",
        start_limit: float = 60,
        job: Job = BAKING,
    ) -> None:
        """Prepare a worker; nothing is started yet.

        executable   the Python to run
        search_path  where it finds its modules; None for the `sys.path` of this process
        bake         "module:function" of the generator that the child runs, as seen there; another one
                     than a bake is run with `run`
        start_limit  how long the child may take until it answers, s
        job          what it is there for, as errors say
        """
        self._executable = executable
        self._search_path = tuple(sys.path if search_path is None else search_path)
        self._bake = bake
        self._start_limit, self._job = start_limit, job
        self._child: WorkerProcess | None = None
        self._busy = False
        self._updates: list[messages.Parcel] = []

    @property
    def process(self) -> subprocess.Popen[bytes] | None:
        """The child process, or None before the first bake and after `stop`."""
        return self._child.popen if self._child else None

    @property
    def alive(self) -> bool:
        """True while a child process runs."""
        return self._child is not None and self._child.alive

    def bake(self, scene: Scene, settings: Settings) -> Bake:
        """Bake in the child, see `run`; returns the Lightmap."""
        return (yield from self.run(scene, settings))

    def run(self, *arguments: object) -> Generator[Progress | None, None, Any]:
        """Let the child work: each `next` yields the newest Progress, or None.

        A `next` takes a few ms; where lightmaps arrived as long as copying them.
        Returns what the child's generator returns. Raises the child's SceneError, SettingsError or
        DeviceError, or a WorkerError if the child has a bug, dies, cannot be started or is at work
        already. Closing the generator cancels the bake, within about 2 s.
        """
        return (yield from self._run(arguments, ("bake",)))

    def follow(
        self, function: str, *arguments: object
    ) -> Generator[Progress | BakeResult | None, None, None]:
        """Let "module:function", as `engine.session:live`, work in the child until the generator is closed.

        Yields as `run`, and each Lightmap that is finished, of all changes so far; raises the same errors.
        `update` sends changes.
        """
        yield from self._run(arguments, ("follow", function))

    def update(self, changes: object) -> None:
        """Send changes to the child that follows; they leave with the next step of `follow`."""
        self._updates.append(messages.Parcel(changes))

    def _run(self, arguments: tuple[object, ...], request: tuple[str, ...]) -> Steps:
        """Let the child do what a message asks for, with arguments."""
        if self._busy:
            raise WorkerError("Another bake is running. Wait until it is done, or cancel it.")
        self._busy = True
        self._updates.clear()
        try:
            child = yield from self._ready_child()
            with SharedBlock(messages.Parcel(arguments)) as block:
                return (yield from self._converse(child, block, request))
        finally:
            self._busy = False

    def call(self, function: str, *arguments: object) -> None:
        """Have the child run "module:function" before its next bake; start it if there is none.

        arguments: builtins. Does not wait, and does nothing while a bake runs. Raises a WorkerError if the
        child cannot be started.
        """
        if not self._busy:
            self._child_process().send("call", function, *arguments)

    def prepare(self, function: str, *arguments: object) -> None:
        """Have the child run the generator "module:function" until its next bake or call.

        arguments: builtins. Starts the child if there is none; does nothing while a bake runs. Raises a
        WorkerError if the child cannot be started.
        """
        if not self._busy:
            self._child_process().send("prepare", function, *arguments)

    def preparation(self) -> tuple[str, float] | None:
        """Return stage and seconds left that an idle child has reported last; None without a new report.

        The stage is empty once `prepare` has ended.
        """
        if self._busy or self._child is None:
            return None
        return self._child.preparation()

    def printed(self) -> str:
        """Return what an idle child has printed since the last call.

        The last words of one that died are in the error that told of it.
        """
        return self._child.printed() if self._child and self._child.alive else ""

    def stop(self) -> None:
        """End the child process, if there is one."""
        if self._child:
            self._child.stop()
            self._child = None

    def _ready_child(self) -> Generator[None, None, WorkerProcess]:
        """Return the child, started and connected to; yield meanwhile."""
        child = self._child_process()
        if child.answered:
            return child
        try:
            yield from child.connect(self._start_limit)
        except BaseException:
            self.stop()
            raise
        return child

    def _child_process(self) -> WorkerProcess:
        """Return the child, started if there is none; it may have to be connected to."""
        if not self.alive:
            self.stop()
            self._child = WorkerProcess(self._executable, self._search_path, self._bake, self._job)
        return self._child  # type: ignore[return-value]

    def _converse(self, child: WorkerProcess, block: SharedBlock, request: tuple[str, ...]) -> Steps:
        """Have the child work on what is in the block; cancel it if anything goes wrong on this side."""
        work, *function = request
        try:
            child.send(work, block.name, *function)
            kind = yield from self._relay(child, block)
            outcome = block.read()
        except BaseException:
            child.cancel()
            raise
        if kind == "lightmap":
            return outcome

        # A bug may leave the child in any state, so the next bake gets a new one.
        error = messages.rebuild_error(*outcome)
        if isinstance(error, WorkerError):
            self.stop()
        raise error

    def _relay(
        self, child: WorkerProcess, block: SharedBlock
    ) -> Generator[Progress | BakeResult | None, None, str]:
        """Yield the child's progress until the bake is over; return what the block then holds.

        Where the bake goes on, changes are sent meanwhile, and each lightmap that is finished is yielded,
        too, unless changes are on their way: it is of the scene before them.
        """
        with _Changes(child) as changes:
            while True:
                changes.send(self._updates)
                kind, *facts = child.receive() or ("nothing",)
                if kind in ("lightmap", "error"):
                    return str(kind)
                outdated = kind == "settled" and facts[0] < changes.sent
                arrived = block.read() if kind in ("progress", "settled") and not outdated else None
                if kind == "read":
                    changes.drop(*facts)
                elif kind == "grow":
                    block.grow(*facts)
                if kind in ("progress", "settled", "grow"):
                    child.send("turn", block.name)
                yield arrived


class _Changes:
    """Changes on their way to the child, in a block each until they are read; used inside `with`.

    sent  number of all so far
    """

    def __init__(self, child: WorkerProcess) -> None:
        self._child, self._blocks, self.sent = child, dict[str, SharedBlock](), 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for name in list(self._blocks):
            self.drop(name)

    def send(self, updates: list[messages.Parcel]) -> None:
        """Send all changes of a list, and empty it."""
        while updates:
            block = SharedBlock(updates.pop(0))
            self._blocks[block.name] = block
            self._child.send("update", block.name)
            self.sent += 1

    def drop(self, name: str) -> None:
        """Remove a block that is not needed any more."""
        self._blocks.pop(name).__exit__()
