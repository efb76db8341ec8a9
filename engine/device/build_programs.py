"""What a process of `Builders` runs: it builds OpenCL programs and writes their binaries to its output.

A script that imports nothing of the engine. Its input is one JSON object: the names of platform and device,
and of each program name, source and options. Its output has a line with the name and the size of each binary,
then its bytes.
"""

import json
import os
import sys

import pyopencl as cl


def main() -> None:
    """Build one program after the other; those that cannot be built are left out."""
    request = json.load(sys.stdin.buffer)

    # What drivers print goes elsewhere.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    device = _device(request["platform"], request["device"])
    context = cl.Context([device])
    for name, source, options in request["programs"]:
        try:
            program = cl.Program(context, source).build(options, cache_dir=False)
        except cl.Error:
            continue
        (binary,) = program.get_info(cl.program_info.BINARIES)
        output.write(f"{name} {len(binary)}\n".encode() + binary)
        output.flush()


def _device(platform: str, name: str) -> cl.Device:
    """Return the first device of these names."""
    return next(
        device
        for found in cl.get_platforms()
        if found.name == platform
        for device in found.get_devices()
        if device.name == name
    )


if __name__ == "__main__":
    main()
