"""Converts SIGINT and SIGTERM to an exception that Blender and Python cannot suppress."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

#: Delay after which a lost signal is sent again, s; longer than the code that lost it takes to return.
_AGAIN = 0.02

#: File name of the code of Python's import system.
_IMPORT_SYSTEM = "<frozen importlib._bootstrap>"


class Stopped(KeyboardInterrupt):
    """Raised when a signal requests the end of the process."""

    def __init__(self, number: int) -> None:
        super().__init__(f"Interrupted by {signal.Signals(number).name}.")
        #: Exit code of a process ended by a signal, by the convention of shells.
        self.code = 128 + number


class Signals:
    """Raises Stopped on the first signal within `listening`; earlier signals are kept until then.

    While Blender starts or ends, an exception would be lost in Blender's own scripts, or would interrupt the
    removal of temporary files. Signals after `listening` are ignored, because the process is about to end.
    Blender's own handler cannot be restored, as Python has no access to it.

    Some places swallow exceptions: finalizers and callbacks of weak references in Python, handlers and render
    engines such as Cycles in Blender. A signal that was lost there is sent again.

    A signal during an import is also sent again, after the import. An exception there may leave a lock of the
    import system taken, and other threads that import would wait forever.
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
    def listening(self) -> Iterator[None]:
        """Raise Stopped when a signal arrives, or at once if one has arrived.

        If Blender replaces or suppresses the exception, it is raised again at the end.
        """
        try:
            self._raises = True
            self.check()
            yield
        finally:
            self._raises = False
            self.check()

    def check(self) -> None:
        """Raise Stopped if a signal has arrived."""
        if self._received is not None:
            self._raised = True
            raise Stopped(self._received)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        """Record a signal; only the first one is raised, so that none interrupts the clean-up."""
        self._received = self._received or number
        if not self._raises or self._raised:
            return
        if _is_importing(frame):
            self._resend()
        else:
            self.check()

    def _ignored(self, found: sys.UnraisableHookArgs) -> None:
        """Report an exception that Python ignored, except Stopped, whose signal is sent again."""
        if isinstance(found.exc_value, Stopped):
            self._resend()
        else:
            self._hooks[0](found)

    def _printed(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        """Print an exception that no Python code catches, except Stopped, whose signal is sent again."""
        if isinstance(error, Stopped):
            self._resend()
        else:
            self._hooks[1](kind, error, trace)

    def _resend(self) -> None:
        """Send a lost signal again after a delay."""
        self._raised = False
        threading.Timer(_AGAIN, _interrupt, (self._received,)).start()


def _is_importing(frame: FrameType | None) -> bool:
    """Return True if a frame was called by Python's import system."""
    while frame is not None and frame.f_code.co_filename != _IMPORT_SYSTEM:
        frame = frame.f_back
    return frame is not None


def _interrupt(number: int) -> None:
    """Send the main thread a signal, which also interrupts waiting, except on Windows."""
    if sys.platform == "win32":
        _thread.interrupt_main(number)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, number)
