"""Ctrl+C and a request to end, as an exception that nobody swallows."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

#: Time until a signal that was lost comes again, s: longer than what lost it takes to return.
_AGAIN = 0.02


class Stopped(KeyboardInterrupt):
    """A signal asked the process to end."""

    def __init__(self, number: int) -> None:
        super().__init__(f"Interrupted by {signal.Signals(number).name}.")
        #: Exit code of a process that a signal ended, as shells tell it.
        self.code = 128 + number


class Signals:
    """Turns the first signal into a Stopped within `heard`; elsewhere it is kept until then.

    While Blender starts or ends an exception would get lost in its own scripts, or break off what removes
    temporary files. Afterwards the process ends, which signals no longer break off: Blender's own handler
    could not be put back, since Python does not know it.

    Python ignores exceptions in finalizers and callbacks of weak references, as its import system has
    them; Blender prints those of handlers and of render engines, as Cycles', and goes on. A signal that
    came in one of these comes again.
    """

    def __init__(self) -> None:
        self._received: int | None = None
        self._raises = False
        self._raised = False
        self._hooks = sys.unraisablehook, sys.excepthook

    def __enter__(self) -> Signals:
        for number in _SIGNALS:
            signal.signal(number, self._receive)
        sys.unraisablehook, sys.excepthook = self._ignored, self._printed
        return self

    def __exit__(self, *_: object) -> None:
        sys.unraisablehook, sys.excepthook = self._hooks
        for number in _SIGNALS:
            signal.signal(number, signal.SIG_IGN)

    @contextmanager
    def heard(self) -> Iterator[None]:
        """Raise Stopped as soon as a signal comes, at once if it is there already.

        Where Blender makes another error of it, or none, it is raised anew at the end.
        """
        try:
            self._raises = True
            self.check()
            yield
        finally:
            self._raises = False
            self.check()

    def check(self) -> None:
        """Raise Stopped if a signal has come."""
        if self._received is not None:
            self._raised = True
            raise Stopped(self._received)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        """Note a signal, and raise the first one: a second must not break off what ends the work."""
        self._received = self._received or number
        if self._raises and not self._raised:
            self.check()

    def _ignored(self, found: sys.UnraisableHookArgs) -> None:
        """Tell of an exception that Python ignored, but for a Stopped."""
        if isinstance(found.exc_value, Stopped):
            self._come_again()
        else:
            self._hooks[0](found)

    def _printed(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        """Print an exception that nothing in Python catches, but for a Stopped."""
        if isinstance(error, Stopped):
            self._come_again()
        else:
            self._hooks[1](kind, error, trace)

    def _come_again(self) -> None:
        """Let a signal that was lost come again, once what lost it has returned."""
        self._raised = False
        threading.Timer(_AGAIN, _interrupt, (self._received,)).start()


def _interrupt(number: int) -> None:
    """Send the main thread a signal, which ends waiting, too; Windows only notes it."""
    if sys.platform == "win32":
        _thread.interrupt_main(number)
    else:
        signal.pthread_kill(threading.main_thread().ident, number)
