"""A table in Markdown, and its place on a page between two marks."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path


def table_row(*cells: str) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(cells)} |"


def replace_table(page: Path, marks: tuple[str, str], titles: Sequence[str], rows: Sequence[str]) -> None:
    """Replace what is between the two marks of a page by a table, and say when it was measured."""
    begin, end = marks
    text = page.read_text(encoding="utf-8")
    before, rest = text.split(begin)
    _, after = rest.split(end)
    table = "\n".join([table_row(*titles), "|---" * len(titles) + "|", *rows])
    date = time.strftime("%Y-%m-%d")
    page.write_text(f"{before}{begin}\n{table}\n\nMeasured on {date}.\n{end}{after}", encoding="utf-8")
