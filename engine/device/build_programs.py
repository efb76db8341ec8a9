"""Script of a builder process: builds OpenCL programs and writes their binaries to its output.

It imports nothing of the engine. Its input is one JSON object: platform name, device name, and for each
program its name, source, options and launches. For each program it writes one line with the name and the size
of the binary, then the bytes.

A program with launches has no binary. PoCL compiles a kernel at its launch, for one work-group size, and
caches it in its own files. Each kernel is launched once with zeros as arguments, so that it has no work.
"""

import json
import os
import sys
from typing import Any

import numpy as np
import pyopencl as cl
from pytools import persistent_dict

#: Addition to the nice value of the process. Programs of later stages must not delay a bake that runs.
_NICE = 10

#: Number of work items along an axis from which PoCL compiles a kernel without optimizing for small grids.
_MANY = 1 << 16

#: Size in bytes of the zeroed buffer that trial launches pass for each buffer argument, and offset at which
#: the argument starts. With a count of zero, a kernel may access the element before the first.
_ROOM, _BEGIN = 32 << 20, 1 << 20


class InvokerCache(dict):
    """Replacement in memory of PyOpenCL's database of generated code; see `opencl.InvokerCache`."""

    def __init__(self, *_names: str, **_options: object) -> None:
        super().__init__()

    def store_if_not_present(self, key: tuple, value: object) -> None:
        """Store a value unless there is one."""
        self.setdefault(key, value)


def main() -> None:
    """Build the programs one after another at low priority; skip programs that fail."""
    if sys.platform != "win32":  # where the parent sets the priority
        os.nice(_NICE)
    request = json.load(sys.stdin.buffer)
    # PyOpenCL opens the database, a file in the user's cache folder, when a kernel is first used.
    database: Any = persistent_dict
    database.WriteOncePersistentDict = InvokerCache

    # Replace the standard output, so that messages of drivers do not mix with the binaries.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    device = _device(request["platform"], request["device"])
    context = cl.Context([device])
    for name, source, options, launches in request["programs"]:
        try:
            program = cl.Program(context, source).build(options, cache_dir=False)
            _launch(context, program, launches)
        except cl.Error:
            continue
        binary = b"" if launches is not None else program.get_info(cl.program_info.BINARIES)[0]
        output.write(f"{name} {len(binary)}\n".encode() + binary)
        output.flush()

    # Exit at once: PoCL's libraries may crash when they are unloaded.
    os._exit(0)


def _launch(context: cl.Context, program: cl.Program, launches: list | None) -> None:
    """Launch each kernel, which compiles it for its work-group size and kind of grid; raises cl.Error."""
    if not launches:
        return
    queue = cl.CommandQueue(context)
    room = cl.Buffer(context, cl.mem_flags.READ_WRITE, _ROOM)
    zeros = room.get_sub_region(_BEGIN, _ROOM - _BEGIN)
    for name, group, codes, has_many in launches:
        cl.enqueue_fill_buffer(queue, room, np.int8(0), 0, _ROOM)
        kernel = cl.Kernel(program, name)
        kernel.set_arg_types([_type(code) for code in codes])
        groups = -(-_MANY // group[0]) if has_many else 1
        kernel(queue, (groups * group[0], *group[1:]), tuple(group), *(_zero(code, zeros) for code in codes))
        queue.finish()


def _type(code: str) -> np.dtype | None:
    """Return the NumPy type of an argument from its code; None for buffers and local memory.

    See `planned_program.argument_code`.
    """
    if code[0] in "bl":
        return None
    return np.dtype((np.void, int(code[1:]))) if code[0] == "v" else np.dtype(code)


def _zero(code: str, zeros: cl.Buffer) -> object:
    """Return an argument with value zero."""
    if code == "b":
        return zeros
    if code[0] == "l":
        return cl.LocalMemory(int(code[1:]))
    return np.zeros(int(code[1:]), np.uint8) if code[0] == "v" else np.dtype(code).type(0)


def _device(platform: str, name: str) -> cl.Device:
    """Return the first device with these platform and device names."""
    return next(
        device
        for found in cl.get_platforms()
        if found.name == platform
        for device in found.get_devices()
        if device.name == name
    )


if __name__ == "__main__":
    main()
