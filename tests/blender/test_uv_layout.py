"""Objects with overlapping lightmap UVs are moved apart; other objects stay where they are."""

import numpy as np
import pytest

from tests.blender.things import (
    SQUARE,
    finished,
    loop_uvs,
    material,
    mesh_object,
    part,
    pixels,
    read_scene,
    report,
    snapshot,
    square,
)

WHOLE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def box(low, high):
    """Return the UVs of a square in a box."""
    return [low, (high[0], low[1]), high, (low[0], high[1])]


def resolution(value):
    import bpy

    bpy.context.scene.hemibake.resolution = value


def row_of(count, uvs=WHOLE, size=lambda number: 1.0):
    """Return squares beside each other, all with the same UVs."""
    squares = []
    for number in range(count):
        obj = square(f"Square {number}", uvs)
        obj.location.x, obj.scale = 1000 * number, [size(number)] * 3
        squares.append(obj)
    return squares


def boxes(read):
    """Return low and high corner of the lightmap UVs of each baked mesh, (n, 2, 2), by name."""
    return {
        mesh.name: np.array([mesh.uvs.min(axis=(0, 1)), mesh.uvs.max(axis=(0, 1))])
        for mesh in read.scene.meshes
        if mesh.atlas >= 0
    }


def assert_apart(read, texels=0.0):
    """Fail unless no two boxes of one atlas come closer than some texels, and all lie in it."""
    import bpy

    gap = texels / bpy.context.scene.hemibake.resolution - 1e-6
    names = {mesh.name: mesh.atlas for mesh in read.scene.meshes}
    found = boxes(read)
    for name, (low, high) in found.items():
        assert (low >= -1e-6).all() and (high <= 1 + 1e-6).all()
        for other, (low_other, high_other) in found.items():
            if name < other and names[name] == names[other]:
                assert (high + gap <= low_other).any() or (high_other + gap <= low).any(), (name, other)


def filled(read):
    """Return the fraction of the atlas that is in the boxes."""
    return sum(float(np.prod(high - low)) for low, high in boxes(read).values())


def test_objects_that_fill_the_square_each_are_placed_side_by_side():
    resolution(128)
    squares = row_of(4)
    read = read_scene()
    assert read.scene.atlases == ("Lightmap",) and read.notes == ()
    assert_apart(read, texels=4)
    assert filled(read) > 0.8
    for obj, (uid, place), mesh in zip(squares, read.objects, read.scene.meshes, strict=True):
        assert uid == obj.session_uid
        np.testing.assert_allclose(mesh.uvs[0], np.array(WHOLE[:3]) * place.scale + place.offset, atol=1e-6)


@pytest.mark.one_version
@pytest.mark.parametrize("count", [2, 3, 5, 50])
def test_tiles_are_in_proportion_to_area_and_fill_the_atlas(count):
    resolution(512)
    row_of(count, size=lambda number: 1 + number % 7)
    read = read_scene()
    assert_apart(read, texels=4)
    scales = [place.scale for _, place in read.objects]
    np.testing.assert_allclose(scales, [scales[0] * (1 + number % 7) for number in range(count)], rtol=1e-6)
    assert filled(read) > 0.5 and read.scene.atlases == ("Lightmap",)


def test_tiny_next_to_huge_gets_a_few_texels():
    resolution(64)
    row_of(3, size=lambda number: (1000, 1, 1e-3)[number])
    read = read_scene()
    assert_apart(read, texels=4)
    sides = [64 * np.ptp(one, axis=0).max() for one in boxes(read).values()]
    assert sides[0] > 45 and sides[1:] == pytest.approx([8, 8])


def test_objects_that_lie_on_none_keep_their_place():
    resolution(128)
    row_of(2, box((0, 0), (0.5, 1)))
    square("Corner", box((0.75, 0.75), (1, 1)))
    square("Beside", box((0.75, 0.5), (1, 0.75)))
    square("Other", WHOLE).hemibake.atlas = "Other"
    read = read_scene()
    places = {mesh.name: place for mesh, (_, place) in zip(read.scene.meshes, read.objects, strict=True)}
    kept = {name for name, place in places.items() if (place.scale, place.offset) == (1, (0, 0))}
    assert kept == {"Corner", "Beside", "Other"} and read.scene.atlases == ("Lightmap", "Other")
    assert_apart(read)


def test_one_in_a_corner_of_the_other():
    resolution(64)
    square("Whole", WHOLE).scale = (3, 3, 3)
    square("Corner", box((0, 0), (0.1, 0.1))).location.z = 1
    read = read_scene()
    assert_apart(read, texels=4)
    first, second = (np.ptp(one, axis=0) for one in boxes(read).values())
    assert first == pytest.approx(3 * second, rel=1e-4)


def test_objects_that_were_packed_together_stay_together():
    """Nine parts of a room share the square; furniture that fills it comes on top."""
    resolution(256)
    for number in range(9):
        low = np.array([number % 3, number // 3]) / 3 + 0.01
        square(f"Room {number}", box(tuple(low), tuple(low + 0.31))).location.x = 2 * number
    chair, table = square("Chair", WHOLE), square("Table", WHOLE)
    chair.scale = table.scale = (0.5, 0.5, 0.5)
    read = read_scene()
    assert_apart(read)
    room = {(place.scale, place.offset) for _, place in read.objects[:9]}
    assert len(room) == 1 and len({place.offset for _, place in read.objects}) == 3


def test_uvs_outside_the_square_are_moved_inside():
    resolution(64)
    square("Second tile", box((1, 0), (2, 1)))
    square("Large", box((-3, -3), (4.5, 4.5)))
    square("Far", box((5000, 5000), (5001, 5001)))
    read = read_scene()
    assert_apart(read, texels=4)
    sizes = [np.ptp(one, axis=0) for one in boxes(read).values()]
    np.testing.assert_allclose(sizes, np.full((3, 2), sizes[0][0]), atol=1e-4)


def test_uvs_without_an_area_do_no_harm():
    resolution(64)
    row_of(2)
    square("Point", [(0.5, 0.5)] * 4)
    square("Line", [(0, 0.5), (1, 0.5), (1, 0.5), (0, 0.5)])
    read = read_scene()
    assert filled(read) > 0.3


def test_more_than_fit_become_occluders_with_a_note():
    import bpy

    resolution(8)
    row_of(40)
    square("Kept", WHOLE).hemibake.atlas = "Other"
    read = read_scene()
    assert [uid for uid, _ in read.objects] == [bpy.data.objects["Kept"].session_uid]
    assert any("'Square 0'" in note and "Raise the resolution" in note for note in read.notes)


def test_linked_objects_go_to_tiles_of_their_own_and_leave_room_for_others():
    import bpy

    resolution(64)
    (first, *_) = row_of(3)
    copy = bpy.data.objects.new("Copy", first.data)
    bpy.context.scene.collection.objects.link(copy)
    read = read_scene()
    assert set(read.scene.atlases) == {"Lightmap", "Lightmap instances"}
    assert_apart(read, texels=4)


def test_bake_keeps_the_layers_and_writes_scale_and_offset():
    """One of four lies on itself: it becomes an occluder, and the others get their light."""
    import bpy

    resolution(32)
    lit = [material(f"Light {number}", emission=number + 1.0) for number in range(3)]
    squares = row_of(3)
    for obj, surface in zip(squares, lit, strict=True):
        obj.data.materials.append(surface)
        above = mesh_object(f"{obj.name} above", SQUARE, [(3, 2, 1, 0)], surface=surface)
        above.location, above.hemibake.role = (obj.location.x, 0, 0.01), "NO_LIGHTMAP"
    square("Folded", [(0, 0), (1, 0), (0, 1), (1, 1)])
    before = snapshot()["meshes"]
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    after = snapshot()["meshes"]
    assert {name: mesh[2] for name, mesh in before.items()} == {name: mesh[2] for name, mesh in after.items()}
    assert report()["objects"] == 3 and any("'Folded'" in warning for warning in report()["warnings"])
    for number, obj in enumerate(squares):
        place = obj.hemibake
        uv = loop_uvs(obj).mean(axis=0) * place.uv_scale + np.array(place.uv_offset)
        column, row = (uv * 32).astype(int)
        assert place.uv_scale < 0.6
        # Between parallel plates of reflectance 0.5 and radiance n: E/pi = n / (1 - 0.5).
        assert pixels(place.image)[row, column, 0] == pytest.approx(2 * (number + 1), rel=0.05)


def network(name, factor):
    """Return a material that Cycles has to evaluate: red is u of the lightmap layer times a factor."""
    surface = material(name)
    tree = surface.node_tree
    uv_map, product = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeVectorMath")
    uv_map.uv_map, product.operation = "Lightmap", "SCALE"
    product.inputs["Scale"].default_value = factor
    tree.links.new(uv_map.outputs[0], product.inputs[0])
    tree.links.new(product.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0
    return surface


@pytest.mark.parametrize(("size", "shift"), [(1, 0), (10, 7)])
def test_networks_are_evaluated_where_charts_are_put(size, shift):
    """Objects whose UVs lie on each other, in the square or outside, each have their part of one texture."""
    resolution(64)
    surface = network("Network", 1 / size)
    turned = np.roll(WHOLE, 1, axis=0).tolist()
    for name, uvs in (("One", WHOLE), ("Two", turned)):
        square(name, np.array(uvs) * size + np.array([0, shift]), surface)
    read = read_scene()
    (entry,) = read.scene.materials
    texture = entry.reflectance_map.pixels[..., 0]
    assert_apart(read)
    for mesh, uvs in zip(read.scene.meshes, (WHOLE, turned), strict=True):
        np.testing.assert_array_equal(mesh.texture_uvs[entry.reflectance_map.uv_map], mesh.uvs)
        for weights in np.random.default_rng(1).dirichlet([3, 3, 3], 5):
            column, row = ((weights @ mesh.uvs[0]) * len(texture)).astype(int)
            u, _ = weights @ np.array(uvs)[:3]
            assert texture[row, column] == pytest.approx(u, abs=0.04)


def test_network_on_a_mesh_with_eight_layers():
    resolution(64)
    surface = network("Network", 1)
    for name in ("One", "Two"):
        obj = square(name, WHOLE, surface)
        for number in range(7):
            obj.data.uv_layers.new(name=f"Layer {number}")
    before = snapshot()
    read = read_scene()
    assert snapshot() == before and len(read.objects) == 2
    assert_apart(read, texels=4)


@pytest.mark.one_version
@pytest.mark.parametrize("seed", range(5))
def test_tiles_never_meet(seed):
    tiles = part("operators.scene.skyline_packing")
    rng = np.random.default_rng(seed)
    sizes = [tuple(size) for size in rng.integers(1, 30, (97, 2)).tolist()]
    pages = [tiles.Box(3, 5, 61, 83), tiles.Box(0, 0, 127, 131), tiles.Box(7, 0, 200, 200)]
    corners = finished(tiles.pack_tiles(sizes, pages))
    taken = np.zeros((3, 211, 211), int)
    for (page, x, y), (width, height) in zip(corners, sizes, strict=True):
        taken[page, y : y + height, x : x + width] += 1
    for number, page in enumerate(pages):
        taken[number, page.y : page.y + page.height, page.x : page.x + page.width] -= 1
    assert taken.max() == 0
    assert finished(tiles.pack_tiles(sizes, pages[:1])) is None


@pytest.mark.one_version
@pytest.mark.parametrize(("wanted", "resolution"), [(0.0, 1009), (11.0, 127)])
def test_thousands_of_tiles_are_placed_a_few_times_each(monkeypatch, wanted, resolution):
    """Full pages are not searched for each tile, and scales at which tiles cannot fit are passed over."""
    layout, tiles = part("operators.scene.uv_layout"), part("operators.scene.skyline_packing")
    tried, place = [], tiles._Skyline.place
    monkeypatch.setattr(
        tiles._Skyline, "place", lambda skyline, *size: tried.append(size) or place(skyline, *size)
    )
    sizes = [np.array([1.0, 0.7])] * 1999
    scale, corners = finished(layout._fit(sizes, wanted, resolution))
    pages = {page for page, _, _ in corners}
    assert len(corners) == len(set(corners)) == 1999 and len(tried) <= 3 * 1999 + len(pages)
    assert scale == wanted or not wanted
    assert (len(pages) > 20) == (wanted > 0)


@pytest.mark.one_version
@pytest.mark.parametrize("seed", range(5))
def test_largest_free_box_is_the_largest(seed):
    tiles = part("operators.scene.skyline_packing")
    occupied = np.random.default_rng(seed).random((13, 11)) < 0.15
    found = tiles.largest_free_box(occupied)
    assert not occupied[found.y : found.y + found.height, found.x : found.x + found.width].any()
    largest = max(
        (high - low) * (right - left)
        for low in range(13) for high in range(low, 14) for left in range(11) for right in range(left, 12)
        if not occupied[low:high, left:right].any()
    )  # fmt: skip
    assert found.width * found.height == largest
    assert tiles.largest_free_box(np.ones((5, 7), bool)) == tiles.Box(0, 0, 0, 0)


def test_charts_beside_each_other_keep_their_place():
    """Sixteen objects share borders on a crooked grid, as a packer without gaps has them."""
    resolution(256)
    rng = np.random.default_rng(4)
    axis = np.r_[0, np.sort(rng.uniform(0.1, 0.9, 3)), 1]
    for row in range(4):
        for column in range(4):
            low, high = (axis[column], axis[row]), (axis[column + 1], axis[row + 1])
            square(f"Part {row} {column}", box(low, high))
    assert all((place.scale, place.offset) == (1, (0, 0)) for _, place in read_scene().objects)


def test_placing_pauses_for_each_object():
    """However many objects there are, a window goes on."""
    import bpy

    context = part("operators.scene").SceneContext(bpy.context)
    meshes = finished(part("operators.check.meshes").read_meshes(context, row_of(23)))
    steps = sum(1 for _ in part("operators.check.uvs").find_charts(meshes, 64))
    assert steps > 5 * 23
