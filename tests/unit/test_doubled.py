from types import SimpleNamespace

import numpy as np

from engine.patches.backs import with_places
from engine.patches.geometry import patch_geometry
from engine.scene.model import Scene
from engine.scene.triangles import join_meshes
from tests.analytic.scenes import material, quads, rectangle
from tests.reference.cpu_patches import list_patches
from tools.verification.doubled import doubled_texels


def test_texels_on_a_second_face_are_found():
    """A square, another mesh that lies on its right half, face down, and one that floats above both."""
    corners = (
        rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)),
        rectangle((1, 0, 0), (-0.5, 0, 0), (0, 1, 0)),
        rectangle((0, 0, 1e-3), (1, 0, 0), (0, 1, 0)),
    )
    charts = ((0, 0, 8, 6), (10, 0, 4, 6), (0, 10, 8, 6))
    pairs = zip(corners, charts, strict=True)
    meshes = tuple(quads(corner[None], [chart], [0], 19) for corner, chart in pairs)
    doubled = doubled_texels(parts_of(Scene(meshes, (material("Grey", 0.5),)), 19), 1)[0]
    expected = np.zeros((19, 19), bool)
    expected[0:6, 4:8] = expected[0:6, 10:14] = True
    assert (doubled == expected).all()


def test_back_faces_of_open_surfaces_do_not_count():
    """The engine gives the back of a lone square a triangle of its own, in the same place."""
    corners = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    scene = Scene((quads(corners[None], [(0, 0, 8, 6)], [0], 19),), (material("Grey", 0.5),))
    placed = with_places(scene, 19)
    assert len(placed.meshes) == 2
    assert not doubled_texels(parts_of(placed, 19), 1).any()


def parts_of(scene: Scene, resolution: int) -> SimpleNamespace:
    triangles, patches = join_meshes(scene), list_patches(scene, resolution)
    geometry = patch_geometry(triangles, patches)
    return SimpleNamespace(triangles=triangles, patches=patches, geometry=geometry)
