"""OpenCL programs that most bakes by a graphics card need, known before the first kernel is asked for."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from ..device.cl_device import ProgramParts
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

#: Made by tools/common_programs.py: parts and options of each program, in the order in which a bake asks for
#: them. Parts are records by the names of their structs, and main files of kernels/.
PROGRAMS = Path(__file__).resolve().parents[2] / "kernels" / "common_programs.json"

#: Records that kernels and host share, by the name of their struct.
_RECORDS = {
    record.name: record
    for record in (BOX, EMITTER, FRAME, LIGHT_NODE, LINK, MODULATION, RECEIVER, TEXEL_STEP, TRANSMITTANCE)
}

#: Options of narrow samples and of see-through surfaces; the latter follows another one where rays are
#: traced.
_NARROW, _TINTED, _BEFORE_CUTOUTS = "-DNARROW", "-DTINTED", "-DSTACK"

#: Texels of a lightmap that patches are on, about.
_COVERED = 0.75


def common_programs(scene: Scene, settings: Settings) -> list[ProgramParts]:
    """Return the parts and the options of programs that a bake by a graphics card is about to need."""
    texels = _COVERED * len(scene.atlases) * settings.resolution**2
    tinted = is_tinted(scene)
    cutouts = cutout_options(tinted) if has_cutouts(scene) else ()
    return _listed(sample_bytes(int(texels), tinted) == 2, tinted, cutouts)


@cache
def _listed(narrow: bool, tinted: bool, cutouts: tuple[str, ...]) -> list[ProgramParts]:
    """Return what `common_programs` does, for narrow, wide or tinted samples.

    With the options of cut-outs.
    """
    listed = json.loads(PROGRAMS.read_text(encoding="utf-8"))
    return [
        (
            tuple(_RECORDS.get(part, part) for part in parts),
            _fitting(options, narrow, tinted, cutouts if TRANSMITTANCE.name in parts else ()),
        )
        for parts, options in listed
    ]


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
