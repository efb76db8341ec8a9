"""Objects inside other geometry are named in the report."""

import numpy as np

from engine import Scene, Settings
from engine.object_message import objects_of
from tests.analytic.drive import drive
from tests.analytic.rooms import Atlas, block, lamp
from tests.analytic.scenes import material


def named(shell_low):
    """Return the objects that a bake names as buried: a crate in a shell above a slab."""
    atlas = Atlas(127)
    meshes = (
        block(atlas, (-0.3, -0.3, -0.2), (0.7, 0.7, -0.1), "Slab"),
        block(atlas, (0.2, 0.2, 0.12), (0.36, 0.32, 0.25), "Crate"),
        block(atlas, shell_low, (0.6, 0.61, 0.5), "Shell"),
    )
    scene = Scene(
        meshes, (material("Grey", 0.6),), ("Lightmap",), np.ones((1, 1, 3)), lights=(lamp((0, 0, 2)),)
    )
    result = drive(scene, Settings(resolution=127, hemicube=8, samples=64))
    notes = [note for note in result.report.warnings if "inside other geometry" in note]
    assert len(notes) <= 1
    return objects_of(notes[0]) if notes else ()


def test_an_object_in_a_shell_is_named():
    assert named((-0.1, -0.1, 0.0)) == ("Crate",)


def test_an_object_in_the_open_is_not_named():
    assert named((0.43, -0.1, 0.0)) == ()
