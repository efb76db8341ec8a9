"""Test of the built-in functions of an OpenCL driver, and replacements of missing ones."""

from __future__ import annotations

from contextlib import suppress

from .opencl import cl
from .planned_program import Source
from .program_cache import build
from .source import program_source

#: Test kernel with built-in functions that an incomplete driver may lack, such as Mesa with a missing libclc.
_PROBE = """
__kernel void probe(__global float *x)
{
    x[get_global_id(0)] = fma(sqrt(2.0f), sin(x[0]), atan2(x[1], x[2]));
}
"""

#: Files of kernels/ with replacements.
_REPLACEMENTS: Source = ("own_builtins.cl",)


def needed_replacements(context: cl.Context) -> Source:
    """Return the files of kernels/ that programs of a driver need before their own; mostly none.

    Raises cl.Error if the driver builds the test kernel neither without nor with replacements.
    """
    try:
        build(context, _PROBE)
    except cl.Error:
        with suppress(cl.Error):
            build(context, program_source(_REPLACEMENTS) + _PROBE)
            return _REPLACEMENTS
        raise
    return ()
