"""OpenCL programs that most bakes need, listed before the bake needs the first kernel."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from ..device.planned_program import Launch, PlannedProgram
from ..direct.emitters import EMITTER
from ..direct.light_tree import LIGHT_NODE
from ..direct.modulation import MODULATION
from ..scene.cutouts import has_cutouts, is_tinted
from ..scene.model import Scene
from ..settings import Settings
from ..visibility.rays.bvh import BOX, LINK
from ..visibility.rays.ray_tracer import TRANSMITTANCE, cutout_options
from ..visibility.rays.receiver_records import RECEIVER, TEXEL_STEP
from ..visibility.sample_counts import sample_bytes
from ..visibility.views.viewpoints import FRAME

#: Written by tools/common_programs.py: the programs of a GPU ("card") and of a CPU ("processor") in the order
#: of need. Of each: whether direct light needs it, parts, options, and launches of its kernels. Parts are
#: names of records, and main files of kernels/.
PROGRAMS = Path(__file__).resolve().parents[2] / "kernels" / "common_programs.json"

#: Records that kernels and host share, by the name of their struct.
_RECORDS = {
    record.name: record
    for record in (BOX, EMITTER, FRAME, LIGHT_NODE, LINK, MODULATION, RECEIVER, TEXEL_STEP, TRANSMITTANCE)
}

#: Options of narrow samples and of see-through surfaces; the latter follows another one where rays are
#: traced.
_NARROW, _TINTED, _BEFORE_CUTOUTS = "-DNARROW", "-DTINTED", "-DSTACK"

#: Number of buffers of the hierarchy and of cut-outs among the arguments of kernels that trace rays.
_HIERARCHY, _CUTOUTS = 2, 4

#: Names of the two lists: of a GPU, and of a CPU.
DEVICES = ("card", "processor")

#: Fraction of a lightmap's texels that are patches, estimated.
_COVERED = 0.75


def common_programs(scene: Scene, settings: Settings) -> list[PlannedProgram]:
    """Return the programs that a bake is about to need, of a GPU and of a CPU."""
    texels = _COVERED * len(scene.atlases) * settings.resolution**2
    tinted = is_tinted(scene)
    cutouts = cutout_options(tinted) if has_cutouts(scene) else ()
    return _listed(sample_bytes(int(texels), tinted) == 2, tinted, cutouts)


@cache
def _listed(narrow: bool, tinted: bool, cutouts: tuple[str, ...]) -> list[PlannedProgram]:
    """Return the programs for narrow, wide or tinted samples, with the options of cut-outs."""
    listed = json.loads(PROGRAMS.read_text(encoding="utf-8"))
    planned = []
    for device in DEVICES:
        for early, parts, options, launches in listed[device]:
            traced = cutouts if TRANSMITTANCE.name in parts else ()
            starts = [Launch(name, tuple(group), tuple(codes)) for name, group, codes in launches]
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
    """Return the launch of a kernel that traces rays, with the buffers for cut-outs; see `RayTracer`."""
    before, after = launch.arguments[:_HIERARCHY], launch.arguments[_HIERARCHY:]
    return launch._replace(arguments=(*before, *("b",) * (_CUTOUTS + tinted), *after))


def _fitting(options: list[str], narrow: bool, tinted: bool, cutouts: tuple[str, ...]) -> tuple[str, ...]:
    """Return options of narrow samples, without cut-outs, as a bake has them.

    What casts rays has the option of tints among those of cut-outs.
    """
    fitting = []
    for option in options:
        if option != _NARROW or narrow:
            fitting.append(option)
        elif tinted and not cutouts:
            fitting.append(_TINTED)
    for place, option in enumerate(fitting):
        if cutouts and option.startswith(_BEFORE_CUTOUTS):
            return *fitting[: place + 1], *cutouts, *fitting[place + 1 :]
    return tuple(fitting)
