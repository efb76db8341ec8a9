"""How messages reach a person: short in the status bar, complete in the report and the Info editor."""

import pytest

from tests.blender.things import mesh_object, part, report, square


class Told:
    """Keeps what an operator reports."""

    def __init__(self):
        self.reports = []

    def report(self, kind, text):
        self.reports.append((*kind, text))


def test_all_names_of_a_long_list_are_in_the_report():
    import bpy

    square()
    names = {mesh_object(f"Wire {number}", [(0, 0, 0), (1, 0, 0)], []).name for number in range(63)}
    bpy.ops.hemibake.bake()
    (warning,) = (text for text in report()["warnings"] if "no faces" in text)
    short, everything = warning.split("\n")
    assert "and 58 more" in short and len(short) < 200
    assert all(f"'{name}'" in everything for name in names)


@pytest.mark.parametrize("background", [False, True])
def test_a_window_gets_the_first_line_and_the_info_editor_all(monkeypatch, background):
    telling = part("operators.telling")
    monkeypatch.setattr(telling, "_without_window", lambda: background)
    told = Told()
    telling.tell(told, "WARNING", "Many are dark.\nAll 9: 'A', 'B'.\n")
    whole = [("WARNING", "Many are dark.\nAll 9: 'A', 'B'.")]
    parts = [("INFO", "All 9: 'A', 'B'."), ("WARNING", "Many are dark.")]
    assert told.reports == (whole if background else parts)
