"""The workers of a bake: those of a scheduler that runs already, or of one for this machine alone."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

from distributed import Client

from ..errors import DeviceError
from ..scene.model import Scene
from ..settings import Settings
from .admission import REFUSED, Admission
from .cluster_gather import ClusterGather
from .local_workers import LocalWorkers, local_environments
from .shipment import Shipment

#: What stands for a worker on each device of this machine, instead of an address.
LOCAL = "all"

#: Seconds in which a scheduler has to answer, and a first worker to be there.
_ANSWER, _JOIN = 10, 30

#: Seconds after which refused workers have told why, and left; and those to wait for others then.
_REFUSAL, _OTHERS = 0.5, 2

_UNSAFE = (
    "The scene travels unencrypted to the scheduler at {}: use tls:// and certificates (docs/scale.md), or a "
    "network that nobody else is on."
)


class Workers:
    """Workers that may take part in a bake.

    client    of their scheduler
    address   of the scheduler
    warnings  sentences for the user: refused workers, and a connection that others can listen to
    """

    def __init__(self, client: Client) -> None:
        self.client, self.warnings = client, list[str]()
        self.address: str = client.scheduler_info()["address"]
        client.subscribe_topic(REFUSED, lambda event: self.warnings.append(event[1]))
        client.register_plugin(Admission())
        if not _is_private(self.address):
            self.warnings.append(_UNSAFE.format(self.address))

    def wait(self) -> None:
        """Wait for a first worker; raises DeviceError if none comes, and tells which were refused."""
        time.sleep(_REFUSAL)
        try:
            self.client.wait_for_workers(1, timeout=_OTHERS if self.warnings else _JOIN)
        except TimeoutError as error:
            raise DeviceError(
                f"The scheduler at {self.address} has no workers. Start some with tools/worker.py. "
                f"{' '.join(self.warnings)}".rstrip()
            ) from error

    def gather(self, settings: Settings, scene: Scene) -> ClusterGather:
        """Return what gathers for all patches of a scene that occluders have their places in."""
        return ClusterGather(self.client, Shipment.of(scene, settings))


@contextmanager
def workers(scheduler: str) -> Iterator[Workers]:
    """Use the workers of a scheduler, by its address, or one for each device of this machine.

    Raises DeviceError if there is no scheduler at the address, or it has no workers.
    """
    if scheduler == LOCAL:
        local = LocalWorkers(local_environments())
        try:
            yield Workers(local.client)
        finally:
            local.close()
        return
    try:
        client = Client(scheduler, timeout=_ANSWER)
    except (OSError, ValueError) as error:
        raise DeviceError(
            f"No Dask scheduler answers at '{scheduler}' ({error}). Start one with `dask scheduler`, "
            "and give its address as tcp://host:8786."
        ) from error
    with client:
        found = Workers(client)
        found.wait()
        yield found


def _is_private(address: str) -> bool:
    """True if nobody else can listen: TLS, the memory of this process, or this machine alone."""
    parts = urlsplit(address)
    return parts.scheme in ("tls", "wss", "inproc") or parts.hostname in ("127.0.0.1", "::1", "localhost")
