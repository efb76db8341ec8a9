"""Writes kernels/common_programs.json: the OpenCL programs that the warm-up asks for, on a GPU and on a CPU.

    python -m tools.common_programs

Any OpenCL device of a CPU serves: for the first list it is taken for a GPU.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.device.kernel import Kernel, SideQueue
from engine.device.opencl import cl
from engine.device.planned_program import ProgramParts, Source, argument_codes
from engine.pipeline import bake
from engine.plan.common_programs import DEVICES, NARROW, PROGRAMS
from engine.plan.rates import ray_speed
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from engine.settings import Settings
from engine.warm_up import SMALL, TYPICAL, warm_up_scene

#: Minimum number of work items along an axis of a large grid.
_MANY = 1 << 16

#: Whether direct light needs the program, parts, options, and launches: name, group, arguments of kernels,
#: and whether the grid is large.
Recorded = list[Any]


class _Recorder(ComputeDevice):
    """Device that records programs, and the first launch of each of their kernels."""

    def __init__(self) -> None:
        self.early, self.programs = True, dict[ProgramParts, Recorded]()
        super().__init__()

    def kernels(self, source: str | Source, *names: str, options: Sequence[str] = ()) -> list[Kernel]:
        launches = self._launches(source, options)
        return [
            _RecordedKernel(kernel, name, launches)
            for kernel, name in zip(super().kernels(source, *names, options=options), names, strict=True)
        ]

    @property
    def is_preparing(self) -> bool:
        return self.processor and self.early

    def beside(self, source: Source, name: str, options: Sequence[str] = ()) -> SideQueue:
        launches = self._launches(source, options)
        _, program = self._program(source, options)
        kernel = _RecordedKernel(Kernel(program, name, self.device), name, launches)
        return SideQueue(self._queue_beside, kernel)

    def _launches(self, source: str | Source, options: Sequence[str]) -> list[Any]:
        """Return the list of launches of a program."""
        parts = (source,) if isinstance(source, str) else source
        named = [part if isinstance(part, str) else part.name for part in parts]
        program = [self.early, named, list(options), []]
        launches: list[Any] = self.programs.setdefault((tuple(parts), tuple(options)), program)[3]
        return launches


class _RecordedKernel(Kernel):
    """Kernel that adds its launches with new work groups to a list."""

    def __init__(self, kernel: Kernel, name: str, launches: list[Any]) -> None:
        self.__dict__.update(kernel.__dict__)
        self._plain, self._name, self._launches = kernel, name, launches

    def __call__(
        self, queue: cl.CommandQueue, items: tuple[int, ...], group: tuple[int, ...], *arguments: object
    ) -> cl.Event:
        has_many = max(items) >= _MANY
        launch = [self._name, list(group), list(argument_codes(arguments)), has_many]
        if (self._name, list(group), has_many) not in [(one[0], one[1], one[3]) for one in self._launches]:
            self._launches.append(launch)
        return self._plain(queue, items, group, *arguments)

    def __hash__(self) -> int:
        return hash(self._plain)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _RecordedKernel) and self._plain is other._plain


class _Card(_Recorder):
    """The same device, treated as a GPU: without launches, since GPU programs are stored as binaries."""

    processor = False


def recorded() -> dict[str, list[Recorded]]:
    """Return the programs of a warm-up in the order of need, by device."""
    card, processor = (_recorded(kind) for kind in (_Card, _Recorder))
    return dict(zip(DEVICES, ([[*program[:3], []] for program in card], processor), strict=True))


def _recorded(kind: type[_Recorder]) -> list[Recorded]:
    """Return the programs that a warm-up asks a device for, with the options of 16-bit samples."""
    narrow = {_wide(program): program[2] for program in _programs_of(kind, SMALL)}
    programs = _programs_of(kind, TYPICAL)
    for program in programs:
        program[2] = narrow.get(_wide(program), program[2])
    return programs


def _wide(program: Recorded) -> tuple[tuple[str, ...], ...]:
    """Return the parts of a program, and its options for 32-bit samples."""
    return tuple(program[1]), tuple(option for option in program[2] if option != NARROW)


def _programs_of(kind: type[_Recorder], values: dict[str, Any]) -> list[Recorded]:
    """Return the programs that a bake with the given settings asks a device for."""
    devices, compute = Devices(), kind()
    # Rays: a trial of both ways would choose by the load of this machine.
    devices.compute, settings = compute, Settings(**values, visibility="rays")
    scene = warm_up_scene()
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(ray_speed(devices))
    try:
        for progress in bake(devices, scene, settings, stages, SessionCache()):
            compute.early &= progress.intermediate is None
    finally:
        devices.release()
    return list(compute.programs.values())


def main() -> None:
    """Write the file."""
    lists = [
        f'"{device}": [\n' + ",\n".join(json.dumps(program) for program in programs) + "\n]"
        for device, programs in recorded().items()
    ]
    PROGRAMS.write_text("{\n" + ",\n".join(lists) + "\n}\n", encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
