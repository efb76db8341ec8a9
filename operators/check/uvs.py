"""Checks lightmap UVs: missing, overlapping, displaced, or with too few texels."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..lookup import find
from ..result.moved_charts import MOVED_CHARTS
from ..scene.overlap_layout import make_footprints, separate_overlaps
from ..scene.slice_timer import Slices
from ..scene.uv_transform import Charted, UvTransform, make_charted
from ..scene.uvs.coverage_grid import LARGEST_GRID, CoverageGrid, make_footprint
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.uv_faults import is_finite
from ..scene.uvs.uv_modifier import uv_modifiers
from ..scene.uvs.uv_targets import is_usable_layer
from .finding import ERROR, INFO, WARNING, Checked, Finding, found
from .meshes import CheckedMesh

#: Smallest mean chart width in texels that can show light, and largest resolution that is suggested.
_NARROWEST, _LARGEST = 1.0, 16384

#: UVs at both ends of an edge count as equal if they differ by less than this.
_SAME_UV = 1e-5

Steps = Slices[list[Finding]]


@dataclass(frozen=True)
class ChartsOf:
    """The charts of a mesh.

    charted:    the charts themselves
    footprint:  cells of the atlas that they cover; None for charts outside 0-1
    place:      their place in the atlas; None if there is no room, and for meshes with several users, which
                use tiles
    """

    mesh: CheckedMesh
    charted: Charted
    footprint: CoverageGrid | None
    place: UvTransform | None


def check_missing(meshes: Sequence[CheckedMesh]) -> list[Finding]:
    """Return findings on meshes without lightmap UVs, or with UVs that are not finite."""
    missing = [mesh for mesh in meshes if mesh.uvs is None and not mesh.outdated]
    spoilt = [mesh.name for mesh in meshes if mesh.uvs is not None and not is_finite(mesh.uvs)]
    return [
        *found(
            ERROR,
            "NaN or infinite lightmap UVs: {} would get no lightmap. Unwrap again.",
            spoilt,
            "unwrap_again",
        ),
        *found(
            ERROR,
            "Linked from another file and without lightmap UVs: {}. Unwrap in that file, override, or apply "
            "modifiers on a copy.",
            [mesh.name for mesh in missing if not mesh.editable],
            "apply_on_copy",
        ),
        *found(
            INFO,
            "No lightmap UVs yet: {}. The bake makes them.",
            [mesh.name for mesh in missing if mesh.editable],
            fix="unwrap",
        ),
    ]


def check_kept(meshes: Sequence[CheckedMesh], as_rendered: bool) -> list[Finding]:
    """Return findings on meshes whose UV modifier no longer fits the faces of the viewport or of renders.

    as_rendered:  True if the meshes of renders are baked
    """
    effect = (
        "The viewport's lightmap UVs are projected from the faces of renders, so its light may be off."
        if as_rendered
        else "Only the viewport's faces have lightmap UVs: renders may show no lightmap."
    )
    outdated = [mesh for mesh in meshes if mesh.outdated]
    return [
        *found(
            ERROR,
            "Linked from another file, with modifiers whose result has changed since lightmap UVs were made: "
            "{}. Unwrap in that file, override, or apply modifiers on a copy.",
            [mesh.name for mesh in outdated if not mesh.editable],
            "apply_on_copy",
        ),
        *found(
            INFO,
            "The result of modifiers has changed since lightmap UVs were made: {}. The bake makes new ones.",
            [mesh.name for mesh in outdated if mesh.editable],
            "unwrap",
        ),
        *found(
            WARNING,
            f"Modifiers have other settings in renders than in the viewport: {{}}. {effect} Use the same "
            "settings.",
            [mesh.name for mesh in meshes if mesh.unlike and mesh.editable],
            "show_as_rendered",
        ),
    ]


def check_moved(meshes: Sequence[CheckedMesh]) -> list[Finding]:
    """Return a finding on meshes whose lightmap was baked with other lightmap UVs."""
    return found(WARNING, MOVED_CHARTS, [mesh.name for mesh in meshes if mesh.moved])


def without_moved(checked: Checked, baked: Collection[str]) -> Checked:
    """Remove from a check's result the findings on moved charts of objects that were baked since."""
    findings: list[Finding] = []
    for finding in checked.findings:
        if finding.text.startswith(MOVED_CHARTS.partition("{}")[0]):
            findings += found(WARNING, MOVED_CHARTS, [name for name in finding.objects if name not in baked])
        else:
            findings.append(finding)
    return replace(checked, findings=tuple(findings))


def check_unneeded(objects: Sequence[bpy.types.Object]) -> list[Finding]:
    """Return a finding on objects with a UV modifier that are not baked."""
    others = [obj for obj in objects if obj.hemibake.role != "BAKED" and obj.is_editable]
    return found(
        INFO,
        "A modifier keeps lightmap UVs of {}, which gets no lightmap. Remove the modifier.",
        [obj.name for obj in others if uv_modifiers(obj)],
        "remove_uv_modifiers",
    )


def check_overlaps(charts: Sequence[ChartsOf], uv_layer: str) -> Steps:
    """Return findings on meshes whose charts overlap each other in their coverage grid.

    uv_layer:  the scene's lightmap UV layer
    """
    folded, copied = list[str](), list[str]()
    for one in charts:
        footprint = one.footprint or (yield from _footprint_outside(one.charted))
        if footprint.overlaps:
            (copied if _gets_modifier(one.mesh, uv_layer) else folded).append(one.mesh.name)
        yield None
    return [
        *found(
            ERROR,
            "Lightmap UVs overlap: {} would get no lightmap. Unwrap into a new UV layer.",
            folded,
            "unwrap_again",
        ),
        *found(
            INFO,
            "Modifiers copy faces with their lightmap UVs: {}. The bake adds a last modifier that stores UVs "
            "for the result.",
            copied,
            "unwrap",
        ),
    ]


def _gets_modifier(mesh: CheckedMesh, uv_layer: str) -> bool:
    """Return True if a bake adds a UV modifier, because modifiers copy a mesh's usable UVs."""
    obj = find(bpy.data.objects, mesh.uid)
    if obj is None or not (mesh.copies and mesh.editable):
        return False
    layer = lightmap_layer(obj, uv_layer)
    return layer in obj.data.uv_layers and is_usable_layer(obj.data, layer)


def _footprint_outside(charted: Charted) -> Slices[CoverageGrid]:
    """Return the covered cells of charts outside 0-1, after they are scaled into it."""
    size = max(float((charted.high - charted.low).max()), 1e-30)
    return (yield from make_footprint((charted.uvs - charted.low) / size, LARGEST_GRID))


def find_charts(meshes: Sequence[CheckedMesh], resolution: int) -> Slices[list[ChartsOf]]:
    """Return the charts of all meshes with finite lightmap UVs, with their places in the atlases."""
    atlases: dict[tuple[str, bool], list[CheckedMesh]] = {}
    for mesh in meshes:
        if mesh.uvs is not None and is_finite(mesh.uvs):
            atlases.setdefault((mesh.atlas, mesh.several), []).append(mesh)
    charts: list[ChartsOf] = []
    for (atlas, several), members in atlases.items():
        charted = yield from _all_charted(members)
        footprints = yield from make_footprints(charted, resolution)
        places: list[UvTransform | None] = [None] * len(members)
        if not several:
            places = yield from separate_overlaps(charted, footprints, atlas, resolution)
        charts += map(ChartsOf, members, charted, footprints, places)
        yield None
    return charts


def _all_charted(meshes: Sequence[CheckedMesh]) -> Slices[list[Charted]]:
    """Return the charts of each mesh."""
    charted = []
    for mesh in meshes:
        uvs, corners = mesh.uvs_of_loops[mesh.triangles], mesh.corners
        yield None
        charted.append((yield from make_charted(uvs, corners, mesh.matrix, mesh.scale)))
    return charted


def check_places(charts: Sequence[ChartsOf], resolution: int) -> Steps:
    """Return findings on meshes that get another place in the atlas or have no room, with a resolution.

    Meshes whose own charts overlap are left out: they get no lightmap, or other UVs.
    """
    usable = [one for one in charts if one.footprint is None or not one.footprint.overlaps]
    alone = [one for one in usable if not one.mesh.several]
    moved = [one.mesh.name for one in alone if one.place not in (None, UvTransform(one.mesh.atlas))]
    lost = [one.mesh for one in alone if one.place is None]
    fitting = 0
    for atlas in dict.fromkeys(mesh.atlas for mesh in lost):
        members = [one.charted for one in alone if one.mesh.atlas == atlas]
        fitting = max(fitting, (yield from _fitting_resolution(members, atlas, resolution)))
    remedy = f"Use {fitting} texels" if fitting else "Raise the resolution"
    return [
        *found(
            ERROR,
            f"No space left in the lightmap: {{}} would get no lightmap. {remedy}, or assign it to "
            "another lightmap.",
            [mesh.name for mesh in lost],
            "resolution" if fitting else "",
            fitting,
        ),
        *found(
            INFO,
            "Lightmap UVs overlap others or lie outside 0-1: {}. The bake moves them apart; the UV layers "
            "stay unchanged.",
            moved,
        ),
    ]


def _fitting_resolution(members: Sequence[Charted], atlas: str, resolution: int) -> Slices[int]:
    """Double the resolution until all charts of an atlas have room, and return it; 0 if none suffices."""
    while 2 * resolution <= _LARGEST:
        resolution *= 2
        footprints = yield from make_footprints(members, resolution)
        places = yield from separate_overlaps(members, footprints, atlas, resolution)
        if None not in places:
            return resolution
    return 0


def check_widths(charts: Sequence[ChartsOf], resolution: int) -> Steps:
    """Return a finding on meshes whose charts are too narrow for the lightmap, with a fitting resolution."""
    narrow: dict[str, float] = {}
    for one in charts:
        if one.place is not None:
            width = (yield from chart_width(one)) * one.place.scale * resolution
            if 0 < width < _NARROWEST:
                narrow[one.mesh.name] = width
    if not narrow:
        return []
    fitting = resolution
    while fitting * min(narrow.values()) < _NARROWEST * resolution and fitting < _LARGEST:
        fitting *= 2
    sentence = (
        f"The lightmap is too small for the charts of {{}}: they are {min(narrow.values()):.1f} texels wide "
        f"on average. Use {fitting} texels."
    )
    return found(WARNING, sentence, list(narrow), "resolution", fitting)


def chart_width(charts: ChartsOf) -> Slices[float]:
    """Return the mean width of charts in UV units: 2 * area / length of the borders.

    It is exact for long strips, and half the width for squares. Border edges have a single loop, or two loops
    with different UVs. Polygons without area have no borders.
    """
    mesh = charts.mesh
    after = np.arange(1, len(mesh.vertex) + 1)
    after[np.r_[mesh.starts[1:], len(after)] - 1] = mesh.starts
    uvs = mesh.uvs_of_loops
    step = uvs[after] - uvs
    length = np.hypot(step[:, 0], step[:, 1])
    yield None

    # Both loops of an edge list its ends in the same order. Their UVs are equal if none differs from the
    # mean.
    forward = mesh.vertex == mesh.edges[mesh.edge, 0]
    users = np.bincount(mesh.edge, minlength=len(mesh.edges))
    border = users != 2
    for first in (forward, ~forward):
        ends = np.where(first[:, None], uvs, uvs[after])
        for values in ends.T:
            yield None
            mean = np.bincount(mesh.edge, values, len(mesh.edges)) / np.maximum(users, 1)
            border[mesh.edge[np.abs(values - mean[mesh.edge]) > _SAME_UV]] = True
    covered = np.zeros(len(mesh.vertex), bool)
    covered[mesh.triangles] = True
    around = float(length[border[mesh.edge] & covered].sum())
    return 2 * charts.charted.flat_area / around if around > 0 else 0.0
