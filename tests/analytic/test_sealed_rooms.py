"""No light comes through walls, and none is lost where surfaces cut or touch each other."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Scene, Settings
from engine.scene.model import NO_LIGHTMAP
from tests.analytic.drive import drive
from tests.analytic.rooms import (
    TEXEL,
    Atlas,
    block,
    box_faces,
    floor_points,
    lamp,
    lamp_light,
    room,
    scene_of,
    shown,
)
from tests.analytic.scenes import material, quads
from tests.rows import long

SETTINGS = Settings(
    resolution=128, hemicube=16, visibility="rays", light_samples=32, max_bounces=8, texel_samples=16
)

LAMP = (0.37, 0.41, 0.61)


def floor_under_sky():
    """Return a floor of 1.6 by 0.8 m."""
    atlas = Atlas(SETTINGS.resolution)
    faces = box_faces((0, 0, 0), (1.6, 0.8, 1))[:1]
    return quads(faces, atlas.charts(faces), [0], atlas.resolution, "Floor")


def occluder(faces, name):
    """Return faces that are in no lightmap."""
    return replace(quads(faces, [(0, 0, 1, 1)] * len(faces), [0] * len(faces), 128, name), atlas=NO_LIGHTMAP)


def line(x, count=7):
    """Return points of a floor at some x along y, clear of the ends."""
    x = np.repeat(np.atleast_1d(x), count)
    return np.stack([x, np.resize(np.linspace(0.2, 0.6, count), len(x))], axis=-1)


def walled_floor(first, thickness=0.02, reflectance=0.0):
    """Return a floor of 1.6 m in a closed room, a wall across it from x = `first` on, and its scene."""
    atlas = Atlas(SETTINGS.resolution)
    hall = room(atlas, (0, 0, 0), (1.6, 0.8, 0.8), "Hall")
    wall = block(atlas, (first, -0.03, -0.03), (first + thickness, 0.83, 0.83), "Wall")
    return hall, scene_of([hall, wall], [lamp(LAMP)], reflectance)


@pytest.mark.parametrize("first", [0.813, 0.829, *map(long, (0.80, 0.807, 0.82, 0.836))])
def test_a_thin_wall_on_one_floor_parts_light_from_dark(first):
    """A wall of half a texel, wherever it stands on the texels; a unit of length is half a metre."""
    hall, scene = walled_floor(first)
    lightmap = drive(replace(scene, metres_per_unit=0.5), SETTINGS)
    (told,) = [note for note in lightmap.report.warnings if "thinner than two texels" in note]
    assert told.objects == ("Wall",) and "Use 200 texels per metre (now 50)" in told
    foot = lamp_light(LAMP, line(first - 0.001)).mean()
    behind = first + 0.02
    dark = shown(lightmap, floor_points(hall, line(np.arange(behind + TEXEL, 1.58, 0.01))))
    assert dark.max() <= 0.02 * foot
    near = shown(lightmap, floor_points(hall, line(behind + np.arange(0.0005, TEXEL, 0.003))))
    assert near.max() <= 0.13 * foot
    points = line(np.arange(0.1, first, 0.01))
    off = shown(lightmap, floor_points(hall, points)) - lamp_light(LAMP, points)
    assert np.sqrt(np.mean(off**2)) <= 0.1 * lamp_light(LAMP, points).mean()
    assert np.abs(off).mean() <= 0.05 * lamp_light(LAMP, points).mean()

    # Up to the ends of the wall, between whose sides the front of the hall's own walls is seen.
    ends = np.stack(np.meshgrid([first - 0.05], [0.015, 0.03, 0.06, 0.74, 0.77, 0.785]), -1).reshape(-1, 2)
    assert shown(lightmap, floor_points(hall, ends)) == pytest.approx(lamp_light(LAMP, ends), rel=0.15)


def test_a_wall_far_thinner_than_a_texel_asks_for_cut_charts_only():
    """Ten times as many texels per metre are too many."""
    _, scene = walled_floor(0.8085, thickness=0.008)
    lightmap = drive(scene, SETTINGS)
    (told,) = [note for note in lightmap.report.warnings if "thinner than two texels" in note]
    assert "Cut the lightmap UVs along the wall." in told and "texels per metre" not in told


def halved_floor(first, cut, thickness):
    """Return `walled_floor` with a hall whose charts end at x = `cut`, and the scene."""
    atlas = Atlas(SETTINGS.resolution)
    left, right = box_faces((0, 0, 0), (cut, 0.8, 0.8)), box_faces((cut, 0, 0), (1.6, 0.8, 0.8))
    faces = np.concatenate([left[[0, 1, 2, 4, 5]], right[[0, 1, 3, 4, 5]]])
    hall = quads(faces, atlas.charts(faces), [0] * len(faces), atlas.resolution, "Hall")
    wall = block(atlas, (first, -0.03, -0.03), (first + thickness, 0.83, 0.83), "Wall")
    return hall, scene_of([hall, wall], [lamp(LAMP)], 0.0)


def ends(x):
    """Return points of a floor at some x up to its walls."""
    return np.stack(np.meshgrid(x, np.linspace(0.01, 0.79, 40), indexing="ij"), axis=-1).reshape(-1, 2)


#: Where a wall begins, which part of it is before the end of a chart, and its thickness.
UNDER_WALLS = [(0.813, 0, 0.02), (0.829, 0.5, 0.02), (0.8, 0.5, 0.05), (0.829, 0.3, 0.12)]
MORE_UNDER_WALLS = [
    (0.8, 1, 0.02), (0.836, 0.3, 0.02), (0.829, 1, 0.05), (0.8, 0.3, 0.08), (0.829, 0.5, 0.08),
    (0.8, 1, 0.12), (0.813, 0, 0.16), (0.8, 0.5, 0.16),
]  # fmt: skip


@pytest.mark.parametrize(
    ("first", "part", "thickness"), [*UNDER_WALLS, *(long(*row) for row in MORE_UNDER_WALLS)]
)
def test_charts_that_end_under_a_wall_show_each_side_its_own_light(first, part, thickness):
    """At its lit face, under it, at its dark face; texels there have a point or several, or are hidden."""
    cut = first + part * thickness
    hall, scene = halved_floor(first, cut, thickness)
    lightmap = drive(scene, SETTINGS)
    left, right = (replace(hall, positions=hall.positions[part:], uvs=hall.uvs[part:]) for part in (0, 10))
    foot = lamp_light(LAMP, line(first)).max()
    beyond = ends(first + thickness + np.arange(0.0005, 0.3, 0.007))
    assert shown(lightmap, floor_points(right, beyond)).max() <= 0.01 * foot
    before = ends(first - np.arange(0.0005, 0.1, 0.003))
    off = shown(lightmap, floor_points(left, before)) - lamp_light(LAMP, before)
    assert np.abs(off).max() <= 0.13 * foot and abs(off.mean()) <= 0.03 * foot


def rooms_side_by_side(low, high):
    """Return a lit room from 0 to 0.8 m and a dark one between two corners."""
    atlas = Atlas(SETTINGS.resolution)
    lit = room(atlas, (0, 0, 0), (0.8, 0.8, 0.8), "Lit")
    return [lit, room(atlas, low, high, "Dark")]


def room_around(low, high):
    """Return a lit room of 0.8 m inside a solid block that stands in a dark hall."""
    atlas = Atlas(SETTINGS.resolution)
    lit = room(atlas, (0, 0, 0), (0.8, 0.8, 0.8), "Lit")
    shell = occluder(box_faces((-0.1, -0.1, -0.1), (0.9, 0.9, 0.9))[:, ::-1], "Shell")
    return [lit, shell, room(atlas, low, high, "Dark")]


SEALED = {
    "a millimetre apart": rooms_side_by_side((0.801, 0, 0), (1.601, 0.8, 0.8)),
    "overlapping": rooms_side_by_side((0.73, 0.05, -0.03), (1.53, 0.85, 0.77)),
    "one in the other": room_around((-0.3, -0.2, -0.15), (1.1, 1.0, 1.0)),
}


@pytest.mark.parametrize("name", [name if name == "overlapping" else long(name) for name in SEALED])
@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_rooms_that_nearly_touch_overlap_or_hold_each_other_share_no_light(name, visibility):
    meshes = SEALED[name]
    scene = scene_of(meshes, [lamp((0.31, 0.37, 0.53))])
    settings = Settings(
        resolution=128, hemicube=16, light_samples=16, max_bounces=8, visibility=visibility, texel_samples=16
    )
    lightmap = drive(scene, settings)
    mesh = mesh_of_texels(scene, lightmap)
    light = lightmap.display[0].mean(axis=-1)
    lit = light[mesh == 0].mean()
    assert lit > 0.1
    dark = light[mesh == len(meshes) - 1]
    assert np.quantile(dark, 0.999) <= 0.02 * lit and dark.max() <= 0.03 * lit


@pytest.mark.parametrize(
    "method", [{"visibility": "rays"}, long({"visibility": "raster"}), long({"method": "paper"})]
)
@pytest.mark.parametrize("corner", [(1.37, 1.03, 0.71), long((1.6, 0.8, 0.8))])
def test_rooms_whose_walls_share_a_plane_are_as_bright_as_alone(method, corner):
    """Both walls lie in x = 0.8, the second one of another size or not; both are lit."""
    settings = Settings(
        resolution=128, hemicube=16, light_samples=16, max_bounces=8, texel_samples=1, **method
    )
    lamps = [lamp((0.31, 0.37, 0.53)), lamp((1.11, 0.53, 0.29), 0.3)]
    rooms = rooms_side_by_side((0.8, 0, 0), corner)
    together = scene_of(rooms, lamps)
    lightmap = drive(together, settings)
    mesh = mesh_of_texels(together, lightmap)
    assert not lightmap.report.warnings
    for index, (each, light) in enumerate(zip(rooms, lamps, strict=True)):
        alone = drive(scene_of([each], [light]), settings).image[0][mesh == index]
        off = lightmap.image[0][mesh == index] - alone
        assert np.abs(off).max() <= 0.1 * alone.mean() and abs(off.mean()) <= 0.005 * alone.mean()


@pytest.mark.parametrize("texel_samples", [16, long(1)])
def test_a_box_on_the_floor_of_a_room_is_named_by_no_warning(texel_samples):
    """It is thin across its corners, but not between sides that face apart."""
    atlas = Atlas(SETTINGS.resolution)
    hall = room(atlas, (0, 0, 0), (1.6, 0.8, 0.8), "Hall")
    box = block(atlas, (0.613, 0.2, 0), (1.0, 0.617, 0.4), "Box")
    scene = scene_of([hall, box], [lamp(LAMP)])
    settings = Settings(
        resolution=128,
        hemicube=8,
        light_samples=4,
        max_bounces=2,
        visibility="rays",
        texel_samples=texel_samples,
    )
    assert not drive(scene, settings).report.warnings


def mesh_of_texels(scene: Scene, lightmap):
    """Return the mesh of each texel by the charts, axis-aligned rectangles, -1 for none, (r, r)."""
    resolution = lightmap.display.shape[1]
    mesh = np.full((resolution, resolution), -1)
    for index, each in enumerate(scene.meshes):
        for quad in (each.uvs.reshape(-1, 6, 2) * resolution).round().astype(int):
            (x0, y0), (x1, y1) = quad.min(axis=0), quad.max(axis=0)
            mesh[y0:y1, x0:x1] = index
    return mesh


@pytest.mark.parametrize("first", [0.613, long(0.6), long(0.631)])
def test_a_box_that_cuts_the_floor_has_no_dark_line(first):
    """A black box 5 cm into a floor under an even sky: how much of it a long wall hides is known."""
    height, floor = 0.5, floor_under_sky()
    box = occluder(box_faces((first, -40, -0.05), (first + 0.3, 40, height))[1:, ::-1], "Box")
    lightmap = drive(sky_scene(floor, box), SETTINGS)
    distance = np.arange(0.001, 0.5, 0.013)
    found = shown(lightmap, floor_points(floor, line(first - distance))).reshape(len(distance), -1)
    expected = (1 + distance / np.hypot(distance, height)) / 2
    assert found.mean(axis=1) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("corner", [(0.613, 0.217), long((0.607, 0.229))])
@pytest.mark.parametrize("width", [1, 4])
def test_what_stands_on_a_floor_is_as_bright_at_its_foot_as_all_is(corner, width):
    """In a furnace: texels of the floor whose middle is under the block are seen beside it."""
    atlas = Atlas(SETTINGS.resolution)
    (x, y), glowing = corner, material("Glowing", 0.8, 0.2)
    hall = room(atlas, (0, 0, 0), (1.8, 0.8, 0.8), "Hall")
    standing = block(atlas, (x, y, 0), (x + 0.27, y + 0.33, 0.5), "Block")
    scene = Scene((hall, standing), (glowing,))
    settings = replace(SETTINGS, texel_samples=1, hide_seams=False, patch_groups=width, tolerance=1e-4)
    lightmap = drive(scene, replace(settings, samples=256, max_bounces=80))
    sides = np.zeros_like(lightmap.known[0])
    for side in (standing.uvs.reshape(-1, 6, 2)[2:] * SETTINGS.resolution).round().astype(int):
        (left, low), (right, high) = side.min(axis=0), side.max(axis=0)
        sides[low:high, left:right] = True
    light = lightmap.display[0].mean(axis=-1)[sides & lightmap.known[0]]
    assert len(light) > 300
    assert light == pytest.approx(np.ones(len(light)), rel=0.01)


@pytest.mark.parametrize("gap", [0.0, long(1e-7)])
def test_a_lamp_in_contact_with_a_ceiling_leaves_no_mark_beside_it(gap):
    """The ceiling, here a floor, sees a black block that lies on it as a wall."""
    floor = floor_under_sky()
    faces = box_faces((0.613, -40, gap), (0.9, 40, 0.5))[:, ::-1]
    lightmap = drive(sky_scene(floor, occluder(faces, "Block")), SETTINGS)
    distance = np.arange(0.001, 0.5, 0.013)
    found = shown(lightmap, floor_points(floor, line(0.613 - distance))).reshape(len(distance), -1)
    expected = (1 + distance / np.hypot(distance, 0.5)) / 2
    assert found.mean(axis=1) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(("texel_samples", "reflectance"), [(16, 0.0), (16, 0.9), long(1, 0.9)])
def test_a_closed_case_that_shines_on_its_far_side_shows_nothing_of_its_inside(texel_samples, reflectance):
    """Its side is 2 mm from points of the ceiling, here a floor, that stand for a centimetre of it.

    Texels of the floor that reach out from under the case send out nothing of what they see inside of it.
    """
    floor = floor_under_sky()
    case = occluder(box_faces((0.607, 0.2, 0), (1.0, 0.6, 0.1))[:, ::-1], "Case")
    case = replace(case, material=np.repeat(np.arange(6) == 1, 2).astype(case.material.dtype))
    scene = scene_of([floor, case], reflectance=reflectance)
    scene = replace(scene, materials=(*scene.materials, material("Shining", 0.0, 3.0)))
    lightmap = drive(scene, replace(SETTINGS, texel_samples=texel_samples))
    beside = line(0.607 - np.array([0.001, 0.01, 0.02, 0.05]))
    assert np.abs(shown(lightmap, floor_points(floor, beside))).max() <= 0.01


@pytest.mark.parametrize("texel_samples", [4, long(1)])
@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_a_panel_that_shines_close_to_a_wall_lights_it_from_behind(visibility, texel_samples):
    """The wall, here a floor, sees 99 % of backs beneath the panel, but they shine."""
    floor = floor_under_sky()
    panel = occluder(box_faces((0.4, 0.2, 0.02), (1.0, 0.6, 1))[:1], "Panel")
    panel = replace(panel, material=np.ones_like(panel.material))
    scene = scene_of([floor, panel], reflectance=0.0)
    scene = replace(scene, materials=(*scene.materials, material("Shining", 0.0, 3.0)))
    settings = replace(SETTINGS, visibility=visibility, texel_samples=texel_samples, hide_seams=False)
    lightmap = drive(scene, settings)
    middle = shown(lightmap, floor_points(floor, np.array([(0.7, 0.4), (0.6, 0.33), (0.86, 0.5)])))
    assert middle == pytest.approx(3, rel=0.02)
    assert lightmap.known[lightmap.has_patch].all()


def sky_scene(*meshes):
    """Return a black scene under a sky of radiance 1."""
    return scene_of(meshes, reflectance=0.0, world=np.ones(3, np.float32))


#: A lamp beside a low shell, which is 15 texels from the left end of the floor and cuts texels in half.
BESIDE, SHELL = (0.15, 0.4, 0.5), 0.62


def shell_on_floor(slit):
    """Return a floor and a hollow shell, 5 by 10 texels, whose faces are single and face outward.

    slit:  width of an opening along the middle of its top, m
    """
    floor, top = floor_under_sky(), (0.2 - slit) / 2
    sides = box_faces((SHELL, 0.2, -0.02), (SHELL + 0.2, 0.6, 0.1))[2:, ::-1]
    tops = [box_faces((x, 0.2, -0.02), (x + top, 0.6, 0.1))[1:2, ::-1] for x in (SHELL, SHELL + 0.2 - top)]
    return floor, occluder(np.concatenate([sides, *tops]), "Shell")


def texels_cut_by_shell(lightmap):
    """Return the light of the texels of the floor that the shell's wall halves, without its ends."""
    return lightmap.display[0, 6:14, 15].mean(axis=-1)


@pytest.mark.parametrize("texel_samples", [4, 16])
def test_a_pocket_with_a_slit_leaves_texels_in_front_of_it_lit(texel_samples):
    """Probe rays escape through the slit, so the inside is visible, but it is dark."""
    floor, shell = shell_on_floor(0.06)
    scene = scene_of([floor, shell], [lamp(BESIDE)], 0.1)
    lightmap = drive(scene, replace(SETTINGS, texel_samples=texel_samples, hide_seams=False))
    expected = lamp_light(BESIDE, line(SHELL - TEXEL / 2)).mean()
    assert texels_cut_by_shell(lightmap) == pytest.approx(np.full(8, expected), rel=0.2)


def test_a_dim_room_whose_walls_face_outward_is_no_pocket():
    """Texels that its wall halves show the mean of both sides."""
    floor, shell = shell_on_floor(0.06)
    inside, power = (SHELL + 0.1, 0.4, 0.09), 0.01
    scene = scene_of([floor, shell], [lamp(BESIDE), lamp(inside, power)], 0.1)
    lightmap = drive(scene, replace(SETTINGS, hide_seams=False))
    points = [np.array([(SHELL + step, 0.4)]) for step in (-TEXEL / 4, TEXEL / 4)]
    expected = (lamp_light(BESIDE, points[0]) + power * lamp_light(inside, points[1])) / 2
    assert texels_cut_by_shell(lightmap)[3:5] == pytest.approx(np.full(2, expected), rel=0.1)
