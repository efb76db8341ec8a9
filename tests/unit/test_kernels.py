"""What every kernel keeps to, seen in its text."""

import re
from pathlib import Path

import pytest

KERNELS = sorted((Path(__file__).resolve().parents[2] / "kernels").glob("*.cl"))

#: An array in the memory of all, and an assignment to a part of one of its vectors, with the vector's index.
ARRAY = re.compile(r"__global [^*(),;]*\*\s*(\w+)")
PART = re.compile(r"(\w+)\[([^;=]*)\]\.[xyzws][xyzw0-9a-f]*\s*[-+*/|&]?=[^=]")


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.stem)
def test_parts_of_vectors_are_written_by_one_work_item(path: Path) -> None:
    """Compilers write the whole vector, with what was read of its other parts: two items lose each other's.

    Whoever numbers vectors otherwise than work items are has to write them as numbers.
    """
    text = path.read_text(encoding="utf-8")
    shared = set(ARRAY.findall(text))
    written = [match.groups() for match in PART.finditer(text)]
    assert all(index.isidentifier() for array, index in written if array in shared)
