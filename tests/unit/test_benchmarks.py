import os
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.curves import Point, envelope, reach, reach_by_sampling
from benchmarks.driver_caches import driver_caches
from benchmarks.glim import fastest, plain_scene
from benchmarks.halls import hall
from benchmarks.process_memory import used_memory
from benchmarks.rooms import cornell_box, dark_box, hilly_room
from benchmarks.suites import fig5, levels
from engine.scene.checks import check_scene
from engine.settings import check_settings


def _sampled(samples: list[int]) -> list[Point]:
    """A path tracer: 1 s to start, 0.01 s a sample, error 1 / sqrt(samples)."""
    return [Point(str(count), 1 + 0.01 * count, count**-0.5) for count in samples]


def test_an_error_between_two_bakes_is_interpolated_on_logarithms():
    points = [Point("coarse", 1.0, 0.08), Point("fine", 4.0, 0.02)]
    found = reach(points, 0.04)
    assert found.how == "interpolated" and found.seconds == pytest.approx(2.0)


def test_bakes_that_others_beat_do_not_count():
    points = [Point("a", 1.0, 0.08), Point("slow", 3.0, 0.1), Point("b", 4.0, 0.02)]
    assert [point.label for point in envelope(points)] == ["a", "b"]


def test_what_is_not_measured_is_not_claimed():
    points = [Point("coarse", 1.0, 0.08), Point("fine", 4.0, 0.03)]
    assert reach(points, 0.02) == reach([], 0.02) and reach(points, 0.02).seconds is None
    assert reach(points, 0.1).how == "at most" and reach(points, 0.1).seconds == 1.0


def test_more_samples_follow_the_square_root_law():
    samples = [16, 64, 256]
    found = reach_by_sampling(samples, _sampled(samples), 0.02)
    assert found.how == "extrapolated" and found.seconds == pytest.approx(1 + 0.01 * 2500)


@pytest.mark.parametrize("resolution", [64, 120, 1024])
def test_the_box_fills_its_lightmap_with_charts_that_do_not_touch(resolution):
    (mesh,) = cornell_box(resolution).meshes
    check_scene(cornell_box(resolution))
    owners = np.zeros((resolution, resolution), np.int32)
    for quad in range(len(mesh.uvs) // 2):
        corners = np.round(mesh.uvs[2 * quad : 2 * quad + 2].reshape(-1, 2) * resolution).astype(int)
        (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
        assert right > left and top > bottom
        around = owners[max(bottom - 1, 0) : top + 1, max(left - 1, 0) : right + 1]
        assert not around.any()
        owners[bottom:top, left:right] = quad + 1
    assert (owners > 0).mean() > 0.6


def test_rooms_have_the_triangles_and_lamps_asked_for():
    scene = hilly_room(96, 1000)
    check_scene(scene)
    assert sum(len(mesh.positions) for mesh in scene.meshes) == pytest.approx(1000, rel=0.1)
    floor = scene.meshes[1]
    assert (floor.normals[..., 2] > 0).all() and floor.uvs.min() >= 0 and floor.uvs.max() <= 1
    assert len(dark_box(64, 10).lights) == 10


def test_the_hall_has_windows_smooth_columns_and_a_chart_for_each_surface():
    scene = hall(256, 4000)
    check_scene(scene)
    (mesh,) = scene.meshes
    assert len(mesh.positions) == pytest.approx(4000, rel=0.1)
    assert [light.kind for light in scene.lights] == ["sun", *["point"] * 4] and scene.world.min() > 0
    facing = np.cross(
        mesh.positions[:, 1] - mesh.positions[:, 0], mesh.positions[:, 2] - mesh.positions[:, 0]
    )
    assert (np.einsum("td,tkd->tk", facing, mesh.normals) > 0).all()
    (u1, v1), (u2, v2) = ((mesh.uvs[:, corner] - mesh.uvs[:, 0]).T for corner in (1, 2))
    area = (u1 * v2 - u2 * v1) / 2
    assert (area > 0).all() and 0.5 < area.sum() < 1


def test_drivers_have_caches_of_their_own_only_meanwhile(tmp_path, monkeypatch):
    monkeypatch.setenv("POCL_CACHE_DIR", "/kept")
    monkeypatch.delenv("CUDA_CACHE_PATH", raising=False)
    with driver_caches(str(tmp_path)):
        assert os.environ["POCL_CACHE_DIR"] == str(tmp_path / "POCL_CACHE_DIR")
        assert os.path.isdir(os.environ["CUDA_CACHE_PATH"])
    assert os.environ["POCL_CACHE_DIR"] == "/kept" and "CUDA_CACHE_PATH" not in os.environ


def test_each_block_of_shared_memory_counts_once(tmp_path, monkeypatch):
    mib, own = 1 << 20, os.getpid()
    maps = {own: ((7, 0, 3), (8, 3, 8)), 41: ((7, 100, 103), (9, 200, 202)), 42: ((9, 0, 2),)}
    for pid, blocks in maps.items():
        folder = tmp_path / str(pid)
        folder.mkdir()
        (folder / "status").write_text("Name:\tpython\nRssAnon:\t    2048 kB\nRssShmem:\t    9000 kB\n")
        lines = [
            f"{first * mib:x}-{last * mib:x} rw-s 00000000 00:1a {inode}    /dev/shm/psm_{inode} (deleted)"
            for inode, first, last in blocks
        ]
        library = "7f0000000000-7f0000400000 r-xp 00000000 fe:01 7    /usr/lib/lib c.so"
        (folder / "maps").write_text("\n".join([library, *lines, "7f0000500000-7f0000600000 rw-p 0 00:00 0"]))
    task = tmp_path / "self" / "task" / str(own)
    task.mkdir(parents=True)
    (task / "children").write_text("41 42 43")
    monkeypatch.setattr("benchmarks.process_memory._PROC", tmp_path)
    assert used_memory() == (3 * 2 + 3 + 5 + 2) * mib


def test_growth_of_memory_is_relative_to_that_of_the_arrays():
    mib = 1 << 20

    def level(name, arrays, peak):
        stages = {"Unwrapping": {"cpu": 1.0, "peak": mib}, "Direct light": {"cpu": 2.0, "peak": peak * mib}}
        facts = {"triangles": 3, "counted": 3, "patches": 5, "scene_bytes": arrays * mib, "fixed": 400 * mib}
        return {"name": name, "stages": stages, **facts}

    read_only = {key: value for key, value in level("large", 900, 3).items() if key != "patches"}
    lines = levels.tables(
        [level("small", 100, 700), level("middle", 300, 1500), read_only], None
    ).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert ["small", "100 MiB", "400 MiB", "700 MiB", "7", "–"] in cells
    assert cells[-1] == ["middle", "300 MiB", "400 MiB", "1,500 MiB", "5", "4"]


class _CheckedError(Exception):
    """Ends a bake whose settings are valid."""


@pytest.mark.parametrize("layers", [1, None])
def test_fig5_has_valid_settings_with_an_array_and_in_batches(layers, monkeypatch):
    def solving(scene, settings):
        check_settings(settings)
        raise _CheckedError

    monkeypatch.setattr(fig5, "solving", solving)
    with pytest.raises(_CheckedError):
        fig5._drawn(64, layers, 1.0)


def test_the_fastest_samples_that_reach_a_goal_count():
    errors = [(0.06, 0.1, "coarse"), (0.05, 0.3, "slow"), (0.04, 0.2, "fine")]
    assert fastest(errors, 5) == "fine" and fastest(errors, 1) is None


def test_a_plain_scene_keeps_constants_only():
    scene = replace(cornell_box(64), world=np.full((2, 4, 3), 0.5, np.float32))
    plain = plain_scene(scene)
    assert plain.world.tolist() == [1, 1, 1] and not plain.lights
    assert max(made.reflectance.max() for made in plain.materials) <= np.float32(0.8)
    assert [made.emission.tolist() for made in plain.materials] == [
        made.emission.tolist() for made in scene.materials
    ]
