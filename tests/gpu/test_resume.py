"""A bake that was interrupted goes on from its checkpoint, and gives the bits of one that was not."""

import dataclasses
import os
import signal

import numpy as np
import pytest

from engine import BakeResult, Settings, bake, finished
from engine.errors import WorkerError
from engine.gather import visibility_cache
from engine.plan import solve_job
from engine.resume import checkpoint
from engine.worker.worker import Worker
from tests.analytic.rooms import Atlas, block, scene_of
from tests.analytic.rooms import lamp as lamp_at
from tests.analytic.rooms import room as hall
from tests.gpu.slice_sizes import fix_slice_size
from tests.gpu.test_session_cache import ROOM, assert_same, coloured, lamp
from tests.rows import long
from tests.transparency import transparent

#: These bake several times, with every slice of work written to disk; short ones are in tests/unit.
pytestmark = pytest.mark.long

#: Every slice of work is written.
SETTINGS = Settings(
    resolution=37, hemicube=8, samples=132, max_bounces=7, tolerance=0, visibility="rays", light_samples=3,
    texel_samples=1, intermediates=False, checkpoint_interval=0,
)  # fmt: skip

#: Settings of bakes that are interrupted.
KINDS = {
    "rays": {},
    "drawn": {"visibility": "raster", "batch_bytes": 1 << 20},
    "plain iterations": {"accelerate": False, "directions": "hemicube"},
    "directional maps": {"outputs": ("combined", "direct", "directional")},
    "groups": {"patch_groups": 2},
    "stream": {"method": "stream"},
    "paper": {"method": "paper", "max_bounces": 3},
}

#: Those of variants that share the code of others.
RARE = ("plain iterations", "stream", "paper")


def interrupted(settings: Settings, enough, scene=ROOM) -> bool:
    """Bake until `enough` of a progress is true; return whether that came before the end."""
    work = bake(scene, settings)
    for progress in work:
        if enough(progress):
            work.close()
            return True
    return False


def went_on(lightmap: BakeResult) -> list[str]:
    """Return the sentences of what a bake went on from."""
    return list(lightmap.report.resumed)


def files(folder) -> list:
    """Return the files of all checkpoints in a cache folder."""
    return [path for path in (folder / "resume").rglob("*") if path.is_file()]


@pytest.fixture
def pieces(monkeypatch):
    """Let caches have several pieces, of which no length divides the other.

    On any device they are found in several slices, and written however little time these take.
    """
    monkeypatch.setattr(visibility_cache, "_PIECE", 311 * 264)
    fix_slice_size(monkeypatch, 256)
    monkeypatch.setattr(checkpoint, "_PART", 1000)


@pytest.mark.parametrize("kind", [long(kind) if kind in RARE else kind for kind in KINDS])
def test_a_bake_cancelled_in_its_bounces_goes_on(tmp_path, kind, pieces):
    settings = dataclasses.replace(SETTINGS, **KINDS[kind])
    cached = dataclasses.replace(settings, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == settings.max_bounces - 1)
    resumed = finished(bake(ROOM, cached))
    assert any("Light was restored from bounce" in reason for reason in went_on(resumed))
    assert_same(resumed, finished(bake(ROOM, settings)))
    assert files(tmp_path) == []


@pytest.mark.parametrize("kind", ["rays", "drawn", "directional maps"])
def test_a_bake_cancelled_while_looking_goes_on(tmp_path, kind, pieces):
    settings = dataclasses.replace(SETTINGS, **KINDS[kind])
    cached = dataclasses.replace(settings, cache_dir=str(tmp_path))
    looking = lambda progress: bool(files(tmp_path)) and progress.stage.startswith("Visibility")  # noqa: E731
    assert interrupted(cached, looking)
    resumed = finished(bake(ROOM, cached))
    sentence, *_ = went_on(resumed)
    assert "was restored from an interrupted bake" in sentence
    assert_same(resumed, finished(bake(ROOM, settings)))


@pytest.mark.parametrize("width", [1, 4])
def test_patches_that_stand_in_for_hidden_ones_go_on(tmp_path, width, pieces):
    """A block stands on the floor; some texels are mostly under it."""
    atlas = Atlas(131)
    meshes = [hall(atlas, (0, 0, 0), (1.2, 0.8, 0.8), "Hall")]
    meshes += [block(atlas, (0.613, 0.217, 0), (0.87, 0.53, 0.3), "Block")]
    scene = scene_of(meshes, [lamp_at((0.3, 0.4, 0.6))])
    settings = dataclasses.replace(SETTINGS, resolution=131, samples=64, patch_groups=width)
    cached = dataclasses.replace(settings, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == 4, scene)
    resumed = finished(bake(scene, cached))
    assert any("Light was restored from bounce" in reason for reason in went_on(resumed))
    assert_same(resumed, finished(bake(scene, settings)))


def test_other_lamps_take_what_patches_see_but_not_the_light(tmp_path):
    cached = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == 3)
    relit = dataclasses.replace(ROOM, lights=(lamp(3, 1, 2), lamp(2, 2, 2)))
    resumed = finished(bake(relit, cached))
    (sentence,) = went_on(resumed)
    assert "Visibility of" in sentence
    assert_same(resumed, finished(bake(relit, SETTINGS)))


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        (coloured(ROOM, 3, transmission=transparent(0.4)), {}),
        (ROOM, {"seed": 3}),
        (ROOM, {"samples": 136}),
        (ROOM, {"resolution": 31}),
        (ROOM, {"visibility": "raster"}),
        (ROOM, {"checkpoint_space": 0}),
    ],
)
def test_what_decides_what_patches_see_starts_anew(tmp_path, scene, changes):
    cached = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == 3)
    fresh = finished(bake(scene, dataclasses.replace(cached, **changes)))
    assert went_on(fresh) == []


def test_another_version_starts_anew(tmp_path, monkeypatch):
    cached = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == 3)
    monkeypatch.setattr(solve_job, "source_digest", lambda: "of tomorrow")
    assert went_on(finished(bake(ROOM, cached))) == []


def test_more_iterations_go_on_and_fewer_start_anew(tmp_path, monkeypatch):
    """Written as in `pieces`: iterations of a card take less time than writing them."""
    monkeypatch.setattr(checkpoint, "_PART", 1000)
    cached = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    for iterations, sentences in ((11, 2), (2, 1)):
        settings = dataclasses.replace(cached, max_bounces=iterations)
        assert interrupted(cached, lambda progress: progress.iteration == 5)
        resumed = finished(bake(ROOM, settings))
        assert len(went_on(resumed)) == sentences
        assert resumed.report.iterations == iterations


def truncate(path):
    os.truncate(path, path.stat().st_size // 2)


def damage(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)


def empty(path):
    path.write_bytes(b"")


def replace_by_folder(path):
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize("harm", [damage, replace_by_folder, long(truncate), long(empty), long(os.remove)])
def test_harmed_files_are_as_good_as_none(tmp_path, harm, pieces):
    cached = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path))
    assert interrupted(cached, lambda progress: progress.iteration == 4)
    expected = finished(bake(ROOM, SETTINGS))
    for path in sorted(files(tmp_path))[::2]:
        harm(path)
    assert_same(finished(bake(ROOM, cached)), expected)
    assert files(tmp_path) == []


def test_space_that_is_too_small_keeps_some_rows(tmp_path, pieces):
    small = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path), checkpoint_space=200_000)
    assert interrupted(small, lambda progress: progress.iteration == 4)
    assert 0 < sum(path.stat().st_size for path in files(tmp_path)) <= 200_000
    resumed = finished(bake(ROOM, small))
    assert went_on(resumed)
    assert_same(resumed, finished(bake(ROOM, SETTINGS)))


def test_bakes_shorter_than_the_interval_write_nothing(tmp_path):
    settings = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path), checkpoint_interval=600)
    assert interrupted(settings, lambda progress: progress.iteration == 4)
    assert files(tmp_path) == []


def bake_until_killed(worker, settings, share, folder):
    """Bake, and kill the worker once a share of the work is done and something is written."""
    for progress in worker.bake(ROOM, settings):
        if progress is not None and progress.overall > share and files(folder):
            os.kill(worker.process.pid, signal.SIGKILL)


@pytest.mark.parametrize("share", [0.6, long(0.3), long(0.8)])
def test_a_killed_worker_leaves_what_it_has_found(tmp_path, share):
    settings = dataclasses.replace(SETTINGS, cache_dir=str(tmp_path), samples=516, texel_samples=4)
    worker = Worker()
    try:
        with pytest.raises(WorkerError):
            bake_until_killed(worker, settings, share, tmp_path)
        resumed = finished(worker.bake(ROOM, settings))
    finally:
        worker.stop()
    assert went_on(resumed)
    assert files(tmp_path) == []
    assert_same(resumed, finished(bake(ROOM, dataclasses.replace(settings, cache_dir=None))))
    assert np.isfinite(resumed.image).all()
