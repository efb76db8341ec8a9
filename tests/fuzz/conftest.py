"""Number of cases: few and fixed in a test run, many and new ones in `make fuzz`."""

import faulthandler
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from tests.fuzz.apart import Apart

_COMMON = {
    "deadline": None,  # `apart` has one that also ends what hangs
    "suppress_health_check": list(HealthCheck),
    "print_blob": False,
    "report_multiple_bugs": True,
}
settings.register_profile("short", max_examples=300, derandomize=True, database=None, **_COMMON)
settings.register_profile(
    "long", max_examples=3000, database=DirectoryBasedExampleDatabase("out/fuzz/examples"), **_COMMON
)
settings.load_profile("short")


@pytest.fixture(autouse=True)
def no_limit() -> None:
    """Let a test take its time: its cases have limits of their own."""
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture(scope="module")
def apart(request: pytest.FixtureRequest) -> Iterator[Apart]:
    """A process that runs the cases of a module: with its function CHECK, for at most LIMIT s each."""
    process = Apart(request.module.CHECK, request.module.LIMIT)
    yield process
    process.stop()
