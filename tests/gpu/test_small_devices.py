"""Devices that run few work items in a group bake the same light."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def bakes(limit: int, *arguments: str) -> dict[str, float]:
    """Return what tests/gpu/small_device_bakes.py reports on a device of PoCL whose groups are this small."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.gpu.small_device_bakes", *arguments],
        cwd=ROOT,
        env={**os.environ, "POCL_MAX_WORK_GROUP_SIZE": str(limit)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 0, result.stderr
    facts: dict[str, float] = json.loads(result.stdout)
    if facts.pop("limit") > limit:
        pytest.skip("only PoCL can play a small device")
    return facts


@pytest.fixture(scope="module")
def large():
    return bakes(4096)


@pytest.mark.long
@pytest.mark.parametrize(("limit", "arguments"), [(256, ()), (256, ("card",)), (32, ("card",)), (1, ())])
def test_small_work_groups_bake_the_same(large, limit, arguments):
    assert bakes(limit, *arguments) == pytest.approx(large, rel=1e-5)
