"""Registration of functions in Blender's application handlers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType

import bpy


class Handlers:
    """Functions registered in Blender's handlers between `begin` and `end`, or inside `with`.

    functions: function by name of Blender's handler list, such as "undo_post"
    """

    def __init__(self, functions: Mapping[str, Callable[..., None]]) -> None:
        self._functions = functions

    def begin(self) -> None:
        """Register the functions."""
        for name, function in self._functions.items():
            getattr(bpy.app.handlers, name).append(function)

    def end(self) -> None:
        """Unregister the functions. Loading a file has already removed functions that are not persistent."""
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
