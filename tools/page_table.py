"""A Markdown table between two marks of a page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path


def table_row(*cells: str) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(cells)} |"


def replace_table(page: Path, marks: tuple[str, str], titles: Sequence[str], rows: Sequence[str]) -> None:
    """Replace the text between two marks of a page by a table, with the date of the measurement."""
    _replace(page, marks, f"{_table(titles, rows)}\n\nMeasured on {time.strftime('%Y-%m-%d')}.")


def replace_rows(page: Path, marks: tuple[str, str], titles: Sequence[str], rows: Sequence[str]) -> None:
    """Put rows into the table between the two marks of a page, in place of those with the same first cell.

    Rows of tables with other titles are left out: their cells mean something else.
    """
    begin, end = marks
    lines = page.read_text(encoding="utf-8").split(begin)[1].split(end)[0].split("\n")
    kept = lines[3:] if table_row(*titles) in lines[:2] else []
    named = {_first_cell(row): row for row in kept if row.startswith("|")}
    named |= {_first_cell(row): row for row in rows}
    _replace(page, marks, _table(titles, list(named.values())))


def _first_cell(row: str) -> str:
    return row.split("|")[1].strip()


def _table(titles: Sequence[str], rows: Sequence[str]) -> str:
    return "\n".join([table_row(*titles), "|---" * len(titles) + "|", *rows])


def _replace(page: Path, marks: tuple[str, str], content: str) -> None:
    """Replace the text between two marks of a page."""
    begin, end = marks
    before, rest = page.read_text(encoding="utf-8").split(begin)
    _, after = rest.split(end)
    page.write_text(f"{before}{begin}\n{content}\n{end}{after}", encoding="utf-8")
