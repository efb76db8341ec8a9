"""The OpenGL context the engine draws with."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import moderngl

from ..errors import DeviceError, DeviceMemoryError
from .device_struct import DeviceStruct
from .raw_gl import LOWER_LEFT, ZERO_TO_ONE, RawGL
from .source import shader_source

_REMEDY = {
    "linux": "Install a graphics driver; on Debian or Ubuntu: apt install libegl1 libgl1 libgl1-mesa-dri.",
    "win32": "Install the current driver of your graphics card.",
    "darwin": "OpenGL 4.1 is part of macOS 10.9 and later; update the system.",
}

#: OpenGL versions: what the engine makes use of, and what it needs.
_WANTED, _NEEDED = 450, 410


class GraphicsContext:
    """A standalone OpenGL 4.1+ context and what it can do.

    computes        it has compute shaders
    indirect        it takes draw commands from a buffer
    reversed_depth  depth runs from 1, near, to 0
    Raises DeviceError if no driver offers one.
    """

    def __init__(self) -> None:
        try:
            self.context = _create_context()
        except Exception as error:
            remedy = _REMEDY.get(sys.platform, "Install a graphics driver.")
            raise DeviceError(f"No OpenGL 4.1 driver could be started ({error}). {remedy}") from error
        self.raw = RawGL()
        self._parking = self.context.simple_framebuffer((1, 1))
        self.name: str = self.context.info["GL_RENDERER"]
        self._programs: dict[tuple, list] = {}
        self._taken: dict[tuple, int] = {}
        self.context.gc_mode = "context_gc"

        # Compute shaders and draws whose commands lie in a buffer came together, with OpenGL 4.3.
        self.computes = self.indirect = self.context.version_code >= 430

        # Reversed depth keeps its precision at every distance; it needs OpenGL 4.5.
        self.reversed_depth = self.context.version_code >= 450 and "glClipControl" in self.raw
        if self.reversed_depth:
            self.raw("glClipControl", LOWER_LEFT, ZERO_TO_ONE)

    def use(self) -> None:
        """Make the context current: something else in this process may have made another so."""
        self.context.__enter__()

    def check(self, task: str) -> None:
        """Raise a DeviceError if OpenGL has failed since the last check; the message says at what task."""
        error = self.context.error
        if error == "GL_OUT_OF_MEMORY":
            raise DeviceMemoryError(
                f"The memory of '{self.name}' is full: {task} failed. Lower the resolution, bake fewer "
                "objects at once, or close programs that use the graphics card."
            )
        if error != "GL_NO_ERROR":
            raise DeviceError(
                f"OpenGL of '{self.name}' reports {error}: {task} failed. Update the graphics driver, or "
                'choose "rays" for visibility, which draw the least.'
            )

    def program(self, name: str, stages: Sequence[str], features: Sequence[str] = ()) -> moderngl.Program:
        """Link shaders/<name>.<stage> of the stages vert, geom and frag, or take an unused one.

        features  defined in capitals in all stages; see `shader_source`
        """
        key = (name, tuple(stages), tuple(features))
        program: moderngl.Program = self._unused(key, lambda: self._link(*key))
        return program

    def _link(self, name: str, stages: Sequence[str], features: Sequence[str]) -> moderngl.Program:
        keyword = {"vert": "vertex_shader", "geom": "geometry_shader", "frag": "fragment_shader"}
        sources = {keyword[stage]: shader_source(f"{name}.{stage}", features) for stage in stages}
        return self.context.program(**sources)

    def compute_program(
        self, name: str, features: Sequence[str] = (), records: Sequence[DeviceStruct] = ()
    ) -> moderngl.ComputeShader:
        """Build shaders/<name>.comp, or take one that no one uses; needs `computes`.

        records: structs that the shader reads; a name stands for one layout
        """
        program: moderngl.ComputeShader = self._unused(
            (name, tuple(features)),
            lambda: self.context.compute_shader(shader_source(f"{name}.comp", features, records)),
        )
        return program

    def _unused(self, key: tuple, build: Callable[[], Any]) -> Any:
        """Return a program of its own for everyone who asks; those of earlier bakes are used again."""
        built, taken = self._programs.setdefault(key, []), self._taken.get(key, 0)
        if taken == len(built):
            built.append(build())
        self._taken[key] = taken + 1
        return built[taken]

    def discard(self, *resources: Any) -> None:
        """Release ModernGL objects; no framebuffer of theirs stays bound."""
        self._parking.use()
        for resource in resources:
            resource.release()

    def collect(self) -> None:
        """Release what nobody refers to any more; programs stay."""
        self._parking.use()
        while self.context.objects:
            unused = self.context.objects.popleft()
            if hasattr(unused, "release"):
                unused.release()
        self.raw.delete_unused()

    def clear(self) -> None:
        """Release what the last bake left; its programs are the next one's."""
        self.collect()
        self._taken.clear()

    def release(self) -> None:
        """Destroy the context and everything made in it."""
        self.context.release()


def _create_context() -> moderngl.Context:
    """Return a context of the version wanted, if there is one: drivers may give no more than asked for."""
    options: dict[str, str] = {}
    if sys.platform.startswith("linux"):
        options = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    with suppress(Exception):
        return moderngl.create_context(require=_WANTED, standalone=True, **options)
    return moderngl.create_context(require=_NEEDED, standalone=True, **options)
