"""Workers of a bake: of a running scheduler, or of a local cluster."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from functools import partial

from distributed import Client

from ..direct.emitters import SampledTriangles
from ..errors import DeviceError
from ..patches.patch_scene import PatchScene
from ..scene.model import Scene
from ..settings import ALL_DEVICES, Settings
from ..visibility.rays.ray_scene import RayScene
from .admission import REFUSED, Admission, refusal
from .cluster_devices import ClusterDevices
from .connection import connected, is_of_this_machine, is_private
from .distributed_scene import DistributedScene
from .event_loop import event_loop
from .local_workers import RESULTS, LocalWorkers, local_environments
from .memory_folder import is_at_hand, memory_folder
from .scene_payload import ScenePayload
from .tasks import Tasks

#: Seconds in which the first worker must join.
_JOIN = 30

#: Seconds for refused workers to report and leave, and for others to join after that.
_REFUSAL, _OTHERS = 0.25, 2

#: Warning about an unencrypted connection.
_UNSAFE = (
    "Scheduler {}: the connection is not encrypted. Use tls:// and certificates "
    "(docs/user/several_devices.md), or a private network."
)


class Workers:
    """Workers that may take part in a bake.

    client:    client of their scheduler
    address:   address of the scheduler
    warnings:  sentences for the user: refused workers, and an unencrypted connection

    folder: in the shared memory of this machine; empty if there is none
    """

    def __init__(self, client: Client, folder: str) -> None:
        self.client, self._folder, self.warnings = client, folder, list[str]()
        client.rpc.timeout = RESULTS
        self.address: str = client.scheduler_info()["address"]
        client.subscribe_topic(REFUSED, lambda event: self.warnings.append(event[1]))
        self._admission = Admission()
        client.register_plugin(self._admission)
        if not is_private(self.address):
            self.warnings.append(_UNSAFE.format(self.address))

    def wait(self) -> None:
        """Wait for the first worker; raises DeviceError if none joins, with the reasons of refused ones."""
        asked = len(self.client.scheduler_info(n_workers=-1)["workers"])
        answers = self.client.run(refusal, self._admission.digest, on_error="ignore")
        if len(answers) < asked or any(answers.values()):
            time.sleep(_REFUSAL)
        try:
            self.client.wait_for_workers(1, timeout=_OTHERS if self.warnings else _JOIN)
        except TimeoutError as error:
            raise DeviceError(
                f"The scheduler at {self.address} has no workers. Start some with tools/worker.py. "
                f"{' '.join(self.warnings)}".rstrip()
            ) from error

    def ship(
        self, settings: Settings, scene: Scene
    ) -> Callable[[PatchScene, RayScene, SampledTriangles], ClusterDevices]:
        """Send a scene, including objects without lightmap, to the workers, which build the BVH.

        Returns a function that sends the patches and creates the remote devices.
        """
        local = is_of_this_machine(self.address)
        tasks = Tasks(self.client)
        folder = self._folder if local and self._share_folder() else ""
        shipped = DistributedScene.to_workers(tasks, ScenePayload.of(scene, settings, local, folder))
        return partial(ClusterDevices, tasks, shipped, settings, folder)

    def _share_folder(self) -> bool:
        """Return True if all workers have access to the folder; a container may have memory of its own."""
        return all(self.client.run(is_at_hand, self._folder, on_error="ignore").values())


@contextmanager
def workers(scheduler: str) -> Iterator[Workers]:
    """Use the workers of a scheduler, by address, or one worker per device of this machine.

    Raises DeviceError if there is no scheduler at the address, or it has no workers.
    """
    with memory_folder() as folder:
        if scheduler == ALL_DEVICES:
            with closing(LocalWorkers(local_environments())) as local:
                yield Workers(local.client, folder)
            return
        with event_loop() as loop, connected(scheduler, loop) as client:
            found = Workers(client, folder)
            found.wait()
            yield found
