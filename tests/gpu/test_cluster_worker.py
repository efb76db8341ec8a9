"""The command that lends a device to the bakes of a scheduler."""

import signal
import subprocess
import sys
import time

import pytest
from distributed import Client

from tests.gpu.schedulers import running_scheduler
from tools.headless import ROOT, load

worker = load("operators.command_line.worker")

COMMAND = [sys.executable, str(ROOT / "tools" / "worker.py")]


def names(client):
    """Return the names of the workers that are there."""
    return {told["name"] for told in client.scheduler_info(n_workers=-1)["workers"].values()}


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_worker_with_its_command(tmp_path, number):
    """A farm asks the command to end; a worker that stayed would get blocks of the next bake."""
    with running_scheduler(tmp_path) as (address, _), Client(address) as client:
        process = subprocess.Popen([*COMMAND, address, "--name", "third machine"])
        client.wait_for_workers(2, timeout=60)
        assert "third machine" in names(client)
        process.send_signal(number)
        assert process.wait(60) == 128 + number
        deadline = time.monotonic() + 30
        while "third machine" in names(client):
            assert time.monotonic() < deadline


def test_without_dask_the_remedy_is_told(monkeypatch, capsys):
    monkeypatch.setattr(worker, "find_spec", lambda _: None)
    assert worker.work(["tcp://127.0.0.1:9"], "worker.py") == 1
    assert "Install Hemibake's package with Dask" in capsys.readouterr().err
