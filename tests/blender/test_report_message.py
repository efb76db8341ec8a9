"""Messages: short in the status bar, complete in the report and the Info editor."""

import math
import re

import pytest

from tests.blender.things import furnace, mesh_object, part, report, square


class Told:
    """Records the reports of an operator."""

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
    telling = part("operators.report_message")
    monkeypatch.setattr(telling, "_without_window", lambda: background)
    told = Told()
    telling.report_message(told, "WARNING", "Many are dark.\nAll 9: 'A', 'B'.\n")
    whole = [("WARNING", "Many are dark.\nAll 9: 'A', 'B'.")]
    parts = [("INFO", "All 9: 'A', 'B'."), ("WARNING", "Many are dark.")]
    assert told.reports == (whole if background else parts)


def test_an_error_is_wrapped_for_the_pop_up_of_a_window(monkeypatch):
    telling = part("operators.report_message")
    monkeypatch.setattr(telling, "_without_window", lambda: False)
    told = Told()
    sentence = " ".join(["A long sentence about much."] * 20)
    telling.report_message(told, "ERROR", sentence)
    telling.report_message(told, "WARNING", sentence)
    (_, error), (_, warning) = told.reports
    assert warning == sentence == error.replace("\n", "")
    assert max(map(len, error.splitlines())) < 100 and len(error.splitlines()) > 4


def test_a_terminal_is_told_the_percentage_once_in_a_while(monkeypatch, capfd):
    import bpy

    console = part("operators.bake")
    monkeypatch.setattr(console, "_PERIOD", 0.0)
    furnace()
    bpy.context.scene.hemibake.method = "paper"
    bpy.ops.hemibake.bake()
    lines = [line for line in capfd.readouterr().out.splitlines() if line.startswith("Hemibake: ")]
    shown = [int(re.match(r"Hemibake: (\d+)%, ", line)[1]) for line in lines]
    assert len(lines) > 5 and shown == sorted(shown) and shown[-1] <= 100
    assert any("Bounce 1" in line for line in lines) and "Saving" in lines[-1]
    monkeypatch.setattr(console, "_PERIOD", 1e9)
    bpy.ops.hemibake.bake()
    assert "Hemibake: " not in capfd.readouterr().out


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, "Hemibake: 41%, Bounce 3"),
        ({"seconds_left": 11.5}, "Hemibake: 41%, Bounce 3, 12 s left"),
        ({"residual": math.inf}, "Hemibake: 41%, Bounce 3"),
        (
            {"residual": 0.0123, "seconds_left": 61},
            "Hemibake: 41%, Bounce 3, convergence error 1.23%, 1 min 1 s left",
        ),
    ],
)
def test_a_line_of_progress_has_what_is_known(known, expected):
    progress = part("engine").Progress("Bounce 3", 0.5, 0.4199, **known)
    assert part("operators.report_message").progress_line(progress) == expected
