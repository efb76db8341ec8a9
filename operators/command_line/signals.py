"""Ctrl+C and a request to end, as an exception that nobody swallows."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


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
    """

    def __init__(self) -> None:
        self._received: int | None = None
        self._raises = False

    def __enter__(self) -> Signals:
        for number in _SIGNALS:
            signal.signal(number, self._receive)
        return self

    def __exit__(self, *_: object) -> None:
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
            raise Stopped(self._received)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        first, self._received = self._received is None, self._received or number
        if first and self._raises:
            raise Stopped(number)
