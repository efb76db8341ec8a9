"""Functions that Blender calls when something happens to a file or a scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType

import bpy


class Handlers:
    """Has Blender call functions from `begin` to `end`, or inside `with`.

    functions: by the name of Blender's list of handlers that each belongs to
    """

    def __init__(self, functions: Mapping[str, Callable[..., None]]) -> None:
        self._functions = functions

    def begin(self) -> None:
        """Have them called from now on."""
        for name, function in self._functions.items():
            getattr(bpy.app.handlers, name).append(function)

    def end(self) -> None:
        """Have them called no more; another file takes all along that do not persist."""
        for name, function in self._functions.items():
            handlers = getattr(bpy.app.handlers, name)
            if function in handlers:
                handlers.remove(function)

    def __enter__(self) -> None:
        self.begin()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
