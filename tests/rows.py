"""Rows of parametrised tests."""

from typing import Any

import pytest


def long(*values: Any) -> Any:
    """Return a row that only `make test-long` runs: a variant of others, and dear."""
    return pytest.param(*values, marks=pytest.mark.long)
