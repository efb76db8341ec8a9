"""Bakes with a scheduler that requires certificates, and messages without them."""

import shutil
import subprocess
from dataclasses import replace

import dask
import numpy as np
import pytest

from engine import Settings
from engine.cluster.connection import is_private
from engine.errors import DeviceError
from engine.progress import finished
from engine.session import Session
from tests.analytic.scenes import nine_quad_room
from tests.gpu.schedulers import running_scheduler

SETTINGS = Settings(resolution=19, samples=16, visibility="rays", texel_samples=1, intermediates=False)

needs_openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    """Return the folder of an authority's certificate, ca.pem, and of one that it has signed, own.pem."""
    folder = tmp_path_factory.mktemp("certificates")

    def openssl(*words):
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    new = ("-newkey", "rsa:2048", "-nodes")
    openssl("req", "-x509", *new, "-keyout", "ca.key", "-out", "ca.pem", "-days", "1", "-subj", "/CN=ca")
    openssl("req", *new, "-keyout", "own.key", "-out", "own.csr", "-subj", "/CN=localhost")
    signed = ("-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-out", "own.pem", "-days", "1")
    openssl("x509", "-req", "-in", "own.csr", *signed)
    return folder


@pytest.fixture
def encrypted(certificates, tmp_path):
    """Return the address of a scheduler that talks TLS alone, with a worker."""
    files = [str(certificates / name) for name in ("ca.pem", "own.pem", "own.key")]
    pairs = zip(("--tls-ca-file", "--tls-cert", "--tls-key"), files, strict=True)
    options = [word for pair in pairs for word in pair]
    with running_scheduler(tmp_path, *options, scheme="tls") as (address, _):
        yield address


@needs_openssl
def test_scene_and_light_travel_encrypted(certificates, encrypted):
    tls = "distributed.comm.tls."
    named = {
        f"{tls}ca-file": str(certificates / "ca.pem"),
        f"{tls}client.cert": str(certificates / "own.pem"),
        f"{tls}client.key": str(certificates / "own.key"),
    }
    assert encrypted.startswith("tls://")
    settings = replace(SETTINGS, scheduler=encrypted)
    with dask.config.set(named):
        lightmap = finished(Session().bake(nine_quad_room(), settings))
    assert np.isfinite(lightmap.image).all() and lightmap.image.any()
    assert not any("unencrypted" in warning for warning in lightmap.report.warnings)

    # Without certificates, and without TLS, the error names the remedy.
    with pytest.raises(DeviceError, match="needs certificates.*ca-file"):
        finished(Session().bake(nine_quad_room(), settings))
    in_the_clear = replace(settings, scheduler=encrypted.replace("tls://", "tcp://"))
    with pytest.raises(DeviceError, match="No Dask scheduler answers.*tls://"):
        finished(Session().bake(nine_quad_room(), in_the_clear))


@pytest.mark.parametrize(
    ("address", "private"),
    [
        ("tls://render.example:8786", True),
        ("inproc://10.0.0.7/12/1", True),
        ("tcp://127.0.0.1:8786", True),
        ("tcp://[::1]:8786", True),
        ("tcp://10.0.0.7:8786", False),
        ("tcp://render.example:8786", False),
        ("ws://render.example:8786", False),
    ],
)
def test_what_others_can_listen_to_is_told(address, private):
    assert is_private(address) == private
