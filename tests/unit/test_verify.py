"""Results of scenes that tools/verify.py runs in processes of their own."""

import pytest

from tools.verify import result_line

GOOD, BAD = "| Room | 1 % | yes | 12 s", "| Room | 9 % | **no** | 12 s"


@pytest.mark.parametrize(
    ("printed", "status", "line"),
    [
        (f"{GOOD}\n", 0, GOOD),
        (f"A library warns.\n{GOOD}\n\nAnother one.\n", 0, GOOD),
        (f"{BAD}\n", 1, BAD),
        ("Room: Blender has working spaces since 5.0.\n", 0, "Room: Blender has working spaces since 5.0."),
    ],
)
def test_the_line_of_a_scene_is_found(printed, status, line):
    assert result_line("Room", printed, status) == line


@pytest.mark.parametrize(
    ("printed", "status"), [("", 0), ("A library warns.\n", 1), (GOOD, -11), (GOOD, 1), (BAD, -9)]
)
def test_a_scene_without_a_result_fails(printed, status):
    line = result_line("Room", printed, status)
    assert line.startswith(f"| Room | not baked: the process ended with status {status} |")
    assert line.endswith("| |")
