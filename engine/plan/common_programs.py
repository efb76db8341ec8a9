"""OpenCL programs that most bakes need, known before the bake needs the first kernel."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from ..device.planned_program import Launch, PlannedProgram
from ..direct.emitters import EMITTER
from ..direct.light_tree import LIGHT_NODE
from ..direct.modulation import MODULATION
from ..scene.cutouts import has_cutouts, is_angular, is_tinted
from ..scene.model import Scene
from ..settings import Settings
from ..visibility.rays.bvh import BOX, LINK
from ..visibility.rays.ray_tracer import TRANSMITTANCE, cutout_options
from ..visibility.rays.receiver_records import RECEIVER, TEXEL_STEP
from ..visibility.sample_counts import sample_bytes
from ..visibility.views.viewpoints import FRAME

#: File of tools/common_programs.py: programs of a GPU ("card") and a CPU ("processor") in the order of need.
#: Each entry holds: needed by direct light, parts, options, and launches of its kernels. Parts are names of
#: device structs and main files of kernels/.
PROGRAMS = Path(__file__).resolve().parents[2] / "kernels" / "common_programs.json"

#: Device structs by name.
_RECORDS = {
    record.name: record
    for record in (BOX, EMITTER, FRAME, LIGHT_NODE, LINK, MODULATION, RECEIVER, TEXEL_STEP, TRANSMITTANCE)
}

#: Options of 16-bit samples and of tinted surfaces; in programs that trace rays, cut-out options follow this
#: option.
NARROW, _TINTED, _BEFORE_CUTOUTS = "-DNARROW", "-DTINTED", "-DSTACK"

#: Numbers of buffers for the hierarchy and for cut-outs among the arguments of kernels that trace rays.
_HIERARCHY, _CUTOUTS = 2, 4

#: Kernel without these arguments in a program that traces rays.
_TRACES_NONE = "pack_receivers"

#: Names of the two lists: GPU and CPU.
DEVICES = ("card", "processor")

#: Estimated fraction of lightmap texels that are patches.
_COVERED = 0.75


def common_programs(scene: Scene, settings: Settings) -> list[PlannedProgram]:
    """Return the programs that a bake needs soon, for a GPU and for a CPU."""
    texels = _COVERED * len(scene.atlases) * settings.resolution**2
    tinted = is_tinted(scene)
    cutouts = cutout_options(tinted, is_angular(scene)) if has_cutouts(scene) else ()
    return _listed(sample_bytes(int(texels), tinted) == 2, tinted, cutouts)


@cache
def _listed(narrow: bool, tinted: bool, cutouts: tuple[str, ...]) -> list[PlannedProgram]:
    """Return the programs for 16-bit, 32-bit or tinted samples, with cut-out options."""
    listed = json.loads(PROGRAMS.read_text(encoding="utf-8"))
    planned = []
    for device in DEVICES:
        for early, parts, options, launches in listed[device]:
            traced = cutouts if TRANSMITTANCE.name in parts else ()
            starts = [
                Launch(name, tuple(group), tuple(codes), has_many)
                for name, group, codes, has_many in launches
            ]
            program = PlannedProgram(
                tuple(_RECORDS.get(part, part) for part in parts),
                _fitting(options, narrow, tinted, traced),
                early,
                device == DEVICES[1],
                tuple(_with_cutouts(launch, tinted) if traced else launch for launch in starts),
            )
            planned.append(program)
    return planned


def _with_cutouts(launch: Launch, tinted: bool) -> Launch:
    """Return a launch with the buffers for cut-outs added, if its kernel traces rays (see `RayTracer`)."""
    if launch.name == _TRACES_NONE:
        return launch
    before, after = launch.arguments[:_HIERARCHY], launch.arguments[_HIERARCHY:]
    return launch._replace(arguments=(*before, *("b",) * (_CUTOUTS + tinted), *after))


def _fitting(options: list[str], narrow: bool, tinted: bool, cutouts: tuple[str, ...]) -> tuple[str, ...]:
    """Return options of programs for 16-bit samples without cut-outs, adapted to a bake.

    In programs that trace rays, the tint option is one of the cut-out options.
    """
    fitting = []
    for option in options:
        if option != NARROW or narrow:
            fitting.append(option)
        elif tinted and not cutouts:
            fitting.append(_TINTED)
    for place, option in enumerate(fitting):
        if cutouts and option.startswith(_BEFORE_CUTOUTS):
            return *fitting[: place + 1], *cutouts, *fitting[place + 1 :]
    return tuple(fitting)
