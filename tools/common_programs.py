"""Writes kernels/common_programs.json: the OpenCL programs that the warm-up of a graphics card asks for.

    python -m tools.common_programs

Any OpenCL device serves: it is taken for a card.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engine.device.cl_device import ComputeDevice, Source
from engine.device.devices import Devices
from engine.device.kernel import Kernel
from engine.pipeline import bake
from engine.plan.common_programs import PROGRAMS
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from engine.progress import finished
from engine.settings import Settings
from engine.warm_up import SMALL, warm_up_scene


class _Card(ComputeDevice):
    """A device that is taken for a graphics card, and notes what it is asked for."""

    processor = False

    def __init__(self) -> None:
        self.asked: list[tuple[list[str], list[str]]] = []
        super().__init__()

    def kernels(self, source: str | Source, *names: str, options: Sequence[str] = ()) -> list[Kernel]:
        parts = (source,) if isinstance(source, str) else source
        asked = [part if isinstance(part, str) else part.name for part in parts], list(options)
        if asked not in self.asked:
            self.asked.append(asked)
        return super().kernels(source, *names, options=options)


def recorded() -> list[list[list[str]]]:
    """Return the parts and the options of each program, in the order in which a warm-up asks for them."""
    devices, compute = Devices(), _Card()
    devices.compute, settings, scene = compute, Settings(**SMALL), warm_up_scene()
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(devices.on_card)
    try:
        finished(bake(devices, scene, settings, stages, SessionCache()))
    finally:
        devices.release()
    return [list(asked) for asked in compute.asked]


def main() -> None:
    """Write the file."""
    lines = ",\n".join(json.dumps(program) for program in recorded())
    PROGRAMS.write_text(f"[\n{lines}\n]\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
