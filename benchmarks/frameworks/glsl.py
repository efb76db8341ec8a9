"""GLSL compute shaders, by ModernGL."""

from __future__ import annotations

import moderngl
import numpy as np

from engine.device.gl_context import GraphicsContext

from .framework import MissingError
from .kernel_texts import KernelText, glsl_text


class GLSL:
    """See `framework.Framework`; raises MissingError without compute shaders."""

    name = "GLSL"

    def __init__(self) -> None:
        graphics = GraphicsContext()
        if not graphics.computes:
            raise MissingError("OpenGL has no compute shaders")
        self._context, self.device = graphics.context, graphics.name

    def upload(self, values: np.ndarray) -> moderngl.Buffer:
        """Return memory of the device with the bits of an array."""
        return self._context.buffer(values)

    def refill(self, memory: moderngl.Buffer, values: np.ndarray) -> None:
        """Copy an array of the same size to the device, and wait for it."""
        memory.write(values)
        self._context.finish()

    def download(self, memory: moderngl.Buffer, shape: tuple[int, ...]) -> np.ndarray:
        """Return float32 from the device in a shape."""
        self._context.memory_barrier()
        return np.frombuffer(memory.read(), np.float32).reshape(shape)

    def build(self, kernel: KernelText, items: int) -> tuple[moderngl.ComputeShader, str]:
        """Return a kernel for groups of `items`."""
        return self._context.compute_shader(glsl_text(kernel, items)), kernel.count

    def start(
        self,
        built: tuple[moderngl.ComputeShader, str],
        groups: int,
        inputs: tuple,
        result: moderngl.Buffer,
        count: int,
    ) -> None:
        """Start a kernel; do not wait for it."""
        shader, name = built
        for binding, memory in enumerate((*inputs, result)):
            memory.bind_to_storage_buffer(binding)
        if name in shader:
            shader[name] = count
        shader.run(groups)

    def finish(self) -> None:
        """Wait until all that was started is done."""
        self._context.finish()
