"""Paces of stages are stored across sessions, so that the first percentage is smooth."""

import contextlib
import json
import math
from dataclasses import dataclass

import numpy as np
import pytest

from tests.blender.things import furnace, part
from tests.clock import Clock

pytestmark = pytest.mark.one_version


def paces_file():
    return part("operators.user_files")._paces_file()


def test_paces_of_a_bake_are_there_on_another_day():
    import bpy

    furnace()
    bpy.ops.hemibake.bake()
    known = json.loads(paces_file().read_text())
    assert known["Saving"] > 0 and known == part("operators.worker_manager").owner.paces
    assert part("operators.user_files").read_paces() == known
    assert part("operators.worker_manager").WorkerManager().paces == known


def test_file_of_paces_that_is_broken_is_as_none():
    files = part("operators.user_files")
    for text in ("", "{", "[]", '{"Direct light": "fast"}', "\x00"):
        paces_file().write_text(text)
        assert files.read_paces() == {}
    paces_file().write_text('{"Direct light": 2e-7, "Bounces": -1, "Visibility": NaN}')
    assert files.read_paces() == {"Direct light": 2e-7}
    paces_file().unlink()
    assert files.read_paces() == {}


def test_session_takes_the_paces_of_another_one_where_it_has_none():
    session = part("engine.session").Session()
    session._paces = {"Visibility rays": 1.0}
    work = session._bake_checked(None, None, {"Visibility rays": 2.0, "Direct light": 3.0})
    with contextlib.suppress(AttributeError):
        next(work)
    assert session._paces == {"Visibility rays": 1.0, "Direct light": 3.0}


def test_guess_of_a_whole_bake_follows_its_size():
    stages, model = part("operators.run_stages"), part("engine.scene.model")
    engine = part("engine.settings")
    scene = model.Scene((), (), ("A",), None)
    seconds = []
    for resolution in (256, 1024):
        run = stages.RunStages({})
        run.expect(scene, engine.Settings(resolution=resolution), 1)
        seconds.append(run.baking.pace)
    assert all(map(math.isfinite, seconds)) and seconds[1] > 5 * seconds[0] > 0


def steps_until(run, stage):
    """Yield after each step of a run before a stage begins."""
    while (progress := run.step()) is None or progress.stage != stage:
        yield


def test_time_of_a_bake_is_foreseen_before_the_scene_is_read():
    """By its size, as when it is known exactly: the percentage is even from the first step on."""
    import bpy

    furnace()
    foreseen, known = [], []
    for resolution in (32, 256):
        bpy.context.scene.hemibake.resolution = resolution
        run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
        for _ in steps_until(run, "Reading objects"):
            pass
        foreseen.append(run._stages.baking.pace)
        for _ in steps_until(run, "Starting"):
            pass
        known.append(run._stages.baking.pace)
        run.cancel()
    assert foreseen[1] > 2 * foreseen[0] and foreseen == pytest.approx(known, rel=0.3)


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    for name in ("engine.progress", "engine.plan.stages", "operators.run_stages"):
        monkeypatch.setattr(part(name), "time", made)
    return made


@dataclass
class Measured:
    """Bake on two busy cores: size of its scene, settings that differ, measured seconds of each stage.

    groups:  groups of patches that are solved as one
    """

    triangles: int
    faces: int
    lamps: int
    patches: int
    groups: int
    settings: dict
    unwrapping: float
    reading: float
    starting: float
    patch_list: float
    direct: float
    choosing: float
    visibility: float
    bounces: float
    final: float
    texels: float
    denoising: float
    images: float
    saving: float


BAKES = {
    "level of 109,000 triangles": Measured(
        108_562, 79_281, 20, 906_431, 116_058, {"resolution": 1024},
        10.6, 0.9, 0.3, 16.6, 52.4, 7.8, 40.2, 0.3, 23.1, 24.1, 0.0, 2.3, 0.5,
    ),
    "level of 316,000 triangles": Measured(
        315_962, 228_793, 20, 880_062, 111_368, {"resolution": 1024},
        17.5, 2.0, 2.0, 29.5, 96.1, 19.1, 64.8, 0.3, 27.8, 21.0, 0.0, 0.8, 0.7,
    ),
    "level with Denoise": Measured(
        108_562, 79_281, 20, 906_431, 116_058, {"resolution": 1024, "texel_samples": 16, "denoise": True},
        10.5, 1.4, 2.1, 19.9, 51.0, 5.5, 28.6, 0.3, 15.6, 54.3, 60.0, 0.2, 0.5,
    ),
    "Cornell box": Measured(
        48, 24, 0, 834_774, 54_036, {"resolution": 1024},
        0.8, 0.1, 0.1, 1.4, 3.7, 2.7, 13.3, 0.3, 3.6, 0.4, 0.0, 0.3, 0.1,
    ),
    "living room": Measured(
        5021, 503, 0, 988_315, 151_042, {"resolution": 1024},
        2.7, 0.1, 1.3, 3.9, 0.1, 13.1, 70.3, 6.6, 35.8, 7.7, 0.0, 0.9, 0.1,
    ),
}  # fmt: skip

#: Pace of the trial of visibility, relative to the pace of the stage that follows: 0.85 in the Cornell box,
#: 0.71 in the living room.
TRIAL = 0.8


class Solution:
    """Solution whose iterations take times that a test sets; the last of them is the final gather."""

    energies = ()

    def __init__(self, clock, seconds):
        self._clock, self._seconds, self.iterations, self.residual = clock, list(seconds), 0, math.nan

    @property
    def gathers_finally(self):
        return self.iterations == len(self._seconds) - 1

    @property
    def is_done(self):
        return self.iterations == len(self._seconds)

    def iteration(self):
        yield from takes(self._clock, self._seconds[self.iterations])
        self.iterations += 1
        self.residual = 0.3**self.iterations


def takes(clock, seconds, slices=23):
    """Yield the fraction done of work that takes some seconds."""
    for index in range(slices):
        clock.now += seconds / slices
        yield (index + 1) / slices


def host_work(clock, name, seconds):
    """Yield the progress of unwrapping or reading, which tell no time left."""
    progress = part("engine.progress").Progress
    for fraction in takes(clock, seconds):
        yield progress(name, fraction, fraction)


def engine_work(clock, measured, slow, settings, extent, paces):
    """Yield the progress of the engine's bake in the order of its pipeline; learn the paces at its end."""
    stages = part("engine.plan.stages").BakeStages(extent, settings, paces)
    choice = part("engine.plan.solver_choice").SolverChoice
    clock.now += slow * measured.starting
    stages.opened(1.0)
    yield stages.begin(stages.patches)
    for _ in takes(clock, slow * measured.patch_list):
        yield stages.placed()
    yield stages.listed(measured.patches, 0.5)
    yield from stages.run(stages.direct, takes(clock, slow * measured.direct))
    yield stages.begin(stages.choosing)
    clock.now += slow * measured.choosing
    rays = part("engine.plan.memory").MORE_RAYS * settings.samples
    pace = TRIAL * slow * measured.visibility / (measured.groups * rays)
    gathering = part("engine.plan.choose_solver").gathering_fraction(measured.groups / measured.patches, 4)
    final = int(gathering * measured.patches * settings.samples)
    yield stages.chosen(choice(
        "cached", "rays", rays, (), patches=measured.groups, pace=pace, final_samples=final
    ))  # fmt: skip
    bounces = [slow * measured.bounces / 5] * 5
    solution = Solution(clock, (slow * measured.visibility, *bounces, slow * measured.final))
    while not solution.is_done:
        yield from stages.iterate(solution)
        yield stages.iterated(solution, None)
    yield from stages.run(stages.texels, takes(clock, slow * measured.texels))
    yield from stages.run(stages.denoising, takes(clock, slow * measured.denoising))
    yield from stages.run(stages.images, takes(clock, slow * measured.images))
    stages.update_paces()


def shares_of_run(clock, measured, slow, paces):
    """Return the true share of time and the shown percentage, both in [0, 1], of each step of a run."""
    engine = part("engine.settings")
    quality = part("engine.quality").QUALITIES["preview"].values
    settings = engine.Settings(**quality | measured.settings)
    extent = part("engine.plan.stages").Extent(1, measured.triangles, measured.lamps)
    run, begin, seen = part("operators.run_stages").RunStages(paces), clock.now, []

    def follow(stage, work):
        seen.extend((clock.now - begin, step.overall) for step in run.include(stage, work))

    run.foresee(extent, measured.faces, settings)
    follow(run.unwrapping, host_work(clock, "Unwrapping", slow * measured.unwrapping))
    follow(run.reading, host_work(clock, "Reading objects", slow * measured.reading))
    run.begin(run.baking)
    run.saving.amount = settings.resolution**2
    follow(run.baking, engine_work(clock, measured, slow, settings, extent, paces))
    run.begin(run.saving)
    clock.now += slow * measured.saving
    run.has_saved()
    return np.array(seen) / (clock.now - begin, 1)


@pytest.mark.parametrize("slow", [0.3, 1.0])
@pytest.mark.parametrize("name", BAKES)
def test_percentage_is_near_the_share_of_time(clock, name, slow):
    """With 0.3 of the measured times, an assumed idle machine, and with them; the second bake has paces."""
    paces = {}
    for _ in range(2):
        shares = shares_of_run(clock, BAKES[name], slow, paces)
        assert shares[-1, 1] > 0.95
        after = shares[shares[:, 0] > 0.05]
        assert np.abs(after[:, 1] - after[:, 0]).max() < 0.15


def test_kernels_that_are_being_built_count_until_they_are_built(clock):
    extent, settings = part("engine.plan.stages").Extent(1, 100, 1), part("engine.settings").Settings()
    run, seconds = part("operators.run_stages").RunStages({}, preparing=9.0), []
    for _ in range(3):
        run.foresee(extent, 0, settings)
        seconds.append(run.baking.pace)
        clock.now += 6
    assert seconds[0] - seconds[2] == pytest.approx(9) and seconds[0] - seconds[1] == pytest.approx(6)
