import numpy as np

from engine import Settings, bake, finished
from engine.worker.worker import Worker
from tests.analytic.scenes import furnace

QUICK = Settings(resolution=32, hemicube=8, max_bounces=3, tolerance=0, visibility="rays")


def test_worker_gives_the_same_bits_as_this_process_twice():
    worker = Worker()
    try:
        maps = [finished(worker.bake(furnace(0.5, 1.0), QUICK)) for _ in range(2)]
    finally:
        worker.stop()
    here = finished(bake(furnace(0.5, 1.0), QUICK))
    for there in maps:
        assert np.array_equal(there.image.view(np.uint32), here.image.view(np.uint32))
        assert np.array_equal(there.has_patch, here.has_patch)
        assert there.report.added_flux == here.report.added_flux
