"""Builds what most bakes need before the first one is asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from .scene.model import Light
from .self_test import furnace
from .session import warm_up as bake_and_forget
from .settings import Settings

#: As most bakes are, but small.
_SMALL: dict[str, Any] = {"resolution": 53, "samples": 64, "hemicube": 16, "intermediates": False}


def warm_up(settings: dict[str, Any]) -> None:
    """Open the devices that settings choose, and build shaders and kernels, in the session of this process.

    settings: values of `Settings` by name
    """
    lamp = Light("Lamp", "point", np.full(3, 0.5), np.eye(3), np.ones(3, np.float32))
    bake_and_forget(furnace((lamp,)), Settings(**settings | _SMALL))
