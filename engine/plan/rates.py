"""Rates of devices: bounds of drawing hemicubes, and a guess of the speed of casting rays."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..device.cpu_renderers import draws_on_cpu
from ..device.device_info import DeviceSurvey
from ..json_file import read_json, write_json

if TYPE_CHECKING:
    from ..device.devices import Devices

#: Triangles per second that no graphics card, and no driver that draws on the CPU, exceeds (chosen; llvmpipe
#: draws 1.7e6 on two busy cores).
_CARD_TRIANGLES, _CPU_TRIANGLES = 5e10, 5e7

#: Approximate speed of casting rays relative to OpenCL on a CPU: on a GPU, and by OpenGL on a CPU (measured
#: with llvmpipe and PoCL in the Cornell box of 512 x 512 texels).
_CARD_RAYS, _CPU_SHADER_RAYS = 500.0, 0.25


def ray_speed(devices: Devices) -> float:
    """Return the approximate speed of casting rays on the open devices, relative to OpenCL on a CPU."""
    if devices.compute is not None:
        return 1.0 if devices.compute.processor else _CARD_RAYS
    return _CPU_SHADER_RAYS if draws_on_cpu(devices.graphics.name) else _CARD_RAYS


def surveyed_speed(survey: DeviceSurvey | None) -> float:
    """Return the same speed for surveyed devices; 1 with OpenCL, and before any survey (None)."""
    used = [device for device in survey.devices if device.use] if survey else []
    if not used or any(device.api == "OpenCL" for device in used):
        return 1.0
    return _CPU_SHADER_RAYS if draws_on_cpu(used[0].name) else _CARD_RAYS


def hemicubes_bound(device: str, triangles: int) -> float:
    """Return an upper bound of the hemicubes drawn per second; each draws every triangle once.

    device: name of the OpenGL renderer
    """
    return (_CPU_TRIANGLES if draws_on_cpu(device) else _CARD_TRIANGLES) / max(1, triangles)


class DrawingRates:
    """Maximum rates at which a device drew hemicubes of one width, texels per second, in a file.

    Rates are stored by the power of two of the scene's triangles. Fewer triangles draw no slower, so the
    lowest rate of smaller scenes bounds the rate of a scene. An unreadable file counts as empty.

    folder:    folder of the file; None for no file
    device:    name of the OpenGL renderer
    hemicube:  width of the hemicubes, texels
    """

    def __init__(self, folder: str | None, device: str, hemicube: int) -> None:
        self._path = None if folder is None else Path(folder) / "drawing_rates.json"
        self._name = f"{device}, {hemicube}"

    def bound(self, triangles: int) -> float:
        """Return the expected maximum drawing rate in a scene, texels per second; infinity if unknown."""
        known = self._known().get(self._name, {})
        rates = [rate for size, rate in known.items() if int(size) <= triangles.bit_length()]
        return min(rates, default=math.inf)

    def record(self, triangles: int, rate: float) -> None:
        """Record a measured drawing rate, texels per second."""
        if self._path is None:
            return
        known = self._known()
        rates, size = known.setdefault(self._name, {}), str(triangles.bit_length())
        rates[size] = max(rate, rates.get(size, 0.0))
        with suppress(OSError):
            write_json(self._path, known)

    def _known(self) -> dict[str, dict[str, float]]:
        """Return the rates by device and hemicube width, then by bit length of the number of triangles."""
        with suppress(ValueError, AttributeError, TypeError):
            return {
                name: {str(int(size)): float(rate) for size, rate in rates.items()}
                for name, rates in read_json(self._path).items()
            }
        return {}
