"""OpenCL programs that a bake is about to need, described before a device is open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .device_struct import DeviceStruct
from .opencl import cl

#: Records and main files of kernels/, one after another; files include what they need.
Source = tuple[str | DeviceStruct, ...]

#: Parts of a program, and its build options.
ProgramParts = tuple[Source, tuple[str, ...]]


class Launch(NamedTuple):
    """First launch of a kernel: PoCL compiles a kernel for the work group that it is launched with.

    name       of the kernel
    group      work items of a group along each axis
    arguments  a code for each argument, see `argument_code`
    """

    name: str
    group: tuple[int, ...]
    arguments: tuple[str, ...]


class PlannedProgram(NamedTuple):
    """A program that a bake is about to need.

    parts, options  of the source, see `ComputeDevice.kernels`
    is_early        True if direct light is computed or displayed with it
    for_processor   True for the program that a CPU uses, False for that of a GPU
    launches        first launch of each of its kernels, for a CPU
    """

    parts: Source
    options: tuple[str, ...] = ()
    is_early: bool = True
    for_processor: bool = False
    launches: tuple[Launch, ...] = ()

    @property
    def key(self) -> ProgramParts:
        """Parts and options, which identify the program."""
        return self.parts, self.options


def argument_code(argument: object) -> str:
    """Return what a kernel must know of an argument to be launched with an empty one.

    "b" for a buffer, "l" and the bytes of local memory, "v" and the bytes of a vector, else a NumPy dtype.
    """
    if isinstance(argument, cl.LocalMemory):
        return f"l{argument.size}"
    if isinstance(argument, np.generic):
        return argument.dtype.str[1:]
    return f"v{argument.nbytes}" if isinstance(argument, np.ndarray) else "b"


def argument_codes(arguments: Sequence[Any]) -> tuple[str, ...]:
    """Return the codes of the arguments of a kernel."""
    return tuple(argument_code(argument) for argument in arguments)
