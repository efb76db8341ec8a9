"""Rows of tables on pages."""

from tools.page_table import replace_rows, replace_table, table_row

_MARKS = ("<!-- begin -->", "<!-- end -->")
_TITLES = ("scene", "error")


def page_with(folder, content=""):
    page = folder / "page.md"
    page.write_text(
        f"before\n{_MARKS[0]}\n{content}{_MARKS[1]}\nafter | not of the table |\n", encoding="utf-8"
    )
    return page


def test_rows_replace_those_of_the_same_scene_and_leave_the_others(tmp_path):
    page = page_with(tmp_path)
    for rows in ([("box", "4 %"), ("house", "5 %")], [("house", "2 %")], [("ball, 2", "1 %")]):
        replace_rows(page, _MARKS, _TITLES, [table_row(*row) for row in rows])
    table = "| scene | error |\n|---|---|\n| box | 4 % |\n| house | 2 % |\n| ball, 2 | 1 % |\n"
    text = f"before\n{_MARKS[0]}\n{table}{_MARKS[1]}\nafter | not of the table |\n"
    assert page.read_text(encoding="utf-8") == text


def test_rows_under_other_titles_are_left_out(tmp_path):
    page = page_with(tmp_path, "| scene | seconds |\n|---|---|\n| box | 4 |\n")
    replace_rows(page, _MARKS, _TITLES, [table_row("house", "5 %")])
    assert "box" not in page.read_text(encoding="utf-8")


def test_a_whole_table_is_replaced_and_dated(tmp_path):
    page = page_with(tmp_path, "old\n")
    replace_table(page, _MARKS, _TITLES, [table_row("box", "4 %")])
    text = page.read_text(encoding="utf-8")
    assert "old" not in text and "| box | 4 % |\n\nMeasured on 20" in text and text.endswith("table |\n")
