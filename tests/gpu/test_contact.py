"""Touching faces: drawing, rays and OpenGL alone agree about covered patches."""

import dataclasses

import numpy as np
import pytest

from engine import Material, Scene, Settings, Texture, finished
from engine.device import devices
from engine.device.buffers import upload
from engine.direct import contact
from engine.direct.contact import find_contacts, patches_lit_by_backs
from engine.patches.patch_scene import make_patch_scene
from engine.session import Session
from engine.validity.push_off import find_inside, push_off_points
from engine.validity.substitutes import find_substitutes
from engine.visibility.rays.ray_scene import RayScene
from engine.visibility.rays.shaders.shader_scene import ShaderScene
from tests.analytic.scenes import material, quads, rectangle, room_walls
from tests.gpu.test_methods import OldGraphics
from tests.no_compute import NoCompute
from tests.transparency import CLEAR_BACK, transparent

SETTINGS = Settings(
    resolution=64,
    hemicube=8,
    max_bounces=2,
    tolerance=0,
    accelerate=False,
    sample_emission=False,
    texel_samples=1,
)

#: Ways to compute visibility: "old" is OpenGL 4.1. "opengl" is a machine without OpenCL, which casts rays
#: in random directions.
WAYS = {
    "raster": {"visibility": "raster"},
    "rays": {"visibility": "rays", "directions": "hemicube"},
    "paper": {"method": "paper"},
    "old": {"method": "paper"},
    "opengl": {"samples": 4096},
}

NEAR, FAR = (0, 0, 0), (1000, -2000, 500)

FLOOR, UNDERSIDE = (0, 0, 20, 20), (22, 0, 11, 11)


def box_on_floor(low, shift=(0, 0, 0)):
    """Return a grey floor of 4 m, a texel 0.2 m wide, and a box of 2.2 m; face 1 is the box's underside."""
    floor = rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0))[None]
    box = room_walls(2.2, 2.2, 0.6)[:, ::-1] + np.array(low)
    charts = [FLOOR, UNDERSIDE, (35, 0, 11, 11), *[(x, 22, 11, 3) for x in (0, 13, 26, 39)]]
    mesh = quads(np.concatenate([floor, box]) + np.array(shift), charts, [0] * 7, 64, "Box and floor")
    return Scene((mesh,), (material("Grey", 0.5),), world=np.ones(3, np.float32))


def shade_over_small_texels(gap):
    """Return a floor of texels of 2 cm, half of it under a shade that faces it, in a scene 2 km wide."""
    floor = rectangle((0, 0, 0), (0.4, 0, 0), (0, 0.4, 0))
    shade = rectangle((0, 0, gap), (0, 0.4, 0), (0.2, 0, 0))
    far = rectangle((2000, 0, -5), (1, 0, 0), (0, 1, 0))
    charts = [FLOOR, (22, 0, 10, 20), (0, 50, 2, 2)]
    mesh = quads(np.stack([floor, shade, far]), charts, [0] * 3, 64, "Shade")
    return Scene((mesh,), (material("Black", 0),), world=np.ones(3, np.float32))


class StandardDepth(OldGraphics):
    """OpenGL 4.1: depth cannot be reversed either."""

    def __init__(self):
        super().__init__()
        self.raw("glClipControl", 0x8CA1, 0x935E)
        self.reversed_depth = False


#: What stands in for the devices of a way.
OTHERS = {"old": {"GraphicsContext": StandardDepth}, "opengl": {"ComputeDevice": NoCompute}}


@pytest.fixture(scope="module")
def baked():
    """Return a function that bakes a scene in every way; devices are opened once."""
    common = Session()
    sessions = {name: Session() if name in OTHERS else common for name in WAYS}

    def bake(scene):
        lightmaps = {}
        for name, changes in WAYS.items():
            with pytest.MonkeyPatch.context() as patched:
                for kind, other in OTHERS.get(name, {}).items():
                    patched.setattr(devices, kind, other)
                work = sessions[name].bake(scene, dataclasses.replace(SETTINGS, **changes))
                lightmaps[name] = finished(work)
        return lightmaps

    yield bake
    for session in sessions.values():
        session.close()


def check_agreement(lightmaps):
    """Ways agree except in texels on an edge.

    Hemicubes of 8 x 8 texels at the centre differ more from 4,096 rays from all over the texel.
    """
    for kind in ("image", "display"):
        images = {name: getattr(lightmap, kind) for name, lightmap in lightmaps.items()}
        for name, image in images.items():
            mean, largest = (7e-3, 0.15) if name == "opengl" else (1e-3, 0.05)
            difference = np.abs(image - images["raster"])
            assert difference.mean() < mean and difference.max() < largest


def chart(lightmap, where, margin=2):
    """Return E/pi in a chart without its border."""
    x, y, width, height = where
    return lightmap.image[0, y + margin : y + height - margin, x + margin : x + width - margin, 0]


@pytest.mark.parametrize(
    ("lift", "shift"),
    [(0, NEAR), (1e-4, NEAR), (1e-3, NEAR), (0, FAR), (1e-3, FAR), (5e-3, FAR)],
)
def test_it_is_dark_under_what_stands_on_a_floor(baked, lift, shift):
    """Or a little above it; far from the origin, too, where float32 is 0.1 mm coarse."""
    lightmaps = baked(box_on_floor((-1.2, -1.2, lift), shift))
    check_agreement(lightmaps)
    for lightmap in lightmaps.values():
        assert chart(lightmap, UNDERSIDE).max() < 1e-3
        assert chart(lightmap, (4, 4, 11, 11)).max() < 1e-3
        assert chart(lightmap, FLOOR)[:2].min() > 0.5


def test_what_sticks_out_over_an_edge_is_lit_there(baked):
    """The box covers the floor up to x = 2, and its underside is dark up to there."""
    lightmaps = baked(box_on_floor((1.0, -1.2, 0)))
    check_agreement(lightmaps)
    for lightmap in lightmaps.values():
        under = chart(lightmap, UNDERSIDE, 0)
        assert (under[:, :5] == 0).all() and (under[:, 6:] > 0.9).all()
        under = chart(lightmap, (15, 4, 5, 11), 0)
        assert (under[1:-1, 1:] == 0).all()


def test_both_sides_of_a_leaf_are_lit(baked):
    """Two sheets that face away from each other."""
    sheet = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    mesh = quads(np.stack([sheet, sheet[::-1]]), [FLOOR, (22, 0, 20, 20)], [0, 0], 64, "Leaf")
    leaf = Scene((mesh,), (material("Grey", 0.5),), world=np.ones(3, np.float32))
    lightmaps = baked(leaf)
    check_agreement(lightmaps)
    for lightmap in lightmaps.values():
        assert chart(lightmap, FLOOR).min() > 0.99 and chart(lightmap, (22, 0, 20, 20)).min() > 0.99


@pytest.mark.parametrize("gap", [5e-4, 1.3e-3, 2.5e-3, 2.9e-3, 7e-3])
def test_small_texels_of_a_large_scene_see_what_is_near(baked, gap):
    """Nothing is cut off between the eye, 1 mm above the floor, and the near plane, 2 mm from it."""
    lightmaps = baked(shade_over_small_texels(gap))
    check_agreement(lightmaps)
    for lightmap in lightmaps.values():
        assert chart(lightmap, (0, 0, 10, 20)).max() < 0.05
        assert chart(lightmap, (10, 0, 10, 20)).min() > 0.95


def stacks(shift):
    """Return boxes in a heap, a few of which touch, with see-through, patterned and one-sided surfaces."""
    random, boxes, charts = np.random.default_rng(11), [], []
    for index in range(18):
        low = np.round(random.uniform(0, 4, 3))
        boxes.append(room_walls(*random.integers(1, 4, 3))[:, ::-1] + low + np.array(shift))
        charts += [(14 * (index % 9), 61 * (index // 9) + 10 * side, 10, 6) for side in range(6)]
    black = np.zeros(3, np.float32)
    pixels = random.random((13, 7, 1), np.float32)
    holes = Texture("Holes", pixels, "Map", np.array([[1.3, 0, 0.2], [0, 2.1, 0]]), "mirror")
    plain = Material("Plain", black, black)
    materials = (
        plain,
        dataclasses.replace(plain, transmission=CLEAR_BACK),
        dataclasses.replace(plain, transmission=transparent(0.3)),
        dataclasses.replace(plain, transmission=transparent(1.0, holes)),
        dataclasses.replace(plain, transmission=transparent(1.0, holes, 0.6)),
    )
    numbers = np.resize(np.arange(len(materials)), len(charts))
    mesh = quads(np.concatenate(boxes), charts, numbers, 128, "Stacks")
    mesh = dataclasses.replace(mesh, texture_uvs={"Map": mesh.uvs * 37})
    return Scene((mesh,), materials)


def of_all(push_offs):
    """Return wall, offset and thickness of all points; see `PushOffs`."""
    count = len(push_offs.inside)
    wall, thickness = np.full(count, -1), np.full(count, np.inf)
    offset = np.zeros((count, 3))
    for values, some in (
        (wall, push_offs.wall),
        (offset, push_offs.offset),
        (thickness, push_offs.thickness),
    ):
        values[push_offs.rows] = some
    return wall, offset, thickness


@pytest.mark.parametrize("shift", [NEAR, FAR])
def test_probes_find_the_same_without_opencl(graphics, compute, shift):
    """Contacts, light of back faces and ways out of things, by compute shaders."""
    scene = stacks(shift)
    patch_scene = make_patch_scene(graphics, compute, scene, dataclasses.replace(SETTINGS, resolution=128))
    pair = (
        RayScene(compute, patch_scene),
        RayScene(None, patch_scene, shaders=ShaderScene(graphics, patch_scene)),
    )
    (hidden, apart), (our_hidden, our_apart) = (find_contacts(rays, rays.count) for rays in pair)
    assert 100 < (hidden | apart).sum() < len(hidden) / 2
    assert (hidden != our_hidden).mean() < 2e-3 and (apart != our_apart).mean() < 2e-3
    shines = np.arange(patch_scene.triangles.solid) % 3 == 0
    lit, our_lit = (
        patches_lit_by_backs(rays, rays.count, shines, patch_scene.triangles.positions) for rays in pair
    )
    assert lit.any() and (lit != our_lit).mean() < 5e-3
    theirs, ours = (
        push_off_points(rays, rays.count, 1.5, patch_scene.geometry.steps.geometric) for rays in pair
    )
    (wall, offset, thickness), (our_wall, our_offset, our_thickness) = (
        of_all(each) for each in (theirs, ours)
    )
    same = (theirs.inside == ours.inside) & (wall == our_wall)
    assert theirs.inside.any() and same.mean() > 0.99
    assert theirs.enclosed.any() and (theirs.enclosed == ours.enclosed).mean() > 0.99
    assert not (theirs.inside & theirs.enclosed).any()

    # Ways out of equal length are common among whole coordinates; rounding decides between them.
    assert (np.abs(offset - our_offset)[same].max(axis=1) > 1e-3).mean() < 2e-3
    assert (np.isinf(thickness) == np.isinf(our_thickness)).mean() > 0.99


def test_candidates_for_substitutes_are_the_same_on_the_device(graphics, compute):
    settings = dataclasses.replace(SETTINGS, resolution=128)
    patch_scene = make_patch_scene(graphics, compute, stacks(NEAR), settings)
    invalid = np.random.default_rng(5).random(len(patch_scene.patches)) < 0.1
    ours, theirs = find_substitutes(patch_scene, invalid), find_substitutes(patch_scene, invalid, compute)
    assert len(ours[0]) > 1000
    np.testing.assert_array_equal(theirs, ours)


def insides(width, depth, height, shift):
    """Return a floor of texels 1 m wide in a box of the given size, m, that shows its back faces."""
    box = room_walls(width, depth, height)[1:, ::-1] + np.array(shift)
    floor = rectangle(shift, (width, 0, 0), (0, depth, 0))
    charts = [(0, 0, width, depth), *((30 + 5 * side, 0, 3, 3) for side in range(5))]
    mesh = quads(np.concatenate([floor[None], box]), charts, [0] * 6, 64, "Box")
    return Scene((mesh,), (material("Grey", 0.5),))


@pytest.mark.parametrize("shift", [NEAR, FAR])
@pytest.mark.parametrize("shaders", [False, True])
@pytest.mark.parametrize("side", [1, 2])
def test_lit_back_faces_make_a_room_outside_but_no_narrow_pocket(graphics, compute, shift, shaders, side):
    """Light leaks into a pocket through its rim; `side` points along a texel measure in texels, too."""
    inside = {}
    for size in ((25, 23, 11), (3, 25, 2)):
        patch_scene = make_patch_scene(
            graphics, compute, insides(*size, shift), dataclasses.replace(SETTINGS, resolution=64 * side)
        )
        rays = RayScene(compute, patch_scene)
        if shaders:
            rays = RayScene(None, patch_scene, shaders=ShaderScene(graphics, patch_scene))
        triangles = patch_scene.triangles.solid
        lit = np.ones(triangles, np.uint8) if shaders else upload(compute, np.ones(triangles, np.uint8))
        found = find_inside(rays, rays.count, side, patch_scene.geometry.steps.geometric, lit)
        inside[size] = found[patch_scene.geometry.triangle < 2]
    room, pocket = inside.values()
    assert len(room) == 25 * 23 * side**2 and not room.any() and pocket.mean() > 0.6


@pytest.mark.parametrize("shift", [NEAR, FAR])
@pytest.mark.parametrize("shaders", [False, True])
def test_a_crevice_whose_first_probes_hit_front_faces_is_inside(graphics, compute, shift, shaders):
    """A texel within a body has a small face above it, which meets back faces, like all other probes."""
    texel, above = ((4, 4, 1), (1, 0, 0), (0, 1, 0)), ((4, 4, 1.7), (0, 1, 0), (1, 0, 0))
    faces = [rectangle(*texel)[None], rectangle(*above)[None], room_walls(9, 9, 9)[:, ::-1]]
    charts = [(0, 0, 1, 1), (3, 0, 1, 1), *((6 + 5 * side, 0, 3, 3) for side in range(6))]
    mesh = quads(np.concatenate(faces) + np.array(shift), charts, [0] * 8, 64, "Body")
    patch_scene = make_patch_scene(graphics, compute, Scene((mesh,), (material("Grey", 0.5),)), SETTINGS)
    rays = RayScene(compute, patch_scene)
    if shaders:
        rays = RayScene(None, patch_scene, shaders=ShaderScene(graphics, patch_scene))
    inside = find_inside(rays, rays.count, 1.0, patch_scene.geometry.steps.geometric)
    on_texel = patch_scene.geometry.triangle < 2
    assert on_texel.sum() == 1 and inside[on_texel].all()


@pytest.mark.parametrize("shift", [NEAR, FAR])
def test_patches_in_front_of_all_that_shines_see_none_of_its_backs(graphics, compute, shift, monkeypatch):
    """They do not look, and what all others see is the same as if everyone looked."""
    patch_scene = make_patch_scene(
        graphics, compute, stacks(shift), dataclasses.replace(SETTINGS, resolution=128)
    )
    scene, positions = RayScene(compute, patch_scene), patch_scene.triangles.positions
    normals = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    for axis in np.eye(3):
        # Faces that look along an axis, those first that are in front of fewest patches.
        along = np.flatnonzero(normals @ axis > 0.9 * np.linalg.norm(normals, axis=1))
        along = along[np.argsort(positions[along, 0] @ axis)]
        for count, least in ((0, 0), (2, 0), (10, 20)):
            shines = np.zeros(len(positions), bool)
            shines[along[:count]] = True
            lit = patches_lit_by_backs(scene, len(patch_scene.patches), shines, positions)
            with monkeypatch.context() as patched:
                patched.setattr(contact, "_PLANES", -1)
                everyone = patches_lit_by_backs(scene, len(patch_scene.patches), shines, positions)
            assert (lit == everyone).all() and lit.sum() >= least
