import dataclasses
import gc

import numpy as np
import pytest

from engine import Settings, SettingsError, bake, finished
from engine.device.gl_context import GraphicsContext
from engine.plan.solve_job import SolveJob
from engine.session import Session
from tests.analytic.scenes import furnace, sphere
from tests.rows import long

QUICK = Settings(resolution=37, hemicube=8, max_bounces=3, tolerance=0)


@pytest.mark.parametrize("visibility", ["rays", long("raster")])
def test_later_bakes_on_the_same_devices_give_the_same_bits(visibility):
    settings = dataclasses.replace(QUICK, visibility=visibility)
    expected = [finished(bake(scene, settings)).image for scene in (furnace(0.5, 1.0), sphere())]
    session = Session()
    for _ in range(2):
        for scene, image in zip((furnace(0.5, 1.0), sphere()), expected, strict=True):
            assert np.array_equal(finished(session.bake(scene, settings)).image, image)
    session.close()


def test_methods_may_follow_each_other():
    session = Session()
    settings = [
        dataclasses.replace(QUICK, method=method, visibility="raster") for method in ("paper", "cached")
    ]
    first, second, third = (
        finished(session.bake(sphere(), dataclasses.replace(each, accelerate=False)))
        for each in (*settings, settings[0])
    )
    session.close()
    assert np.array_equal(first.image, third.image)
    assert second.image == pytest.approx(first.image, rel=2e-5)


def test_nothing_of_a_bake_outlives_it_but_what_is_kept():
    """Its radiosity equation has arrays of all patches, on the device, too."""
    session, before = Session(), {id(job) for job in _solve_jobs()}
    finished(session.bake(furnace(0.5, 1.0), QUICK))
    left = [job for job in _solve_jobs() if id(job) not in before]
    session.close()
    assert left == []


def _solve_jobs():
    gc.collect()
    return [one for one in gc.get_objects() if isinstance(one, SolveJob)]


def test_after_an_error_and_after_a_cancel_the_next_bake_works():
    session = Session()
    work = session.bake(furnace(0.5, 1.0), QUICK)
    for _ in range(4):
        next(work)
    work.close()
    with pytest.raises(SettingsError):
        finished(session.bake(furnace(0.5, 1.0), dataclasses.replace(QUICK, hemicube=3)))
    assert finished(session.bake(furnace(0.5, 1.0), QUICK)).report.iterations == 3
    session.close()


@pytest.mark.parametrize("method", ["cached", long("paper")])
def test_other_contexts_of_the_process_do_no_harm(method):
    """Between bakes and between slices someone else draws in a context of theirs."""
    settings = dataclasses.replace(QUICK, method=method, visibility="raster")
    session = Session()
    expected = finished(session.bake(sphere(), settings)).image
    other = GraphicsContext()
    work = session.bake(sphere(), settings)
    for _ in range(5):
        next(work)
        other.use()
        other.program("overlap", ("vert", "frag"))
    assert np.array_equal(finished(work).image, expected)
    other.release()
    assert np.array_equal(finished(session.bake(sphere(), settings)).image, expected)
    session.close()
