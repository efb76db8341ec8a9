"""A machine without OpenCL."""

from engine.errors import DeviceError


class NoCompute:
    """Compute device whose context cannot be opened; a replacement of `devices.ComputeDevice`."""

    def __init__(self, *_arguments: object, **_options: object) -> None:
        raise DeviceError("There is no OpenCL device. Install one.")
