"""Scene sent to Dask workers."""

from __future__ import annotations

from dataclasses import dataclass

from distributed import Future

from .prepared_scene import prepare
from .scene_payload import ScenePayload
from .tasks import Tasks


@dataclass(frozen=True)
class DistributedScene:
    """Scene in the memory of Dask workers.

    shipment:  task whose result is the scene; workers fetch it from each other
    ready:     one task per worker that builds the BVH
    """

    shipment: Future
    ready: list[Future]

    @classmethod
    def to_workers(cls, tasks: Tasks, shipment: ScenePayload) -> DistributedScene:
        """Send a scene to all present workers, which build their BVH."""
        sent = tasks.sent(shipment, "scene")
        ready = [tasks.begin(prepare, [(sent,)], worker=address) for address in tasks.workers()]
        return cls(sent, [task for (task,) in ready])
