"""Substitute patches, which emit light for invalid ones."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine.direct.contact import Contacts
from engine.patches.patch_list import PatchList
from engine.patches.texels_around import beside_any, cells_around
from engine.plan.session_cache import SessionCache
from engine.texel_gather.valid_patches import substitutes_of
from engine.validity.invalid import is_invalid
from engine.validity.substitutes import find_substitutes, substitute_patches

HEIGHT, WIDTH = 5, 11


class Places:
    """Centres of patches, m, all of which face up, and texels of 1 m."""

    def __init__(self, center):
        self.center, self.geometric = center, np.tile([0.0, 0.0, 1.0], (len(center), 1))
        self.triangle = np.zeros(len(center), int)
        self.steps = SimpleNamespace(longer=np.ones(1))

    def subset(self, chosen):
        return Places(self.center[chosen])


def floor(entries=None, height=None):
    """Return the patches of a lightmap that is a floor; entries: (h, w), of the index map.

    height: (h, w), m, of the texels above the floor
    """
    row, column = np.divmod(np.arange(WIDTH * WIDTH), WIDTH)
    grid = np.arange(1, WIDTH * WIDTH + 1).reshape(WIDTH, WIDTH) if entries is None else entries
    first = np.unique(grid[grid > 0], return_index=True)[1]
    places = np.stack([column, row, np.zeros(WIDTH * WIDTH)], axis=1).astype(float)
    places[:, 2] = 0 if height is None else height.ravel()
    at = np.flatnonzero(grid.ravel() > 0)[first]
    index, patches = grid[None].astype(np.uint32), SimpleNamespace(key=at)
    return SimpleNamespace(texel_to_patch=index, entries=index, patches=patches, geometry=Places(places[at]))


def gathered_by(light, front):
    light, front = (np.asarray(values, np.float32).ravel() for values in (light, front))
    colors = np.stack([light, light / 2, 0 * light], axis=1)
    return SimpleNamespace(validity=front, light_of=colors.__getitem__)


def substitutes(patches, faces, gathered):
    """Return the substitutes of the patches that back faces or contacts make invalid."""
    return substitute_patches(patches, is_invalid(gathered.validity, faces), gathered.light_of)


def near(count):
    return Contacts(*np.zeros((3, count), bool))


def ramp():
    """Return light that falls along rows, (w, w), and an open view everywhere."""
    return np.tile(np.linspace(2, 1, WIDTH), (WIDTH, 1)), np.ones((WIDTH, WIDTH))


def test_all_that_is_seen_stands_for_itself():
    assert substitutes(floor(), near(WIDTH**2), gathered_by(*ramp())) is None


@pytest.mark.parametrize("how", ["sees backs", "is in contact"])
def test_the_closest_neighbour_below_their_mean_stands_in(how):
    """A square of hidden patches: those in its middle are seen by nobody and stay as they are."""
    light, front = ramp()
    square = np.zeros((WIDTH, WIDTH), bool)
    square[3:8, 2:7] = True
    faces = near(WIDTH**2)
    if how == "sees backs":
        front[square] = 0.03
    else:
        faces.covered[square.ravel()] = True
    light[square] = 0.0 if how == "sees backs" else 90.0
    found = substitutes(floor(), faces, gathered_by(light, front)).reshape(WIDTH, WIDTH)
    row, column = np.divmod(found, WIDTH)
    inner = np.zeros_like(square)
    inner[4:7, 3:6] = True
    own = np.arange(WIDTH**2).reshape(WIDTH, WIDTH)
    assert np.array_equal(found[~square | inner], own[~square | inner])
    rim = square & ~inner
    assert not square.ravel()[found[rim]].any()
    assert np.abs(row - own // WIDTH)[rim].max() == 1 and np.abs(column - own % WIDTH)[rim].max() == 1
    assert (column[4:7, 2] == 1).all() and (column[4:7, 6] == 7).all()
    assert (column[3, 3:6] == [4, 5, 6]).all()


def test_a_chart_that_nobody_sees_stands_for_itself():
    """A gutter of one texel is between the charts, so that no visible patch is beside a hidden one."""
    grid = np.arange(1, WIDTH**2 + 1).reshape(WIDTH, WIDTH)
    grid[:, 5] = 0
    grid[grid > 0] = np.arange(1, np.count_nonzero(grid) + 1)
    front = np.ones(grid.max())
    front[grid[:, 6:].ravel() - 1] = 0
    found = substitutes(floor(grid), near(len(front)), gathered_by(np.ones_like(front), front))
    assert np.array_equal(found, np.arange(len(front)))


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 7, 7), (3, 13, 13)])
def test_texels_beside_others_do_not_reach_over_the_ends_of_a_lightmap(shape):
    random = np.random.default_rng(shape[1])
    for part in (0.0, 0.03, 0.3):
        flags = random.random(shape) < part
        around = cells_around(flags, np.arange(flags.size))
        assert np.array_equal(beside_any(flags).ravel(), around.any(axis=1))


def test_under_a_thin_wall_the_dark_side_stands_in():
    light, front = ramp()
    light[:, 6:], front[:, 5] = 1e-3, 0
    found = substitutes(floor(), near(WIDTH**2), gathered_by(light, front)).reshape(WIDTH, WIDTH)
    assert (found[:, 5] % WIDTH == 6).all()


def test_what_lies_on_another_plane_does_not():
    light, front = ramp()
    height = np.zeros((WIDTH, WIDTH))
    height[:, 6:], front[:, 5] = 0.6, 0
    found = substitutes(floor(height=height), near(WIDTH**2), gathered_by(light, front)).reshape(WIDTH, WIDTH)
    assert (found[:, 5] % WIDTH == 4).all()


def test_groups_stand_in_for_groups():
    """Squares of 2 x 2 patches, the hidden ones of which are groups of their own."""
    row, column = np.divmod(np.arange(WIDTH**2), WIDTH)
    hidden = column >= 5
    group = (row // 2 * 6 + column // 2) * 2 + hidden
    number = np.unique(group, return_inverse=True)[1]
    light, front = np.zeros(number.max() + 1), np.zeros(number.max() + 1)
    front[number[~hidden]], light[number[~hidden]] = 1, 1 + number[~hidden]
    patch_scene = floor((number + 1).reshape(WIDTH, WIDTH))
    found = substitutes(patch_scene, near(len(light)), gathered_by(light, front))
    beside = np.unique(number[hidden & (column == 5)])
    assert (front[found[beside]] == 1).all()
    far = np.setdiff1d(number[hidden], beside)
    assert np.array_equal(found[far], far)


def test_final_gathers_replace_groups_whose_representative_is_invalid():
    """Squares of 2 x 2 patches: probe rays find one inside, iterations another, and hit one other member."""
    row, column = np.divmod(np.arange(WIDTH**2), WIDTH)
    group = np.unique(row // 2 * 6 + column // 2, return_inverse=True)[1]
    representative = np.unique(group, return_index=True)[1]
    job = SimpleNamespace(patch_scene=floor())
    groups = floor((group + 1).reshape(WIDTH, WIDTH))
    nothing = np.zeros(len(representative))
    groups.patches = PatchList(
        WIDTH, nothing.astype(np.int64), representative, nothing, np.zeros((len(nothing), 2))
    )
    texel_job = SimpleNamespace(
        job=job, solved=SimpleNamespace(patch_scene=groups, kept=SessionCache(), compute=None)
    )
    light = np.tile(np.linspace(1, 2, len(nothing), dtype=np.float32)[:, None], (1, 3))

    inside, found_before, valid = group[2 * WIDTH + 2], group[6 * WIDTH + 6], group[4 * WIDTH + 8]
    hidden = np.zeros(WIDTH**2, bool)
    hidden[representative[inside]] = True
    hidden[np.flatnonzero(group == valid)[1:]] = True
    assert substitutes_of(texel_job, np.zeros_like(hidden), light, None) is None
    of_iterations = np.arange(len(nothing))
    of_iterations[found_before] = found_before + 1
    found = substitutes_of(texel_job, hidden, light, of_iterations)
    replaced = np.flatnonzero(found != np.arange(len(nothing)))
    assert np.array_equal(replaced, [inside, found_before])
    beside = np.abs(np.stack(np.divmod(found[replaced], 6)) - np.stack(np.divmod(replaced, 6)))
    assert (beside.max(axis=0) == 1).all()


def test_pairs_of_groups_are_found_again_when_members_change():
    """A column next to an invalid group changes to another group; all representatives stay."""
    column = np.arange(WIDTH * WIDTH).reshape(WIDTH, WIDTH) % WIDTH
    before = np.where(column < 5, 1, np.where(column == 5, 2, 3))
    after = before.copy()
    after[1:, 6] = 1
    kept, invalid, found = SessionCache(), np.array([False, True, False]), []
    for entries in (before, after):
        groups, none = floor(entries), np.zeros(3)
        groups.patches = PatchList(WIDTH, none, np.array([0, 5, 6]), none, np.zeros((3, 3)))
        found.append(kept.find_substitutes(groups, invalid))
        np.testing.assert_array_equal(found[-1], find_substitutes(groups, invalid))
    assert (found[0][1] == 2).sum() > (found[1][1] == 2).sum() > 0


def test_means_need_no_memory_for_patches_without_candidates(monkeypatch):
    """Only the last of many patches is invalid."""
    largest, bincount = [], np.bincount
    monkeypatch.setattr(np, "bincount", lambda *a: largest.append(len(bincount(*a))) or bincount(*a))
    light, front = ramp()
    front[-1, -1] = 0
    found = substitutes(floor(), near(WIDTH**2), gathered_by(light, front))
    assert found[-1] != WIDTH**2 - 1 and max(largest) == 1


@pytest.mark.parametrize("light", [np.nan, np.inf])
def test_light_beyond_float32_is_not_the_substitute_of_other_light(light):
    invalid, pairs = np.array([True, False, False]), (np.array([0, 0]), np.array([1, 2]))
    for other in (2, light):
        colors = np.float32([[0] * 3, [light] * 3, [other] * 3])
        found = substitute_patches(None, invalid, colors.__getitem__, lambda *_: pairs)
        assert found.tolist() == [2 if other == 2 else 1, 1, 2]
