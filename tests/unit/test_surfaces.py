from dataclasses import replace

import numpy as np
import pytest

from engine.patches import patch_materials as surfaces_module
from engine.patches.geometry import patch_geometry
from engine.patches.patch_materials import KnownSurfaces, PatchMaterials, patch_surfaces
from engine.scene.model import Material, Mesh, Scene, Texture
from engine.scene.texture import sample
from engine.scene.triangles import join_meshes
from tests.reference.cpu_patches import list_patches

BLACK = np.zeros(3, np.float32)


def textured_square(texture, resolution=16, uvs=((0, 0), (1, 0), (1, 1), (0, 1))):
    """Return reflectance by texel, (r, r, 3), of a square whose lightmap UVs fill the unit square."""
    square = np.float32([(0, 0), (1, 0), (1, 1), (0, 1)])
    split = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(
        name="Square",
        positions=np.concatenate([square, np.zeros((4, 1), np.float32)], axis=1)[split],
        normals=np.tile(np.float32([0, 0, 1]), (2, 3, 1)),
        uvs=square[split],
        face=np.zeros(2, np.int32),
        subface=np.arange(2, dtype=np.int32),
        material=np.zeros(2, np.int32),
        texture_uvs={"Map": np.float32(uvs)[split]},
    )
    scene = Scene((mesh,), (Material("M", np.full(3, 0.5, np.float32), BLACK, reflectance_map=texture),))
    patches, triangles = list_patches(scene, resolution), join_meshes(scene)
    surfaces = patch_surfaces(None, scene, patch_geometry(triangles, patches), resolution)
    image = np.zeros((resolution * resolution, 3))
    image[patches.texel] = surfaces.reflectance
    return image.reshape(resolution, resolution, 3)


def noise(size, channels=3):
    return np.random.default_rng(0).random((size, size, channels)).astype(np.float32)


def test_a_texel_shows_its_pixel_times_the_constant():
    pixels = noise(16)
    image = textured_square(Texture("T", pixels, "Map", smooth=False))
    assert image == pytest.approx(0.5 * pixels, abs=1e-6)


def test_fine_textures_are_averaged_over_a_texel():
    pixels = noise(256)
    expected = 0.5 * pixels.reshape(16, 16, 16, 16, 3).mean(axis=(1, 3))
    image = textured_square(Texture("T", pixels, "Map", smooth=False))
    difference = np.abs(image - expected)

    # The texels on the diagonal are cut by the edge between two triangles.
    assert difference[~np.eye(16, dtype=bool)].max() < 1e-6 and difference.mean() < 0.002


@pytest.mark.parametrize(("height", "width"), [(257, 251), (131, 67), (1, 509), (127, 1)])
def test_fine_textures_of_odd_sizes_are_not_shifted(height, width):
    """Values that grow along v and along u come out where they are on the surface."""
    up, across = (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    pixels = np.stack(np.broadcast_arrays(up[:, None], across, 0.5), axis=2).astype(np.float32)
    image = textured_square(Texture("T", pixels, "Map", extension="extend"), 7)

    # Without the middle, where the edge between two triangles cuts the texel.
    middles = np.delete((np.arange(7) + 0.5) / 7, 3)
    row, column = np.delete(image[3, :, 1], 3), np.delete(image[:, 3, 0], 3)
    assert column == pytest.approx(0.5 * (middles if height > 1 else np.full(6, 0.5)), abs=1e-4)
    assert row == pytest.approx(0.5 * (middles if width > 1 else np.full(6, 0.5)), abs=1e-4)


def test_the_transform_turns_the_image():
    pixels = noise(8)
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    image = textured_square(Texture("T", pixels, "Map", quarter, smooth=False), 8)
    assert image == pytest.approx(0.5 * pixels[::-1].transpose(1, 0, 2), abs=1e-6)


@pytest.mark.parametrize(
    ("extension", "expected"), [("repeat", 0.25), ("mirror", 0.75), ("extend", 1.0), ("clip", 0.0)]
)
def test_beyond_the_border(extension, expected):
    pixels = np.float32([0.0, 0.25, 0.75, 1.0]).reshape(1, 4, 1)
    texture = Texture("T", pixels, "Map", extension=extension, smooth=False)
    assert sample(pixels, np.array([[1.375, 0.5]]), texture)[0, 0] == expected


def test_smooth_textures_interpolate():
    pixels = np.float32([0.0, 1.0]).reshape(1, 2, 1)
    texture = Texture("T", pixels, "Map", extension="extend")
    values = sample(pixels, np.array([[0.1, 0.5], [0.5, 0.5], [0.375, 0.5]]), texture)[:, 0]
    assert values == pytest.approx([0.0, 0.5, 0.25])


def halves() -> Scene:
    """Return a square of two triangles and materials, both textured, of which the second shines."""
    square = np.float32([(0, 0), (1, 0), (1, 1), (0, 1)])
    split, numbers = np.array([[0, 1, 2], [0, 2, 3]]), np.arange(2, dtype=np.int32)
    corners = np.concatenate([square, np.zeros((4, 1), np.float32)], axis=1)[split]
    normals, uvs = np.tile(np.float32([0, 0, 1]), (2, 3, 1)), {"Map": square[split][:, ::-1]}
    mesh = Mesh("Halves", corners, normals, square[split], numbers, 0 * numbers, numbers, texture_uvs=uvs)
    grey, image = np.full(3, 0.5, np.float32), Texture("T", noise(9), "Map")
    dull, shining = (Material(name, grey, BLACK, reflectance_map=image) for name in "AB")
    glow = Texture("Glow", noise(5), "Map")
    return Scene((mesh,), (dull, replace(shining, emission=3 * grey, emission_map=glow)))


@pytest.mark.parametrize(
    ("edit", "read"),
    [("nothing", 0), ("colour", 1), ("pixels", 1), ("no texture", 0), ("uvs", 3), ("copies", 0)],
)
def test_only_textures_of_changed_materials_are_read_again(edit, read, monkeypatch):
    before = halves()
    (mesh,), (dull, shining) = before.meshes, before.materials
    other = Texture("Other", noise(7), "Map")
    copied = replace(dull.reflectance_map, pixels=dull.reflectance_map.pixels.copy())
    after = {
        "nothing": before,
        "colour": replace(
            before, materials=(replace(dull, reflectance=np.float32([0.1, 0.2, 0.9])), shining)
        ),
        "pixels": replace(before, materials=(dull, replace(shining, emission_map=other))),
        "no texture": replace(before, materials=(replace(dull, reflectance_map=None), shining)),
        "uvs": replace(before, meshes=(replace(mesh, texture_uvs={"Map": mesh.uvs}),)),
        "copies": replace(before, materials=(replace(dull, reflectance_map=copied), shining)),
    }[edit]
    geometry = patch_geometry(join_meshes(before), list_patches(before, 13))
    known = KnownSurfaces(before, patch_surfaces(None, before, geometry, 13))
    kept, expected = known.surfaces.emission.copy(), patch_surfaces(None, after, geometry, 13)
    found, multiply = [], surfaces_module.multiply_on_host

    def counted(geometry, meshes, values, maps):
        found.extend(maps)
        multiply(geometry, meshes, values, maps)

    monkeypatch.setattr(surfaces_module, "multiply_on_host", counted)
    again = patch_surfaces(None, after, geometry, 13, known)
    assert np.array_equal(again.reflectance, expected.reflectance)
    assert np.array_equal(again.emission, expected.emission) and again.emission.any()
    assert len(found) == read and np.array_equal(known.surfaces.emission, kept)
    assert (again.emission is known.surfaces.emission) == (edit not in ("pixels", "uvs"))


def test_sets_of_emitters_differ_if_only_the_faces_that_emit_differ():
    """Whether a back face lights a patch depends on the faces, not only on the patches."""
    dark, glow = np.zeros((7, 3), np.float32), np.zeros((7, 3), np.float32)
    glow[2] = 0, 5, 0
    both, front, back = (PatchMaterials(dark, *faces) for faces in ((glow,), (glow, dark), (dark, glow)))
    for one, other in ((both, front), (front, both), (front, back), (back, front)):
        assert not one.has_emitters_of(other)
    assert both.has_emitters_of(PatchMaterials(dark, 2 * glow, 3 * glow))
    assert front.has_emitters_of(PatchMaterials(dark, 3 * glow, dark))
