"""Notices that somebody undoes something while other work goes on."""

from __future__ import annotations

from types import TracebackType

import bpy


class UndoWatch:
    """A context manager that listens to undos.

    happened  True once there was one; whoever has looked at what it did may take it back
    """

    def __init__(self) -> None:
        self.happened = False

    def __enter__(self) -> UndoWatch:
        bpy.app.handlers.undo_post.append(self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        # Another file has taken all handlers along.
        if self._note in bpy.app.handlers.undo_post:
            bpy.app.handlers.undo_post.remove(self._note)

    def _note(self, *_: object) -> None:
        self.happened = True
