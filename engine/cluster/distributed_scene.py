"""A scene on its way to workers."""

from __future__ import annotations

from dataclasses import dataclass

from distributed import Future

from .prepared_scene import prepare
from .scene_payload import ScenePayload
from .tasks import Tasks


@dataclass(frozen=True)
class DistributedScene:
    """A scene that workers have, or are given.

    shipment  a task whose result workers fetch from each other
    ready     of each worker a task that makes what casts rays through it
    """

    shipment: Future
    ready: list[Future]

    @classmethod
    def to_workers(cls, tasks: Tasks, shipment: ScenePayload) -> DistributedScene:
        """Send a scene to all workers that are there, which make what casts rays through it."""
        sent = tasks.sent(shipment, "scene")
        ready = [tasks.begin(prepare, [(sent,)], worker=address) for address in tasks.workers()]
        return cls(sent, [task for (task,) in ready])
