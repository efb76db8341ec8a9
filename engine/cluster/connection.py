"""Connection to a Dask scheduler: availability and encryption."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

from distributed import Client
from distributed.comm import connect
from distributed.comm.addressing import get_address_host_port
from distributed.security import Security
from distributed.utils import sync
from tornado.ioloop import IOLoop

from ..errors import DeviceError
from .local_workers import ANSWER

#: Timeout for a machine to accept a connection, seconds.
_LISTEN = 10

#: Instructions for TLS certificates.
_CERTIFICATES = (
    "Name their files in Dask's configuration, distributed.comm.tls: ca-file, client.cert and client.key, or "
    "in the environment, as DASK_DISTRIBUTED__COMM__TLS__CA_FILE (docs/user/several_devices.md)."
)


def connected(scheduler: str, loop: IOLoop) -> Client:
    """Return a client of a scheduler; raises DeviceError if none answers, or TLS lacks certificates."""
    if scheduler.startswith("tls://") and not Security().get_connection_args("client")["ssl_context"]:
        raise DeviceError(f"The scheduler at '{scheduler}' needs certificates. {_CERTIFICATES}")
    try:
        if not scheduler.startswith("inproc://"):
            socket.create_connection(get_address_host_port(scheduler), _LISTEN).close()
            sync(loop, _greet, scheduler, callback_timeout=ANSWER)
        return Client(scheduler, timeout=ANSWER, loop=loop)
    except (OSError, ValueError) as error:
        raise DeviceError(
            f"No Dask scheduler answers at '{scheduler}' ({error}). Start one with `dask scheduler`, "
            "and give its address as tcp://host:8786, or as tls://host:8786 if it uses certificates."
        ) from error


async def _greet(scheduler: str) -> None:
    """Exchange handshakes with a scheduler; a client would wait forever for another kind of server."""
    comm = await connect(scheduler, ANSWER, **Security().get_connection_args("client"))
    await comm.close()


def is_private(address: str) -> bool:
    """True if the connection is encrypted or local to this machine."""
    return urlsplit(address).scheme in ("tls", "wss") or is_of_this_machine(address)


def is_of_this_machine(address: str) -> bool:
    """True for the memory of this process, and for loopback addresses."""
    parts = urlsplit(address)
    return parts.scheme == "inproc" or parts.hostname in ("127.0.0.1", "::1", "localhost")
