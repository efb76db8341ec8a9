"""Seams of whole bakes: every output shows the same on both sides, and nothing else changes."""

from dataclasses import replace

import numpy as np

from engine import Light, Scene, Settings
from engine.postprocess.bilinear import footprints
from engine.scene.triangles import join_meshes
from tests.analytic.drive import drive
from tests.analytic.scenes import material, quads, rectangle
from tests.seams import find_seams

SETTINGS = Settings(
    resolution=53, visibility="rays", samples=128, max_bounces=2, light_samples=16, intermediates=False,
    outputs=("combined", "direct", "indirect", "ambient_occlusion", "shadow_mask"), ao_samples=64,
)  # fmt: skip


def tiles() -> Scene:
    """Return a floor of two tiles in two atlases, turned to one another, under a card that shades both."""
    left = quads(rectangle((-2, -1, 0), (2, 0, 0), (0, 2, 0))[None], [(3, 4, 37, 31)], [0], 53, "Left")
    right = quads(rectangle((1.7, -1, 0), (0, 2, 0), (-1.7, 0, 0))[None], [(7, 2, 29, 23)], [0], 53, "Right")
    card = rectangle((-0.4, -0.3, 0.4), (0.9, 0.1, 0), (-0.1, 0.7, 0.1))
    back = card[[1, 0, 3, 2]] + (0, 0, 0.01)
    shade = quads(np.stack([card, back]), [(42, 4, 9, 9), (42, 15, 9, 9)], [0, 0], 53, "Card")
    lamp = Light("Lamp", "point", np.array([0.2, 0.1, 2.0]), np.eye(3), np.full(3, 9, np.float32), 0.6)
    return Scene(
        (left, replace(right, atlas=1), shade),
        (material("Grey", 0.7),),
        ("Left", "Right"),
        np.full(3, 0.3, np.float32),
        lights=(lamp,),
    )


def steps(lightmap, seams, name):
    """Return the mean step across seams of one output."""
    pixels = lightmap.passes[name].reshape(-1, 3)
    sides = []
    for side in (0, 1):
        texels, weights = footprints(seams.atlas[:, side], seams.texel[:, side], 53)
        sides.append(np.einsum("pk,pkc->pc", weights, pixels[texels]))
    return np.abs(sides[0] - sides[1]).mean()


def test_every_output_has_less_than_a_tenth_of_the_steps_and_the_same_texels_elsewhere():
    scene = tiles()
    plain, fitted = (drive(scene, replace(SETTINGS, hide_seams=on)) for on in (False, True))
    seams = find_seams(join_meshes(scene), 2, 53)
    read = np.zeros(plain.has_patch.size, bool)
    for side in (0, 1):
        texels, weights = footprints(seams.atlas[:, side], seams.texel[:, side], 53)
        read[texels[weights > 0]] = True
    inside = plain.has_patch & ~read.reshape(plain.has_patch.shape)
    assert (plain.image == fitted.image).all() and inside.sum() > 1500
    assert list(fitted.passes) == [*SETTINGS.outputs[:4], "shadow_mask Lamp"]
    for name, display in fitted.passes.items():
        assert steps(fitted, seams, name) < steps(plain, seams, name) / 10, name
        assert (display[inside] == plain.passes[name][inside]).all(), name
        assert np.isfinite(display).all() and display.min() >= 0
    assert max(fitted.passes[name].max() for name in ("ambient_occlusion", "shadow_mask Lamp")) <= 1


def test_a_sharp_ridge_that_is_shaded_smooth_stays_hidden():
    """From the patches beside it each side hides the other, but nothing stands there."""
    slopes = [
        rectangle((-1, -1, 0), (1, 0, 1.3), (0, 2, 0)),
        rectangle((0, -1, 1.3), (1, 0, -1.3), (0, 2, 0)),
    ]
    roof = quads(np.stack(slopes), [(3, 4, 17, 31), (27, 5, 19, 29)], [0, 0], 53, "Roof")
    roof = replace(roof, normals=np.full_like(roof.normals, (0, 0, 1)))
    lamp = Light("Lamp", "point", np.array([-1.1, 0.1, 2.0]), np.eye(3), np.full(3, 9, np.float32), 0.1)
    world = np.full(3, 0.03, np.float32)
    scene = Scene((roof,), (material("Grey", 0.3),), ("Roof",), world, lights=(lamp,))
    settings = replace(SETTINGS, outputs=("combined",))
    plain, fitted = (drive(scene, replace(settings, hide_seams=on)) for on in (False, True))
    seams = find_seams(join_meshes(scene), 1, 53)
    assert steps(plain, seams, "combined") > 0.3 * plain.image.mean()
    assert steps(fitted, seams, "combined") < steps(plain, seams, "combined") / 10
