"""What cannot be baked without OpenCL is refused before anything begins."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from engine import Settings
from engine.errors import DeviceError
from engine.plan.without_opencl import without_opencl
from tests.analytic.scenes import nine_quad_room


def test_workers_need_opencl_at_the_client():
    nothing = SimpleNamespace(compute=None, missing="Install a driver.", graphics=None)
    with pytest.raises(DeviceError, match="needed for a bake by workers. Install a driver"):
        without_opencl(nothing, nine_quad_room(), replace(Settings(), scheduler="all"))
