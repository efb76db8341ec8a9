import math
from itertools import islice

import pytest

from engine import progress
from engine.plan.iterations_left import iterations_left
from engine.plan.solver_choice import SolverChoice
from engine.plan.stages import BakeStages, Extent
from engine.progress import Schedule, Stage, finished, format_seconds_left
from engine.settings import Settings
from tests.analytic.scenes import furnace
from tests.clock import Clock


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(progress, "time", made)
    return made


def work(clock, seconds, slices):
    """Yield the fraction done of work that takes some seconds."""
    for index in range(slices):
        clock.now += seconds / slices
        yield (index + 1) / slices


def test_one_fraction_is_even_where_the_paces_are_right(clock):
    stages = [Stage("A", 7, 0.5, True), Stage("B", 3, 2.0, True), Stage("C", 11, 0.05, True)]
    schedule, start = Schedule(stages), clock.now
    for stage in stages:
        for step in schedule.run(stage, work(clock, stage.amount * stage.pace, 13)):
            assert step.overall == pytest.approx((clock.now - start) / 10.05)
            assert step.seconds_left == pytest.approx(10.05 - (clock.now - start), abs=1e-9)
            assert step.stage == stage.name
    assert schedule.overall == 1 and schedule.seconds_left == 0


def test_slices_that_follow_each_other_fast_are_one_step(clock):
    schedule = Schedule([Stage("A")])
    steps = list(schedule.run(schedule.current, work(clock, 0.1, 10_007)))
    assert 20 < len(steps) <= 27
    assert [step.overall for step in steps] == sorted(step.overall for step in steps)


@pytest.mark.parametrize("wrong", [1e-3, 0.1, 1, 30, 1e4])
def test_it_never_falls_and_ends_at_one_however_wrong_the_paces(clock, wrong):
    """One stage is skipped, one gets ten times as much to do as it runs, one tells no fractions."""
    stages = [Stage(name, 10, 0.1 * wrong) for name in "ABCDE"]
    schedule, seen = Schedule(stages), []
    for stage in stages[:4:2]:
        for step in schedule.run(stage, work(clock, 1.3, 17)):
            seen.append(step.overall)
            stages[2].amount = 100
    seen.append(schedule.begin(stages[3]).overall)
    clock.now += 5
    seen.append(schedule.end().overall)
    assert seen == sorted(seen)
    stages[4].amount = 0
    clock.now += 1
    assert schedule.end().overall == 1


def test_seconds_left_are_unknown_until_something_was_measured(clock):
    stages = [Stage("A", 1, 0.1), Stage("B", 100, 1.0)]
    schedule = Schedule(stages)
    for step in schedule.run(stages[0], work(clock, 0.1, 3)):
        assert math.isnan(step.seconds_left)
    told = [step.seconds_left for step in schedule.run(stages[1], work(clock, 50, 100))]
    assert all(math.isnan(seconds) for seconds in told[:2])
    assert told[50] == pytest.approx(25, rel=0.2) and told[-1] == 0


def test_work_alike_is_foretold_from_what_was_measured(clock):
    """Both stages take 3 s for a unit, 30 times as long as guessed."""
    first, second = Stage("A", 5, 0.1), Stage("B", 7, 0.1)
    second.like = first
    schedule = Schedule([first, second])
    told = [(step.seconds_left, clock.now) for step in schedule.run(first, work(clock, 15, 5))]
    told += [(step.seconds_left, clock.now) for step in schedule.run(second, work(clock, 21, 7))]
    assert math.isnan(told[0][0])
    assert all(left == pytest.approx(clock.now - now, rel=0.1) for left, now in told[2:])


@pytest.mark.parametrize("slow", [1, 3, 20])
def test_it_is_even_where_all_takes_longer_than_guessed_by_the_same_factor(clock, slow):
    """As on a busy machine, or where drivers compile: the percentage does not run ahead."""
    stages = [Stage("A", 7, 1.0), Stage("B", 1, 5.0), Stage("C", 3, 4.0)]
    schedule, start = Schedule(stages), clock.now
    for stage in stages:
        schedule.begin(stage)
        clock.now += slow * stage.amount * stage.pace
        schedule.end()
        assert schedule.overall == pytest.approx((clock.now - start) / (24 * slow), abs=0.05)


@pytest.mark.parametrize("wrong", [0.01, 100])
def test_a_wrong_guess_is_forgotten_after_some_seconds(clock, wrong):
    """The stage takes an hour: a thousandth of it is enough to know."""
    stage = Stage("A", 3600, wrong)
    schedule = Schedule([stage])
    schedule.begin(stage)
    for done in (0.1, 0.2, 10):
        clock.now += 1 if done < 10 else 10
        schedule.advance(done)
    assert 3000 / 1.5 < schedule.seconds_left < 4000 * 1.5


def test_a_first_slice_that_compiles_does_not_count_as_pace(clock):
    stage = Stage("A", 1000, 0.01)
    schedule = Schedule([stage])
    schedule.begin(stage)
    for done, seconds in ((1, 5.0), (101, 1.0), (201, 1.0)):
        clock.now += seconds
        schedule.advance(done)
    assert schedule.seconds_left == pytest.approx(7.99)


def bake(clock, stages, lengths):
    """Yield the progress of work with a schedule of its own, and None now and then."""
    schedule = Schedule(stages)
    for stage, seconds in zip(stages, lengths, strict=True):
        yield None
        yield from schedule.run(stage, work(clock, seconds, 7))


@pytest.mark.parametrize("pace", [0.01, 1, 100])
def test_work_that_tells_its_own_time_is_believed(clock, pace):
    """The first bake is guessed wrong, the second is broken off, saving takes what it is expected to."""
    baking, saving = Stage("Baking", pace=pace), Stage("Saving", 10, 0.2, True)
    schedule = Schedule([baking, saving])
    seen = list(islice(schedule.include(baking, bake(clock, [Stage("A", pace=9)] * 3, [9] * 3)), 9))
    inside = [Stage("Preparing texels", 1, 1.0, True), Stage("Visibility", 100, 0.5, True)]
    start = clock.now
    for step in schedule.include(baking, bake(clock, inside, [1, 50])):
        seen.append(step)
        assert step is None or step.seconds_left == pytest.approx(53 - (clock.now - start))
    seen += schedule.run(saving, work(clock, 2, 3))
    overall = [step.overall for step in seen if step]
    assert overall == sorted(overall) and overall[-1] == 1
    assert {step.stage for step in seen if step} == {"A", "Preparing texels", "Visibility", "Saving"}


@pytest.mark.parametrize(
    ("residuals", "settings", "expected"),
    [
        ([], Settings(), 7),
        ([], Settings(accelerate=False), 28),
        ([], Settings(method="paper", max_bounces=5), 5),
        ([math.nan, 0.5], Settings(tolerance=0, max_bounces=31), 29),
        ([], Settings(outputs=("direct",)), 1),
        ([math.nan, 0.16, 0.04], Settings(tolerance=0.0025), 2),
        ([math.nan, math.inf, 0.5, 0.3], Settings(accelerate=False, tolerance=0.01), 7),
        ([math.nan, 0.1, 0.2], Settings(), 4),
        ([math.nan, 0.1, 0.001], Settings(tolerance=0.002), 0),
        ([math.nan, 0.99, 0.98], Settings(max_bounces=17), 14),
    ],
)
def test_sweeps_are_foretold_from_the_fall_of_the_residual(residuals, settings, expected):
    assert iterations_left(residuals, settings, 0.8) == expected


def test_last_stages_of_a_first_bake_are_expected_from_visibility(clock):
    """Seconds of nine squares in a room of 33 x 33 texels: most are spent on loading programs."""
    lengths = {"visibility": 0.48, "bounces": 0.09, "texels": 0.26, "images": 0.08}
    settings = Settings(resolution=33, samples=8192)
    stages = BakeStages(Extent(1, 18, 0), settings, {})
    stages.opened(1.0, first=True)
    for stage, seconds in ((stages.patches, 0.15), (stages.choosing, 0.26)):
        stages.begin(stage)
        clock.now += seconds
        stages.end()
    stages.chosen(SolverChoice("cached", "rays", 8192, (), patches=741))
    left = sum(lengths.values())
    for name, seconds in lengths.items():
        for step in stages.run(getattr(stages, name), work(clock, seconds, 5)):
            if name == "texels" and step.fraction == 0:
                stages.supersampling(1016, 2048)
            if step.fraction in (0.4, 0.8):
                assert step.seconds_left == pytest.approx(left - step.fraction * seconds, rel=0.4)
        left -= seconds


def test_overhead_of_a_first_bake_is_not_learned_as_pace(clock):
    paces = {}
    stages = BakeStages(Extent(1, 18, 0), Settings(resolution=33), paces)
    stages.opened(1.0, first=True)
    stages.begin(stages.patches)
    clock.now += 0.14 + 0.05
    stages.listed(601, 0.5)
    stages.update_paces()
    assert 0 < paces["Preparing texels"] * stages.patches.amount < 0.05


def test_paces_of_a_bake_serve_the_next_one(clock):
    paces, known = {}, []
    for measured in (False, True, True, True):
        stages = BakeStages(Extent.of(furnace(0.5, 1.0)), Settings(resolution=48), paces)
        assert stages.patches.measured == measured
        stages.begin(stages.patches)
        clock.now += 3
        stages.listed(601, 0.5)
        assert finished(stages.run(stages.images, work(clock, 0.001, 3))) is None
        stages.update_paces()
        known.append(paces["Preparing texels"] * stages.patches.amount)
    assert (
        known == sorted(known)
        and known[-1] == pytest.approx(3, rel=0.05)
        and "Finishing lightmaps" not in paces
    )


def test_short_first_bake_does_not_foretell_minutes_for_a_long_one(clock):
    """Half a second for hardly any work says little about the time of 2,000 times the work."""
    paces = {}
    stages = BakeStages(Extent.of(furnace(0.5, 1.0)), Settings(resolution=48), paces)
    stages.texels.amount = 1e4
    assert finished(stages.run(stages.texels, work(clock, 0.5, 3))) is None
    stages.update_paces()
    later = BakeStages(Extent.of(furnace(0.5, 1.0)), Settings(resolution=48), paces)
    assert later.texels.measured and 2e7 * later.texels.pace < 60


def test_work_that_ends_before_its_last_step_is_told_is_whole(clock):
    def work_in_two():
        yield 0.1
        clock.now += 1
        yield 0.2
        clock.now += 0.01

    stage = Stage("A", 1000, 0.01)
    assert finished(Schedule([stage]).run(stage, work_in_two())) is None
    assert stage.done == stage.amount == 1000


def test_short_bake_hardly_changes_the_pace_of_a_long_one(clock):
    """What begins and ends a stage took thirty times as long as its work."""
    paces, known = {}, []
    for seconds, amount in ((40.0, 1.0), (0.06, 5e-5), (0.06, 5e-5)):
        stages = BakeStages(Extent.of(furnace(0.5, 1.0)), Settings(resolution=48), paces)
        stages.images.amount *= amount
        assert finished(stages.run(stages.images, work(clock, seconds, 3))) is None
        stages.update_paces()
        known.append(paces["Finishing lightmaps"])
    assert known[0] < known[1] < known[2] < 1.6 * known[0]


def test_seconds_are_told_as_a_user_reads_them():
    assert [format_seconds_left(seconds) for seconds in (0, 11.2, 60, 3599.5)] == [
        "0 s left", "12 s left", "1 min 0 s left", "60 min 0 s left",
    ]  # fmt: skip
    assert format_seconds_left(math.nan) == ""
