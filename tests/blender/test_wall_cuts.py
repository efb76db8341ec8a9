"""Charts that end at edges along thin walls, on request of the warning that names the walls."""

import json

import numpy as np
import pytest

from tests.blender.things import CUBE, loop_uvs, mesh_object, snapshot

#: Faces of CUBE as seen from outside.
OUTWARD = [
    face[::-1]
    for face in ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
]


def floor(columns, rows=(0, 1.3, 3), name="Floor", height=0.0):
    """Return a floor with vertices at some x and y."""
    vertices = [(x, y, height) for y in rows for x in columns]
    across = len(columns)
    first = [row * across + column for row in range(len(rows) - 1) for column in range(across - 1)]
    return mesh_object(name, vertices, [(i, i + 1, i + across + 1, i + across) for i in first])


def wall(low, high, name="Wall"):
    """Return a closed box between two corners."""
    low, high = np.array(low, float), np.array(high, float)
    return mesh_object(name, [tuple(low + (high - low) * corner) for corner in np.array(CUBE)], OUTWARD)


def cut(names=("Wall",)):
    import bpy

    return bpy.ops.hemibake.fix(fix="cut_along_walls", names=json.dumps(names))


def gap(obj, x):
    """Return the smallest distance between UVs of faces on both sides of a line at x, texels."""
    import bpy

    size = bpy.context.scene.hemibake.resolution
    uvs, middles = loop_uvs(obj), np.array([polygon.center.x for polygon in obj.data.polygons])
    sides = [np.concatenate([uvs[list(obj.data.polygons[i].loop_indices)] for i in np.flatnonzero(chosen)])
             for chosen in (middles < x, middles > x)]  # fmt: skip
    return round(float(np.abs(sides[0][:, None] - sides[1]).max(axis=2).min() * size), 3)


@pytest.fixture(autouse=True)
def resolution():
    import bpy

    bpy.context.scene.hemibake.resolution = 61


@pytest.mark.parametrize(
    "place",
    [
        {"low": (1.0, -0.1, 0), "high": (1.02, 3.1, 2)},
        {"low": (0.98, -0.1, -0.5), "high": (1.0, 3.1, 2)},
        {"low": (0.99, 0.2, -0.01), "high": (1.013, 1.9, 2)},
    ],
    ids=["beside the edge", "sunk, beyond it", "a part of it, with a door"],
)
@pytest.mark.parametrize("scale", [1.0, 0.037])
def test_charts_end_along_a_wall(place, scale):
    import bpy

    obj = floor((0, 1.0, 2.2, 3.1))
    obj.hemibake.lightmap_scale = scale
    wall(**place)
    bpy.ops.hemibake.unwrap()
    assert gap(obj, 1.0) == 0
    assert cut() == {"FINISHED"} and obj.hemibake.cut_along_walls
    assert gap(obj, 1.0) >= 2 and gap(obj, 2.2) == 0
    obj.data.uv_layers.remove(obj.data.uv_layers["Lightmap"])
    bpy.ops.hemibake.unwrap()
    assert gap(obj, 1.0) >= 2 and gap(obj, 2.2) == 0


@pytest.mark.parametrize("columns", [(0, 3.1), (0, 1.2, 3.1)])
def test_wall_without_an_edge_is_named_and_nothing_changes(columns):
    import bpy

    floor(columns)
    wall((1.0, -0.1, 0), (1.02, 3.1, 2))
    bpy.ops.hemibake.unwrap()
    before = snapshot()
    with pytest.raises(RuntimeError, match="'Wall': the surface below has no edge"):
        cut()
    assert snapshot() == before


def test_turned_mirrored_and_scaled_walls_and_floors():
    import bpy
    from mathutils import Matrix

    obj, post = floor((0, 1.0, 2.2, 3.1)), wall((1.0, -0.1, 0), (1.02, 3.1, 2))
    turn = Matrix.Rotation(0.7, 4, (1, 2, 3)) @ Matrix.Diagonal((-1, 2.3, 0.7, 1))
    for each in (obj, post):
        each.matrix_world = Matrix.Translation((900, -40, 7)) @ turn
    bpy.context.view_layer.update()
    assert cut() == {"FINISHED"} and gap(obj, 1.0) >= 2


def test_only_what_the_wall_stands_on_is_cut():
    import bpy

    obj, other = floor((0, 1.0, 2.2)), floor((0, 1.0, 2.2), name="Below", height=-3)
    wall((1.0, -0.1, 0), (1.02, 3.1, 2))
    bpy.ops.hemibake.unwrap()
    assert cut() == {"FINISHED"}
    assert obj.hemibake.cut_along_walls and not other.hemibake.cut_along_walls
    assert gap(obj, 1.0) >= 2 and gap(other, 1.0) == 0


def test_layer_that_was_chosen_stays():
    import bpy

    obj = floor((0, 1.0, 2.2))
    wall((1.0, -0.1, 0), (1.02, 3.1, 2))
    bpy.ops.hemibake.unwrap()
    obj.hemibake.own_uv_layer = "Lightmap"
    obj.data.uv_layers["Lightmap"].uv[0].vector.x += 0.01
    before = snapshot()
    with pytest.raises(RuntimeError, match="'Floor': UV layer of your choice"):
        cut()
    assert snapshot() == before


def test_warning_of_a_bake_offers_the_cut_and_little_shows_through_before_and_after_it():
    """A closed hall of two parts, one of them lit; texels are wider than the wall."""
    import bpy

    size = 96
    hall = floor((0, 0.6, 1.2), (0, 0.5, 1.2), "Floor")
    for name, low, high in (
        ("Ceiling", (-0.1, -0.1, 1), (1.3, 1.3, 1.1)), ("Left", (-0.1, -0.1, -0.1), (0, 1.3, 1.1)),
        ("Right", (1.2, -0.1, -0.1), (1.3, 1.3, 1.1)), ("Front", (-0.1, -0.1, -0.1), (1.3, 0, 1.1)),
        ("Back", (-0.1, 1.2, -0.1), (1.3, 1.3, 1.1)), ("Wall", (0.6, -0.05, -0.05), (0.62, 1.25, 1.05)),
    ):  # fmt: skip
        wall(low, high, name)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.location = 10, (0.3, 0.5, 0.6)
    bpy.context.scene.collection.objects.link(lamp)
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.texel_samples = size, "16"

    def dark():
        """Return the brightest texel of the floor beyond the wall, of all of it."""
        bpy.ops.hemibake.bake()
        image = np.array(hall.hemibake.image.pixels).reshape(size, size, 4)[..., 0]
        most = []
        for polygon in hall.data.polygons:
            corners = loop_uvs(hall)[list(polygon.loop_indices)] * size
            low, high = np.round(corners.min(axis=0)).astype(int), np.round(corners.max(axis=0)).astype(int)
            most.append((polygon.center.x > 0.6, image[low[1] : high[1], low[0] : high[0]].max()))
        return max(light for beyond, light in most if beyond) / max(light for _, light in most)

    leak = dark()
    report = json.loads(settings.report)
    (kind,) = [fix for fix in report["fixes_of_warnings"] if fix]
    assert kind == "cut_along_walls" and leak < 0.06
    assert cut(report["objects_of_warnings"][report["fixes_of_warnings"].index(kind)]) == {"FINISHED"}
    after = dark()
    assert gap(hall, 0.6) >= 2 and after < 0.06
