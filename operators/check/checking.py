"""Runs all checks of a scene one after the other, in short slices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...engine.device.device_info import DeviceSurvey
from ...engine.errors import SceneError, SettingsError
from ...engine.plan.estimate import Estimate, estimate
from ...engine.plan.rates import surveyed_speed
from ...engine.plan.stages import COVERAGE, Extent
from ...engine.settings import Settings
from ..bake_settings import read_settings
from ..devices import finder
from ..lightmap_size import expected_width
from ..original_slots import shown_materials
from ..scene import SceneContext, visible_meshes
from ..scene.bake_targets import target_uids
from ..scene.materials.tint_nodes import may_tint
from ..scene.objects.visible import visible_objects
from ..scene.probe_volumes import count_probes
from ..scene.reflection_spheres import count_spheres
from ..scene.slice_timer import Slices
from ..worker_manager import owner
from .faces import centres_of, check_coordinates, check_faceless, check_normals, check_scale, check_zero_area
from .finding import ERROR, INFO, WARNING, Checked, Finding
from .meshes import CheckedMesh, read_meshes
from .scene import check_differences, check_images, check_levels, check_light
from .uvs import (
    ChartsOf,
    check_kept,
    check_missing,
    check_moved,
    check_overlaps,
    check_places,
    check_unneeded,
    check_widths,
    find_charts,
)

#: Order of severities, worst first.
_ORDER = (ERROR, WARNING, INFO)


def check_scene(context: SceneContext) -> Slices[Checked]:
    """Check a scene without changing it; yields every few milliseconds.

    Raises SceneError if the scene is deleted in between.
    """
    try:
        width = expected_width(context, visible_meshes(context))
        settings = replace(read_settings(context.scene.hemibake), resolution=width)
    except SettingsError as error:
        return Checked((Finding(ERROR, str(error)),), None)
    yield None
    try:
        targets = target_uids(context, context.scene.hemibake.target)
        findings = []
    except SceneError as error:
        targets, findings = set(), [Finding(ERROR, str(error))]
    yield None
    findings += yield from _check_scene(context)
    meshes = yield from read_meshes(context, visible_meshes(context))
    if not meshes:
        findings.append(
            Finding(ERROR, "There is no mesh with faces to bake. Add one, or set its role to Baked.")
        )
    findings += check_faceless(visible_meshes(context), meshes)
    centres = centres_of(visible_objects(context))
    yield None
    meshes, broken = yield from check_coordinates(meshes)
    findings += broken
    meshes, flat = yield from check_zero_area(meshes)

    # Other meshes have places in the atlases, too, but only baked ones need usable charts.
    baked = [mesh for mesh in meshes if mesh.uid in targets]
    charts = yield from find_charts(meshes, settings.resolution)
    charts = [one for one in charts if one.mesh.uid in targets]
    findings += flat
    findings += yield from _check_uvs(context, meshes, baked, charts, settings.resolution)
    findings += yield from check_normals(meshes, centres)
    findings += check_scale(meshes)
    extent = _extent(context, sum(len(mesh.triangles) for mesh in meshes))
    expected = _expect(baked, charts, settings, extent) if baked else None
    findings += _check_memory(expected, settings, finder.found) if expected else []
    findings = [_with_memory(finding, baked, charts, settings, extent) for finding in findings]
    ordered = sorted(findings, key=lambda finding: _ORDER.index(finding.severity))
    return Checked(tuple(ordered), expected)


def _check_uvs(
    context: SceneContext,
    meshes: list[CheckedMesh],
    baked: list[CheckedMesh],
    charts: list[ChartsOf],
    resolution: int,
) -> Slices[list[Finding]]:
    """Return findings on lightmap UVs: of the baked ones of all meshes, and of their charts."""
    properties = context.scene.hemibake
    findings = [*check_missing(baked), *check_kept(baked, properties.meshes == "RENDER")]
    findings += [*check_moved(meshes), *check_levels(context, resolution)]
    findings += yield from check_overlaps(charts, properties.uv_layer)
    findings += yield from check_places(charts, resolution)
    findings += yield from check_widths(charts, resolution)
    return findings


def _extent(context: SceneContext, triangles: int) -> Extent:
    """Return the extent of a scene with a number of triangles, without its lightmaps."""
    lamps = sum(obj.type == "LIGHT" for obj in visible_objects(context))
    tinted, probes, cubes = _is_tinted(context), count_probes(context), count_spheres(context)
    return Extent(0, triangles, lamps, tinted=tinted, probes=probes, cubes=cubes)


def _is_tinted(context: SceneContext) -> bool:
    """Return True if an object that a bake reads may tint transmitted light."""
    objects = (obj for obj in visible_objects(context) if hasattr(obj.data, "materials"))
    worn = {
        material for obj in objects for material in shown_materials(obj.data, obj, context.material_override)
    }
    return any(map(may_tint, worn))


def _check_scene(context: SceneContext) -> Slices[list[Finding]]:
    """Return findings on hidden objects, missing images, missing light and settings."""
    findings = [*check_differences(context)]
    if not context.scene.hemibake.uv_layer:
        findings.append(Finding(ERROR, "The lightmap UV layer has no name. Choose one under Advanced."))
    yield None
    findings += check_unneeded(context.scene.objects)
    yield None
    findings += check_light(visible_objects(context), context.world, context.material_override)
    yield None
    findings += check_images(visible_objects(context), context.world, context.material_override)
    yield None
    return findings


def _expect(
    meshes: Sequence[CheckedMesh], charts: Sequence[ChartsOf], settings: Settings, extent: Extent
) -> Estimate:
    """Estimate the bake of these meshes, without the few patches of occluders.

    charts:  charts of the meshes that have usable ones
    extent:  size of the scene without its atlases
    """
    texels = settings.resolution**2
    placed = [one for one in charts if one.place is not None]
    areas = [one.charted.flat_area * one.place.scale**2 for one in charts if one.place is not None]
    patches = sum(areas, 0.0) * texels

    # Meshes without a place get new UVs that fill one atlas for each name (linked meshes get no UVs). Tiles
    # have the same density as other charts.
    new = {mesh.atlas for mesh in meshes if mesh.uvs is None and mesh.editable}
    tiled = [one for one in charts if one.mesh.several]
    surface = sum(one.charted.surface for one in placed)
    if surface > 0:
        patches += patches / surface * sum(one.charted.surface for one in tiled)
    elif tiled:
        patches += COVERAGE * texels
    patches += len(new) * COVERAGE * texels
    atlases = len({one.mesh.atlas for one in placed}) + len(new) + bool(tiled)
    return estimate(
        replace(extent, atlases=atlases),
        round(patches),
        settings,
        owner.paces,
        owner.preparation_seconds,
        surveyed_speed(finder.found),
    )


def _check_memory(expected: Estimate, settings: Settings, survey: DeviceSurvey | None) -> list[Finding]:
    """Return a warning if visibility data needs more memory than allowed, as far as that is known."""
    needs = _memory_over_limit(expected, settings, survey)
    if not needs:
        return []
    remedy = (
        "The bake will use texel groups or recompute visibility. Lower Resolution or Quality, or raise "
        "Visibility Memory in the preferences"
    )
    return [Finding(WARNING, f"{needs}. {remedy}.")]


def _with_memory(
    finding: Finding,
    meshes: Sequence[CheckedMesh],
    charts: Sequence[ChartsOf],
    settings: Settings,
    extent: Extent,
) -> Finding:
    """Add to a finding that sets a resolution whether that one needs more memory than allowed."""
    if finding.fix != "resolution" or not meshes:
        return finding
    larger = replace(settings, resolution=finding.value)
    needs = _memory_over_limit(_expect(meshes, charts, larger, extent), larger, finder.found)
    if not needs:
        return finding
    sentences, newline, names = finding.text.partition("\n")
    return replace(
        finding, text=f"{sentences} At a width of {finding.value} texels: {needs}.{newline}{names}"
    )


def _memory_over_limit(expected: Estimate, settings: Settings, survey: DeviceSurvey | None) -> str:
    """Return a text with needed and allowed memory; empty if it suffices or is unknown."""
    budget = settings.memory_budget or (_device_memory(survey) // 2)
    if not budget or expected.sample_bytes <= budget:
        return ""
    needed, limit = (f"{size / 2**30:.2g} GiB" for size in (expected.sample_bytes, budget))
    return f"Visibility data needs {needed}; the limit is {limit}"


def _device_memory(survey: DeviceSurvey | None) -> int:
    """Return the memory of the OpenCL device that bakes, bytes; 0 if it is not known yet."""
    devices = survey.devices if survey else ()
    return max((device.memory for device in devices if device.api == "OpenCL" and device.use), default=0)
