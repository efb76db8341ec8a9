"""OpenGL context for drawing."""

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
    "win32": "Install the current driver of your GPU.",
    "darwin": "OpenGL 4.1 is part of macOS 10.9 and later; update the system.",
}

#: OpenGL versions: the version that the engine uses if available, and the minimum.
_WANTED, _NEEDED = 450, 410


class GraphicsContext:
    """Standalone OpenGL 4.1+ context with its capabilities.

    computes:        True if it has compute shaders
    indirect:        True if it takes draw commands from a buffer
    reversed_depth:  True if depth runs from 1 (near) to 0

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

        # Compute shaders and indirect draws both require OpenGL 4.3.
        self.computes = self.indirect = self.context.version_code >= 430

        # Reversed depth keeps its precision at all distances; it requires OpenGL 4.5.
        self.reversed_depth = self.context.version_code >= 450 and "glClipControl" in self.raw
        if self.reversed_depth:
            self.raw("glClipControl", LOWER_LEFT, ZERO_TO_ONE)

    def use(self) -> None:
        """Make the context current, in case another context of this process is."""
        self.context.__enter__()

    def check(self, task: str) -> None:
        """Raise DeviceError with the task's name if OpenGL has reported an error since the last check."""
        error = self.context.error
        if error == "GL_OUT_OF_MEMORY":
            raise DeviceMemoryError(
                f"The memory of '{self.name}' is full: {task} failed. Lower the resolution, bake fewer "
                "objects at once, or close programs that use the GPU."
            )
        if error != "GL_NO_ERROR":
            raise DeviceError(
                f"OpenGL of '{self.name}' reports {error}: {task} failed. Update the graphics driver, or "
                "set Visibility Tests to Rays, which draws the least."
            )

    def program(self, name: str, stages: Sequence[str], features: Sequence[str] = ()) -> moderngl.Program:
        """Link shaders/<name>.<stage> for the stages vert, geom and frag, or reuse an unused program.

        features:  macros that are defined in all stages, in capitals; see `shader_source`
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
        """Return the program of shaders/<name>.comp: one of an earlier bake that is free, or a new one.

        The context must support compute shaders, see `computes`.

        records:  structs that the shader reads; structs of one name must have the same fields
        """
        program: moderngl.ComputeShader = self._unused(
            (name, tuple(features)),
            lambda: self.context.compute_shader(shader_source(f"{name}.comp", features, records)),
        )
        return program

    def _unused(self, key: tuple, build: Callable[[], Any]) -> Any:
        """Return a program that no other caller uses: one of an earlier bake, or a new one."""
        built, taken = self._programs.setdefault(key, []), self._taken.get(key, 0)
        if taken == len(built):
            built.append(build())
        self._taken[key] = taken + 1
        return built[taken]

    def discard(self, *resources: Any) -> None:
        """Release ModernGL objects; unbinds their framebuffers."""
        self._parking.use()
        for resource in resources:
            resource.release()

    def collect(self) -> None:
        """Release ModernGL objects that nothing refers to, except programs."""
        self._parking.use()
        while self.context.objects:
            unused = self.context.objects.popleft()
            if hasattr(unused, "release"):
                unused.release()
        self.raw.delete_unused()

    def clear(self) -> None:
        """Release the data of the last bake; keep its programs for the next."""
        self.collect()
        self._taken.clear()

    def release(self) -> None:
        """Destroy the context and all of its objects."""
        self.context.release()


def _create_context() -> moderngl.Context:
    """Return a context of the wanted version if possible; drivers may give exactly the requested one."""
    options: dict[str, str] = {}
    if sys.platform.startswith("linux"):
        options = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    with suppress(Exception):
        return moderngl.create_context(require=_WANTED, standalone=True, **options)
    return moderngl.create_context(require=_NEEDED, standalone=True, **options)
