from dataclasses import replace

import numpy as np
import pytest

from engine.errors import SceneError
from engine.scene.checks import check_light, check_scene
from engine.scene.model import Light, Material, Mesh, Scene, Texture


def triangle(**changes):
    positions = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    normals = np.broadcast_to(np.float32([0, 0, 1]), (1, 3, 3))
    index = np.zeros(1, np.int32)
    return replace(Mesh("Lamp", positions, normals, positions[..., :2], index, index, index), **changes)


def scene(*meshes):
    return Scene(meshes, (Material("grey", np.ones(3), np.zeros(3)),))


def test_a_sound_scene_passes():
    check_scene(scene(triangle()))


@pytest.mark.parametrize("name", ["positions", "normals", "uvs"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_not_finite(name, value):
    values = getattr(triangle(), name).copy()
    values[0, 1, 0] = value
    with pytest.raises(SceneError, match="Object 'Lamp' has NaN.*[.] [A-Z]"):
        check_scene(scene(triangle(**{name: values})))


def test_uvs_outside():
    with pytest.raises(SceneError, match="Object 'Lamp' has lightmap UVs outside 0-1"):
        check_scene(scene(triangle(uvs=triangle().uvs + 0.5)))


@pytest.mark.parametrize(
    ("reflectance", "emission"), [(np.nan, 0), (1.5, 0), (-0.1, 0), (0.5, np.inf), (0.5, -1), (0.5, 3e38)]
)
def test_materials_that_are_no_light(reflectance, emission):
    bad = Material("Neon", np.full(3, reflectance), np.full(3, emission))
    with pytest.raises(SceneError, match="Material 'Neon' has .*Correct its"):
        check_scene(replace(scene(triangle()), materials=(bad,)))


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_the_largest_light_passes_and_an_error_names_the_limit(kind):
    neon = Material("Neon", np.ones(3), np.full(3, 1e30, kind))
    check_scene(replace(scene(triangle()), materials=(neon,), world=neon.emission))
    for values in ({"materials": (replace(neon, emission=neon.emission * 2),)}, {"world": neon.emission * 2}):
        with pytest.raises(SceneError, match="NaN, negative or greater than 1e[+]30"):
            check_scene(replace(scene(triangle()), **values))


def test_a_light_that_overflows_float32_close_to_it_is_named():
    strongest = Light("Lamp", "point", np.zeros(3), np.eye(3), np.full(3, 1e18, np.float32))
    check_light(strongest)
    for strength in (3e18, 1e30, np.inf, np.nan, -1.0):
        with pytest.raises(SceneError, match="Light 'Lamp' has a power .*greater than 2e[+]18[.] Change its"):
            check_light(replace(strongest, strength=np.full(3, strength)))


def textured(**changes):
    texture = replace(Texture("Tiles", np.ones((3, 5, 3), np.float32), "Map"), **changes)
    return Material("Wall", np.ones(3), np.zeros(3), reflectance_map=texture)


def test_a_texture_without_pixels():
    there = triangle(texture_uvs={"Map": triangle().uvs})
    with pytest.raises(SceneError, match="Texture 'Tiles' of material 'Wall' has no pixels[.] Choose"):
        check_scene(replace(scene(there), materials=(textured(pixels=np.ones((0, 5, 3))),)))


def test_a_texture_on_a_mesh_without_its_uv_map():
    there = triangle(texture_uvs={"Map": triangle().uvs})
    check_scene(replace(scene(there), materials=(textured(),)))
    with pytest.raises(SceneError, match="Object 'Lamp' has no UV map 'Map', which texture 'Tiles'.*[.] Add"):
        check_scene(replace(scene(there, triangle()), materials=(textured(),)))


@pytest.mark.parametrize("index", [-1, 1, 2**31 - 1])
def test_a_material_that_is_not_there(index):
    with pytest.raises(SceneError, match="Object 'Lamp' refers to materials .* has 1[.] Assign"):
        check_scene(scene(triangle(), triangle(material=np.int32([index]))))


@pytest.mark.parametrize("index", [-2, 1, 2**31 - 1])
def test_an_atlas_that_is_not_there(index):
    with pytest.raises(SceneError, match="Object 'Lamp' refers to atlas .* has 1[.] Use"):
        check_scene(scene(triangle(), triangle(atlas=index)))


def test_a_light_of_an_unknown_kind():
    with pytest.raises(SceneError, match="Light 'Lamp' is of kind 'beam'[.] Choose one of point, spot"):
        check_scene(replace(scene(triangle()), lights=(lamp("beam"),)))


@pytest.mark.parametrize("factor", [1e9, 1e-9])
def test_scenes_of_sizes_that_can_be_baked(factor):
    check_scene(scene(triangle(positions=triangle().positions * np.float32(factor))))


def test_an_object_that_reaches_too_far_is_named():
    far = triangle(name="Far", positions=triangle().positions - np.float32([0, 1.01e9, 0]))
    empty = np.zeros((0, 3, 3), np.float32)
    nothing = triangle(
        name="Nothing", positions=empty, face=np.zeros(0, np.int32), subface=np.zeros(0, np.int32)
    )
    with pytest.raises(SceneError, match="Object 'Far' reaches 1.01e[+]09 units.*[.] [A-Z]"):
        check_scene(scene(triangle(), nothing, far))


def test_a_scene_that_is_too_small_is_told_with_its_largest_object():
    small, large = (
        triangle(name=name, positions=triangle().positions * np.float32(size))
        for name, size in (("A", 1e-11), ("B", 9e-10))
    )
    with pytest.raises(SceneError, match="only 9e-10 units.*'B'.*[.] [A-Z]"):
        check_scene(scene(small, large))


@pytest.mark.parametrize(
    "values", [{"position": np.array([0, -2e15, 0])}, {"radius": 2e9}, {"size": np.array([1, 2e9])}]
)
def test_lights_beyond_what_float32_holds(values):
    limits = "farther than 1e[+]15 units or larger than 1e[+]09 units"
    with pytest.raises(SceneError, match=f"Light 'Lamp' is {limits}"):
        check_scene(replace(scene(triangle()), lights=(lamp("point", **values),)))


def lamp(kind, **values):
    return Light(
        "Lamp", **{"kind": kind, "position": np.zeros(3), "axes": np.eye(3), "strength": np.ones(3)} | values
    )


@pytest.mark.parametrize("kind", ["sun", "spot", "area"])
def test_lights_without_a_direction(kind):
    flat = lamp(kind, axes=np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(SceneError, match="Light 'Lamp' has axes"):
        check_scene(replace(scene(triangle()), lights=(flat,)))


def test_a_point_needs_no_direction_and_a_spot_is_not_flat():
    check_scene(replace(scene(triangle()), lights=(lamp("point", axes=np.zeros((3, 3))),)))
    with pytest.raises(SceneError, match="Light 'Lamp' has axes"):
        check_scene(replace(scene(triangle()), lights=(lamp("spot", stretch=np.array([1.0, 0.0, 1.0])),)))


def test_a_world_that_is_no_light():
    with pytest.raises(SceneError, match="world's radiance"):
        check_scene(replace(scene(triangle()), world=np.float32([1, np.nan, 1])))


@pytest.mark.parametrize("shape", [(0, 2, 3), (4, 0, 3), (4, 2), (4, 2, 4), (4,), ()])
def test_a_world_that_is_no_image(shape):
    with pytest.raises(SceneError, match="The world's (image|radiance) has .*[.] (Choose|Give)"):
        check_scene(replace(scene(triangle()), world=np.ones(shape, np.float32)))


@pytest.mark.parametrize(
    ("face", "subface"),
    [((1, 0), (0, 0)), ((0, 0), (1, 0)), ((0, 0), (0, 0)), ((-1, 0), (0, 0)), ((0, 0), (-1, 0))],
)
def test_triangles_out_of_order(face, subface):
    one = triangle()
    two = {name: np.repeat(getattr(one, name), 2, axis=0) for name in ("positions", "normals", "uvs")}
    index = {"face": np.int32(face), "subface": np.int32(subface), "material": np.zeros(2, np.int32)}
    with pytest.raises(SceneError, match="of object 'Lamp' are not in the order"):
        check_scene(scene(triangle(**two, **index)))


def test_meshes_without_faces_beside_others():
    """A large mesh and a faulty one, whose groups leave the empty mesh alone."""
    one, count = triangle(), 5000
    names = ("positions", "normals", "uvs", "subface", "material")
    many = {name: np.repeat(getattr(one, name), count, axis=0) for name in names}
    empty, large = one.subset(np.zeros(1, bool)), triangle(**many, face=np.arange(count, dtype=np.int32))
    check_scene(scene(large, empty))
    bad = triangle(name="Bad", positions=np.full((1, 3, 3), np.nan, np.float32))
    with pytest.raises(SceneError, match="Object 'Bad' has NaN"):
        check_scene(scene(empty, bad))


def test_no_mesh():
    with pytest.raises(SceneError, match="no mesh with faces"):
        check_scene(scene())
