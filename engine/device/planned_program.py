"""OpenCL programs that a bake will need, described before a device is open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .device_struct import DeviceStruct
from .opencl import cl

#: Device structs and main files of kernels/, concatenated; files include further files.
Source = tuple[str | DeviceStruct, ...]

#: Parts of a program and its build options.
ProgramParts = tuple[Source, tuple[str, ...]]


class Launch(NamedTuple):
    """First launch of a kernel; PoCL compiles a kernel for the work-group size of its launch.

    For more than 65,535 work items along an axis, PoCL compiles the kernel again (POCL's "smallgrid").

    name:       name of the kernel
    group:      work-group size along each axis
    arguments:  code of each argument, see `argument_code`
    has_many:   True for more than 65,535 work items along an axis
    """

    name: str
    group: tuple[int, ...]
    arguments: tuple[str, ...]
    has_many: bool = False


class PlannedProgram(NamedTuple):
    """Program that a bake will need.

    parts, options:  see `ComputeDevice.kernels`
    is_early:        True if direct light or its display needs it
    for_processor:   True for a CPU, False for a GPU
    launches:        first launch of each of its kernels, for a CPU
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
    """Return a code that suffices to launch a kernel with a zero argument.

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
