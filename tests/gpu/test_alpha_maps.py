"""Alpha maps of any number and size: drawing and rays find the same holes."""

import dataclasses

import numpy as np
import pytest

from engine import Material, Scene, SceneError, Settings, Texture
from engine.scene import cutouts
from engine.scene.cutouts import read_cutouts
from engine.visibility.raster import raster
from tests.analytic.drive import drive
from tests.analytic.scenes import quads, rectangle
from tests.rows import long
from tests.transparency import clear_back, transparent

BLACK = np.zeros(3, np.float32)
SETTINGS = Settings(resolution=64, hemicube=8, max_bounces=1, sample_emission=False)
UVS = np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])


def see_through(pixels, alpha=1.0, threshold=None):
    seen = transparent(alpha, Texture("Holes", pixels, "Map"), threshold)
    return Material("Curtain", BLACK, BLACK, transmission=seen)


def squares(materials):
    """Return a black square under the sky for each material, each under a wide canopy of that material."""
    count = len(materials)
    meshes = []
    for index in range(count):
        x, y = 100 * index, 7 * index % 53
        square = rectangle((x, 0, 0), (1, 0, 0), (0, 1, 0))[None]
        canopy = rectangle((x - 39.5, -39.5, 0.05), (0, 80, 0), (80, 0, 0))[None]
        meshes.append(quads(square, [(y, 0, 5, 5)], [count], 64, f"Square {index}"))
        meshes.append(
            dataclasses.replace(
                quads(canopy, [(y, 8, 5, 5)], [index], 64, f"Canopy {index}"), texture_uvs={"Map": UVS}
            )
        )
    materials = (*materials, Material("Black", BLACK, BLACK))
    return Scene(tuple(meshes), materials, world=np.ones(3, np.float32))


def lights(materials, **changes):
    """Return the mean E/pi of each material's square."""
    image = drive(squares(materials), dataclasses.replace(SETTINGS, **changes)).image[0, ..., 0]
    return [image[:5, 7 * index % 53 :][:, :5].mean() for index in range(len(materials))]


WAYS = pytest.mark.parametrize(
    "changes", [{"visibility": "rays"}, long({"visibility": "raster"}), long({"method": "paper"})], ids=str
)


@WAYS
def test_four_maps_of_4096_pixels_are_seen(changes):
    """Together they hold more pixels than one texture does; only the last one has a hole."""
    maps = [np.ones((4096, 4096, 1), np.float32) for _ in range(5)]
    for index, pixels in enumerate(maps[:4]):
        pixels[index, index] = 0
    maps[4][:] = 0
    assert lights([see_through(pixels) for pixels in maps], **changes) == pytest.approx(
        [0, 0, 0, 0, 1], abs=0.01
    )


@WAYS
def test_maps_in_several_layers_are_seen(monkeypatch, changes):
    """Odd sizes, so that rows of an image go on in the next layer."""
    monkeypatch.setattr(raster, "HEIGHT", 3)
    half = np.zeros((127, 212, 1), np.float32)
    half[:, 106:] = 1
    open_, closed = np.zeros((61, 89, 1), np.float32), np.ones((103, 97, 1), np.float32)
    found = lights([see_through(pixels) for pixels in (closed, half, open_, closed)], **changes)
    assert found == pytest.approx([0, 0.5, 1, 0], abs=0.04)


@WAYS
def test_more_materials_than_a_texture_is_wide(changes):
    """Of 20,011 materials the last but one has see-through backs, and its canopy is seen from behind."""
    opaque = Material("Opaque", BLACK, BLACK)
    scene = squares([clear_back(opaque), opaque])
    last = 20_010
    numbers = np.array([last - 1, last, last - 2])
    meshes = tuple(
        dataclasses.replace(
            mesh,
            material=numbers[mesh.material].astype(np.int32),
            positions=mesh.positions[:, ::-1] if "Canopy" in mesh.name else mesh.positions,
        )
        for mesh in scene.meshes
    )
    materials = (opaque,) * (last - 1) + (clear_back(opaque), opaque)
    scene = dataclasses.replace(scene, meshes=meshes, materials=materials)
    image = drive(scene, dataclasses.replace(SETTINGS, **changes)).image[0, ..., 0]
    assert (image[:5, :5].mean(), image[:5, 7:12].mean()) == pytest.approx((1, 0), abs=0.01)


def test_an_image_is_kept_once_however_many_materials_use_it():
    image, other = np.random.default_rng(3).random((2, 37, 53, 1), np.float32)
    materials = [
        see_through(pixels, alpha=0.5 + index / 20)
        for index, pixels in enumerate([image, image, image.copy(), other, image])
    ]
    found = read_cutouts(squares(materials))
    assert len(found.pixels) == 2 * image.size + 1
    assert found.maps[::4, 0].tolist() == [0, 0, 0, image.size, 0, 0]
    turned = read_cutouts(squares([see_through(image), see_through(image.reshape(53, 37, 1))]))
    assert turned.maps[:8:4, 1:3].tolist() == [[53, 37], [37, 53]]


def test_pixels_of_8_and_16_bits_are_kept_exactly():
    levels = np.concatenate([np.arange(256) / np.float32(255), np.arange(65536) / np.float32(65535)])
    kept = read_cutouts(squares([see_through(levels.astype(np.float32).reshape(1, -1, 1))])).pixels[:-1]
    assert (kept[:256] == 257 * np.arange(256)).all() and (kept[256:] == np.arange(65536)).all()


@WAYS
@pytest.mark.parametrize("threshold", [0.1, 0.3, 0.5, 1.0])
def test_alpha_as_high_as_the_threshold_is_opaque(changes, threshold):
    """This holds for any rounding of the threshold."""
    level = np.full((5, 7, 1), threshold, np.float32)
    materials = [see_through(pixels, threshold=threshold) for pixels in (level, level - 1e-4)]
    assert lights(materials, **changes) == pytest.approx([0, 1], abs=0.01)


def test_more_pixels_than_can_be_counted_are_a_clear_error(monkeypatch):
    monkeypatch.setattr(cutouts, "MOST_PIXELS", 100)
    with pytest.raises(
        SceneError, match="transparency maps exceed 100 pixels at 'Holes' .143.*smaller images"
    ):
        read_cutouts(squares([see_through(np.ones((11, 13, 1), np.float32))]))
