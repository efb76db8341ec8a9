"""Back faces of open surfaces, and translucent surfaces: light that is known."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Light, Scene, Settings
from engine.device import devices
from engine.scene.model import NO_LIGHTMAP, BackSide
from tests.analytic.drive import drive
from tests.analytic.rooms import Atlas, room
from tests.analytic.scenes import material, quads, rectangle
from tests.no_compute import NoCompute

X, Y, Z = np.eye(3)

SETTINGS = Settings(resolution=32, texel_samples=1, tolerance=1e-4, hide_seams=False)


def sheet(corner, edge_u, edge_v, chart, of=0, resolution=32, name="Sheet"):
    """Return one rectangle as a mesh of its own."""
    return quads(rectangle(corner, edge_u, edge_v)[None], [chart], [of], resolution, name)


def translucent(reflectance, translucency):
    """Return a material that also transmits diffuse light."""
    return replace(material("Cloth", reflectance), translucency=np.full(3, translucency, np.float32))


def half_lit(up, down):
    """Return a world of one radiance above the horizon and another one below, (h, w, 3) float32."""
    world = np.full((64, 128, 3), down, np.float32)
    world[32:] = up
    return world


@pytest.mark.parametrize(
    "way", [{}, {"method": "stream"}, {"visibility": "raster"}, {"method": "paper"}, {"atlas": NO_LIGHTMAP}]
)
def test_an_open_sheet_in_a_furnace_has_the_light_of_the_walls_on_both_sides(way):
    atlas = Atlas(53)
    walls = room(atlas, (0, 0, 0), (0.5, 0.6, 0.4), "Room")
    corners = rectangle((0.1, 0.2, 0.17), 0.3 * X, 0.3 * Y)[None]
    hanging = quads(corners, atlas.charts(corners), [0], 53, "Sheet")
    way = dict(way)
    hanging = replace(hanging, atlas=way.pop("atlas", 0))
    scene = Scene((walls, hanging), (material("Grey", 0.6, 0.4),))
    found = drive(scene, replace(SETTINGS, resolution=53, hemicube=32, **way))
    light = found.image[found.has_patch]
    assert light.mean() == pytest.approx(1, rel=1e-3) and np.abs(light - 1).max() < 0.02


def test_a_card_reflects_light_from_below_to_the_floor():
    """The floor's mean is rho times the mean square of the card's form factor to the floor (reciprocity)."""
    meshes = (
        sheet((0, 0, 0), X, Y, (1, 1, 16, 16), 0, 64, "Floor"),
        sheet((0, 0, 0.5), X, Y, (20, 1, 16, 16), 1, 64, "Card"),
    )
    scene = Scene(meshes, (material("Floor", 0, 1), material("Card", 0.7)))
    found = drive(scene, replace(SETTINGS, resolution=64, sample_emission=False))
    points = (np.arange(64) + 0.5) / 64

    def corner(a, b):
        """Return the form factor of a point to a rectangle above it with a corner over it (Howell, B-3)."""
        a, b = a / 0.5, b / 0.5
        first = a / np.sqrt(1 + a * a) * np.arctan(b / np.sqrt(1 + a * a))
        return (first + b / np.sqrt(1 + b * b) * np.arctan(a / np.sqrt(1 + b * b))) / (2 * np.pi)

    x, y = np.meshgrid(points, points)
    factor = sum(corner(a, b) for a in (x, 1 - x) for b in (y, 1 - y))
    assert found.image[0, 1:17, 1:17].mean() == pytest.approx(0.7 * (factor**2).mean(), rel=0.02)
    assert (found.image[0, 1:17, 20:36] == 0).all()


@pytest.mark.parametrize("up", [True, False])
def test_translucent_sheet_between_two_half_spaces(up):
    """The lightmap holds (rho E_front + tau E_back) / (rho + tau), whichever side is the front."""
    edges = (X, Y) if up else (Y, X)
    cloth = sheet((50, -70, 3), *edges, (3, 5, 7, 11))
    scene = Scene((cloth,), (translucent(0.3, 0.5),), world=half_lit(1.0, 0.2))
    for settings in (SETTINGS, replace(SETTINGS, texel_samples=4)):
        found = drive(scene, settings)
        front, back = (1.0, 0.2) if up else (0.2, 1.0)
        known = (0.3 * front + 0.5 * back) / 0.8
        assert found.display[0, 5:16, 3:10].mean() == pytest.approx(known, rel=5e-3)


def test_light_through_a_curtain_does_not_depend_on_its_normals():
    """A sun lights a cloth above a floor; the radiosity of its lower side is tau times the irradiance."""
    sun = Light("Sun", "sun", np.zeros(3), np.eye(3), np.full(3, np.pi, np.float32), half_angle=0.01)
    floors, cloths, groups = [], [], []
    for edges in ((X, Y), (Y, X)):
        meshes = (
            sheet((-1, -1, 0), 2 * X, 2 * Y, (1, 1, 9, 9), 0, name="Floor"),
            sheet((-1, -1, 0.7), *(2 * edge for edge in edges), (13, 1, 11, 11), 1, name="Curtain"),
        )
        lit = replace(sun, light_group="Day")
        scene = Scene(meshes, (material("Floor", 0), translucent(0, 0.8)), lights=(lit,))
        scene = replace(scene, light_groups=("Day",))
        found = drive(scene, replace(SETTINGS, outputs=("combined", "light_groups")))
        floors.append(found.image[0, 1:10, 1:10].mean())
        cloths.append(found.image[0, 1:12, 13:24].mean())
        groups.append(found.passes["light_group Day"][0, 1:10, 1:10].mean())
    assert floors[0] == pytest.approx(floors[1], rel=2e-3) and floors[0] > 0.3
    assert groups == pytest.approx(floors, rel=1e-3)
    assert cloths == pytest.approx([0, 1], abs=1e-3)


def test_a_back_may_emit_and_reflect_otherwise_than_its_front():
    """Only the lower side of a panel emits: it lights the floor below, but not a ceiling above."""
    back = BackSide(np.zeros(3, np.float32), np.full(3, 2, np.float32))
    panel = replace(material("Panel", 0.5), back=back)
    meshes = (
        sheet((0, 0, 0), X, Y, (1, 1, 8, 8), 0, name="Floor"),
        sheet((0, 0, 1), X, Y, (11, 1, 8, 8), 1, name="Panel"),
        sheet((0, 0, 2), Y, X, (21, 1, 8, 8), 0, name="Ceiling"),
    )
    found = drive(Scene(meshes, (material("Black", 0), panel)), SETTINGS)
    assert found.image[0, 1:9, 1:9].mean() == pytest.approx(2 * 0.19982490, rel=0.01)
    assert (found.image[0, 1:9, 21:29] == 0).all()


def lidless(lid):
    """Return a floor under an even sky, and a box without a bottom, and without a lid unless `lid`, on it."""
    floor = sheet((-2, -2, 0), 4 * X, 4 * Y, (1, 1, 30, 30), 0, 61, "Floor")
    sides = [
        rectangle((-0.6, -0.6, 0), 1.2 * X, 2 * Z),
        rectangle((0.6, -0.6, 0), 1.2 * Y, 2 * Z),
        rectangle((0.6, 0.6, 0), -1.2 * X, 2 * Z),
        rectangle((-0.6, 0.6, 0), -1.2 * Y, 2 * Z),
        rectangle((-0.6, -0.6, 2), 1.2 * X, 1.2 * Y),
    ]
    charts = [(33 + 7 * i, 1, 5, 10) for i in range(4)] + [(33, 14, 5, 5)]
    count = 5 if lid else 4
    box = quads(np.stack(sides[:count]), charts[:count], [0] * count, 61, "Box")
    return Scene((floor, box), (material("Grey", 0.7),), world=np.ones(3, np.float32))


def test_inside_a_box_of_single_planes_no_texel_becomes_valid_and_dark():
    """A texel that the wall crosses shows the light outside; a lit inside is shown as it is."""
    dark = drive(lidless(lid=True), replace(SETTINGS, resolution=61, texel_samples=4))
    floor = dark.display[0, 1:31, 1:31, 0]
    assert not dark.known[0, 13:18, 13:18].any() and dark.known[0, 2:9, 2:9].all()
    outside = floor[15, 8]
    assert outside > 0.5 and floor.min() > 0.5 * outside
    lit = drive(lidless(lid=False), replace(SETTINGS, resolution=61, texel_samples=4))
    assert lit.known[0, 13:18, 13:18].all()


def open_shell(outward, name, emission=0.0):
    """Return the lid and the sides of a box without a bottom around (0.5, 0.5, 0.5), and its material."""
    sides = [
        rectangle((0, 0, 0), X, Z), rectangle((1, 0, 0), Y, Z), rectangle((1, 1, 0), -X, Z),
        rectangle((0, 1, 0), -Y, Z), rectangle((0, 0, 1), X, Y),
    ]  # fmt: skip
    corners = np.stack(sides) if outward else np.stack([side[[0, 3, 2, 1]] for side in sides])
    charts = [(1 + 7 * i, 1, 5, 5) for i in range(4)] + [(1, 8, 5, 5)]
    return quads(corners, charts, [0] * 5, 37, name), material("Shell", 0.5, emission)


TURNED = "back faces are lit"


@pytest.mark.parametrize(
    ("outward", "emission", "translucency", "settings", "expected"),
    [
        (True, 0, 0, {}, True),
        (True, 0, 0, {"patch_groups": 2}, True),
        (False, 0, 0, {}, False),
        (True, 0.001, 0, {}, False),
        (True, 0, 0.2, {}, False),
    ],
)
def test_open_shells_with_the_light_at_their_back_are_named(
    outward, emission, translucency, settings, expected
):
    """A lamp is inside a shell without a bottom, 1 km from the origin; a spot lights a floor beside."""
    shell, surface = open_shell(outward, "Shell", emission)
    surface = replace(surface, translucency=np.full(3, translucency, np.float32))
    floor = sheet((4, 4, 0), X, Y, (8, 8, 5, 5), 1, 37, "Floor")
    far = np.array([1000, -700, 30], np.float32)
    meshes = [replace(mesh, positions=mesh.positions + far) for mesh in (shell, floor)]
    lamps = [
        Light(kind, kind, far + at, np.eye(3), np.full(3, np.pi, np.float32), radius=0.01, half_angle=0.4)
        for kind, at in (("point", (0.5, 0.5, 0.5)), ("spot", (4.5, 4.5, 1)))
    ]
    scene = Scene(tuple(meshes), (surface, material("Grey", 0.5)), lights=tuple(lamps))
    report = drive(scene, replace(SETTINGS, resolution=37, **settings)).report
    notes = [note for note in report.warnings if TURNED in note]
    assert len(notes) == expected and all(note.objects == ("Shell",) for note in notes)


@pytest.mark.parametrize(("up", "opencl"), [(True, True), (False, True), (False, False)])
def test_a_roof_whose_normals_point_away_from_the_sky_is_named(up, opencl, monkeypatch):
    """Two roofs of one kind are in one warning; a dark scene and an object without a lightmap have none."""
    if not opencl:
        monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    edges = (X, Y) if up else (Y, X)
    roofs = [sheet((3 * i, 0, 2), *edges, (1 + 9 * i, 1, 7, 7), 0, name=f"Roof {i}") for i in range(2)]
    hidden = replace(sheet((7, 0, 2), *edges, (20, 1, 7, 7), 0, name="Hidden"), atlas=NO_LIGHTMAP)
    world = half_lit(1.0, 0.01)
    scene = Scene((*roofs, hidden), (material("Tiles", 0.5),), world=world)
    notes = [note for note in drive(scene, SETTINGS).report.warnings if TURNED in note]
    assert [note.objects for note in notes] == ([] if up else [("Roof 0", "Roof 1")])
    dark = drive(replace(scene, world=np.zeros(3, np.float32)), SETTINGS).report.warnings
    assert not any(TURNED in note for note in dark)
