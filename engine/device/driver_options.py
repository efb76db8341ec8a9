"""Options that drivers of OpenCL read from the environment once they are loaded."""

from __future__ import annotations

import os

#: Intel's driver for processors joins work items to vectors: with that, kernels return NaN on an AMD EPYC
#: (2026.2), or shadows that are not there; without it, what PoCL's do, and they are built in less time.
_OPTIONS = {"CL_CONFIG_CPU_VECTORIZER_MODE": "1"}


def set_driver_options() -> None:
    """Set what the user has not set."""
    for name, value in _OPTIONS.items():
        os.environ.setdefault(name, value)
