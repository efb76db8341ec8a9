"""Textures over texels, on the device, are what the host finds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from engine import Material, Mesh, Scene, Texture
from engine.patches import texture_means
from engine.patches.geometry import patch_geometry
from engine.patches.patch_materials import patch_surfaces
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import quads, rectangle
from tests.reference.cpu_patches import list_patches

RESOLUTION = 37
NONE = np.zeros(3, np.float32)


def images():
    """Return images of odd sizes: coarser than texels, as fine, and much finer."""
    rng = np.random.default_rng(5)
    return [rng.random((height, width, 3), np.float32) for height, width in ((5, 3), (67, 131), (509, 1021))]


def quad(name: str, chart, materials, uvs: np.ndarray) -> Mesh:
    mesh = quads(rectangle((0, 0, 0), (4, 0, 0), (0, 2, 0))[None], [chart], [0], RESOLUTION, name)
    corners = np.float32([[0, 1, 2], [0, 2, 3]]).astype(int)
    return replace(mesh, material=np.int32(materials), texture_uvs={"Map": np.float32(uvs)[corners]})


def textured_scene(**texture) -> Scene:
    """Return four quads, of which one triangle is plain; three materials have images of different sizes."""
    turned = np.array([[1.7, 0.4, -0.3], [-0.6, 0.9, 0.6]])
    maps = [Texture("T", pixels, "Map", turned, **texture) for pixels in images()]
    grey = np.float32([0.5, 0.25, 0.125])
    materials = (
        Material("Coarse", grey, grey, reflectance_map=maps[0], emission_map=maps[2]),
        Material("Plain", grey, NONE),
        Material("Even", grey, NONE, reflectance_map=maps[1]),
        Material("Fine", grey, grey, reflectance_map=maps[2], emission_map=maps[2]),
    )
    unit = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    meshes = (
        quad("First", (1, 1, 11, 13), (0, 1), unit),
        quad("Second", (14, 1, 9, 17), (3, 3), 0.1 * unit + 0.3),
        quad("Third", (1, 19, 13, 16), (2, 2), unit * (3, -1) - 40),
        quad("Fourth", (17, 19, 17, 17), (3, 0), unit * (-7, 2)),
    )
    return Scene(meshes, materials)


def surfaces_of(compute, scene):
    patches = list_patches(scene, RESOLUTION)
    return patch_surfaces(compute, scene, patch_geometry(join_meshes(scene), patches), RESOLUTION)


@pytest.mark.parametrize("srgb", [False, True])
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("extension", ["repeat", "mirror", "extend", "clip"])
def test_textures_are_those_of_the_host(compute, extension, smooth, srgb):
    scene = textured_scene(extension=extension, smooth=smooth, srgb=srgb)
    expected, found = surfaces_of(None, scene), surfaces_of(compute, scene)
    for name in ("reflectance", "emission"):
        difference = np.abs(getattr(found, name) - getattr(expected, name)).max(axis=1)
        assert len(np.unique(getattr(expected, name))) > 500

        # A sample on the border of a triangle or of a plain pixel may be taken for either side.
        assert np.quantile(difference, 0.97 if smooth else 0.9) < 1e-4 and difference.mean() < 1e-3


def test_images_are_shrunk_in_strips(compute, monkeypatch):
    scene = textured_scene()
    whole = surfaces_of(compute, scene).reflectance
    monkeypatch.setattr(texture_means, "_STRIP", 12 * 1021 * 11)
    assert surfaces_of(compute, scene).reflectance == pytest.approx(whole, abs=1e-6)


def test_images_that_the_device_cannot_hold_are_left_to_the_host():
    small, scene = SimpleNamespace(device=SimpleNamespace(max_mem_alloc_size=1 << 20)), textured_scene()
    assert (surfaces_of(small, scene).emission == surfaces_of(None, scene).emission).all()
