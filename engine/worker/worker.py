"""Worker: bakes in a child process, so that a cancel always works and a driver crash is contained.

A bake can start again without the device that crashed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator, Mapping, Sequence
from typing import Any, Self

from ..bake_result import BakeResult
from ..device.device_records import DeviceRecords
from ..errors import WorkerCrashError, WorkerError
from ..progress import Progress
from ..scene.model import Scene
from ..settings import Settings
from . import messages
from .process import BAKING, Job, WorkerProcess
from .shared_block import SharedBlock

Bake = Generator[Progress | None, None, Any]

#: Generator of a child's steps, including the lightmaps of Live.
Steps = Generator[Any, None, Any]


class Worker:
    """Runs `engine.bake` in a child process that stays alive between bakes.

    The first bake or call starts the process, and so does the first one after its death. It ends with `stop`,
    or when the parent dies. The protocol is in `engine.worker.child`.
    """

    def __init__(
        self,
        executable: str = sys.executable,
        search_path: Sequence[str] | None = None,
        bake: str = "engine.session:bake",
        start_limit: float = 60,
        job: Job = BAKING,
    ) -> None:
        """Prepare a worker without starting the process.

        executable:   path of the Python to run
        search_path:  module search path of the child; None for the `sys.path` of this process
        bake:         "module:function" of the generator that the child runs, importable there
        start_limit:  maximum time until the child is ready, s
        job:          purpose of the process, for errors
        """
        self._executable = executable
        self._search_path = tuple(sys.path if search_path is None else search_path)
        self._bake = bake
        self._start_limit, self._job = start_limit, job
        self._child: WorkerProcess | None = None
        self._busy = False
        self._updates: list[messages.PackedMessage] = []

    @property
    def process(self) -> subprocess.Popen[bytes] | None:
        """Child process; None before the first bake and after `stop`."""
        return self._child.popen if self._child else None

    @property
    def alive(self) -> bool:
        """True while the child process runs."""
        return self._child is not None and self._child.alive

    def bake(self, scene: Scene, settings: Settings) -> Bake:
        """Bake in the child process; yield progress, return the `BakeResult`."""
        return (yield from self.run(scene, settings))

    def run(self, *arguments: object) -> Generator[Progress | None, None, Any]:
        """Run the child's generator; each `next` yields the newest Progress, or None.

        A `next` takes a few ms, and longer if lightmaps are copied. Returns the result of the child's
        generator. Raises the child's SceneError, SettingsError or DeviceError. Raises WorkerError if the
        child has a bug, dies, cannot start or is busy. Closing the generator cancels the bake within about 2
        s.
        """
        return (yield from self._run(arguments, ("bake",)))

    def follow(
        self, function: str, *arguments: object
    ) -> Generator[Progress | BakeResult | None, None, None]:
        """Run "module:function", such as `engine.session:live`, in the child until the generator is closed.

        Yields as `run`, and each finished lightmap of all changes so far; raises the same errors. `update`
        sends changes.
        """
        yield from self._run(arguments, ("follow", function))

    def update(self, changes: object) -> None:
        """Queue changes for a child in `follow`, whose next step sends them."""
        self._updates.append(messages.PackedMessage(changes))

    def _run(self, arguments: tuple[object, ...], request: tuple[str, ...]) -> Steps:
        """Send a request with arguments to the child and relay its steps."""
        if self._busy:
            raise WorkerError("Another bake is running. Wait until it has finished, or cancel it.")
        self._busy = True
        self._updates.clear()
        try:
            child = yield from self._ready_child()
            with SharedBlock(messages.PackedMessage(arguments)) as block:
                return (yield from self._converse(child, block, request))
        finally:
            self._busy = False

    def call(self, function: str, *arguments: object) -> None:
        """Run "module:function" in the child before its next bake; start the child if needed.

        Does not wait, and does nothing during a bake. Raises WorkerError if the child cannot start.

        arguments:  builtins
        """
        if not self._busy:
            self._child_process().send("call", function, *arguments)

    def prepare(self, function: str, *arguments: object) -> None:
        """Run the generator "module:function" in the child until its next bake or call.

        Starts the child if needed; does nothing during a bake. Raises WorkerError if the child cannot start.

        arguments:  builtins
        """
        if not self._busy:
            self._child_process().send("prepare", function, *arguments)

    def preparation(self) -> tuple[str, float] | None:
        """Return the latest stage and seconds left of an idle child; None without a new report.

        The stage is empty once `prepare` has ended.
        """
        if self._busy or self._child is None:
            return None
        return self._child.preparation()

    def printed(self) -> str:
        """Return the output of an idle child since the last call.

        The last output of a dead child is in the error that reported its death.
        """
        return self._child.printed() if self._child and self._child.alive else ""

    def stop(self) -> None:
        """End the child process, if there is one."""
        if self._child:
            self._child.stop()
            self._child = None

    def _ready_child(self) -> Generator[None, None, WorkerProcess]:
        """Return the ready child, started if needed; yield meanwhile."""
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
        """Return the child, started if needed; it may not be ready yet."""
        if not self.alive:
            self.stop()
            self._child = WorkerProcess(self._executable, self._search_path, self._bake, self._job)
        return self._child  # type: ignore[return-value]

    def _converse(self, child: WorkerProcess, block: SharedBlock, request: tuple[str, ...]) -> Steps:
        """Let the child process the arguments in the block; cancel it after an error on this side."""
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

        # A bug may leave the child in an undefined state, so the next bake gets a new one.
        error = messages.rebuild_error(*outcome)
        if isinstance(error, WorkerError):
            self.stop()
        raise error

    def _relay(
        self, child: WorkerProcess, block: SharedBlock
    ) -> Generator[Progress | BakeResult | None, None, str]:
        """Yield the child's progress until the bake ends; return the kind of object in the block.

        In `follow`, also sends changes and yields each finished lightmap. A lightmap is skipped if later
        changes are under way, since it shows the scene before them.
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
    """Changes on their way to the child, each in a block until the child has read it; a context manager.

    sent:  number of changes so far
    """

    def __init__(self, child: WorkerProcess) -> None:
        self._child, self._blocks, self.sent = child, dict[str, SharedBlock](), 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for name in list(self._blocks):
            self.drop(name)

    def send(self, updates: list[messages.PackedMessage]) -> None:
        """Send all changes of a list and empty it."""
        while updates:
            block = SharedBlock(updates.pop(0))
            self._blocks[block.name] = block
            self._child.send("update", block.name)
            self.sent += 1

    def drop(self, name: str) -> None:
        """Remove a block after use."""
        self._blocks.pop(name).__exit__()


def bake_without_crashing_device(
    worker: Worker, scene: Scene, settings: Settings, paces: Mapping[str, float]
) -> Generator[Progress | None, None, BakeResult]:
    """Bake in a worker; if that crashes while it uses an OpenCL device, bake again without the device.

    Later bakes skip the device as well, see `DeviceRecords`; the report says so. The error is raised if the
    user has chosen the device, or if the second bake crashes too; the device is then not skipped.
    """
    records = DeviceRecords(settings.cache_dir)
    try:
        return (yield from worker.run(scene, settings, dict(paces)))
    except WorkerCrashError as crash:
        device = records.leave(crash.process)
        if device is None or settings.opencl_device is not None:
            raise
    records.skip(device, "crashed")
    try:
        return (yield from worker.run(scene, settings, dict(paces)))
    except WorkerCrashError:
        records.allow(device)
        raise
