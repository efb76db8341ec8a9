"""Settings of bakes whose surfaces are tinted."""

import numpy as np
import pytest

from engine import Material, Scene, Settings
from engine.plan.tinted import settings_for_tints
from engine.scene.tints import ENTRY_BITS, SIZE
from engine.scene.transmission import OPAQUE, Transmission, Transmittance
from engine.visibility.raster.targets import MAX_PATCHES
from tests.transparency import transparent

BLACK = np.zeros(3, np.float32)
TINTED = Transmission(shadow_back=OPAQUE, bounce_back=Transmittance(np.float32([0.5, 0.4, 0.5])))


def scene(*transmissions):
    named = enumerate(transmissions)
    return Scene((), tuple(Material(f"Pane {n}", BLACK, BLACK, transmission=each) for n, each in named))


@pytest.mark.parametrize("visibility", ["auto", "raster", "rays"])
def test_rays_find_what_is_seen_through_tints(visibility):
    settings = Settings(visibility=visibility)
    assert settings_for_tints(scene(transparent(0.5), TINTED), settings)[0].visibility == "rays"
    assert settings_for_tints(scene(transparent(0.5)), settings) == (settings, ())


def test_drawn_hemicubes_tell_that_tints_are_grey():
    settings = Settings(method="paper")
    same, (note,) = settings_for_tints(scene(transparent(0.5), TINTED, TINTED), settings)
    assert same == settings and note.startswith("'Pane 1', 'Pane 2': ") and note.count(". ") == 1


def test_entries_of_all_patches_leave_room_for_a_tint():
    """Two more entries are nothing and the background."""
    assert MAX_PATCHES + 2 <= 1 << ENTRY_BITS and SIZE <= 1 << (32 - ENTRY_BITS)
