"""Progress of building kernels before the first bake, as the panel shows it."""

from types import SimpleNamespace

import pytest

from tests.blender.test_modal import shown_by
from tests.blender.things import part


@pytest.fixture
def owner(monkeypatch):
    """Return a manager whose worker builds kernels."""
    manager = part("operators.worker_manager").WorkerManager()
    stage = "Preparing for this device (once): 3 of 9"
    manager._worker = SimpleNamespace(preparation=lambda: (stage, 2.5))
    monkeypatch.setattr(part("panels.bake"), "owner", manager)
    return manager


def test_the_panel_shows_stage_count_and_time(owner):
    assert not shown_by("draw_preparation")
    assert owner.poll_preparation()
    assert shown_by("draw_preparation") == ["Preparing for this device (once)", "3 of 9, 3 s left"]


def test_a_bake_ends_the_preparation(owner):
    owner.poll_preparation()
    owner.running = SimpleNamespace(progress=owner.preparation)
    assert shown_by("draw_stage") == ["Preparing for this device (once)", "3 of 9"]
    assert not owner.poll_preparation()
    owner.running = None
    assert not shown_by("draw_preparation")


def test_a_bake_shows_the_preparation_until_the_worker_is_free(owner, monkeypatch):
    """A worker that builds a shader answers nothing, not even that it has begun."""

    def bake(worker, scene, settings, paces):
        assert worker is owner._worker
        yield None
        return "lightmap"

    monkeypatch.setattr(part("engine.worker.worker"), "bake_without_crashing_device", bake)
    owner.poll_preparation()
    started = owner.bake_in_worker()
    owner.running = SimpleNamespace(progress=owner.preparation)
    owner.poll_preparation()
    assert [step and step.stage for step in started(None, None)] == [
        "Preparing for this device (once): 3 of 9",
        None,
    ]
    owner.running = None
    assert list(owner.bake_in_worker()(None, None)) == [None]
