"""Markdown tables of figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any


def table(titles: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table with columns of even width; None is a dash."""
    cells = [[cell(value) for value in row] for row in (titles, *rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [
        f"| {' | '.join(text.ljust(width) for text, width in zip(row, widths, strict=True))} |"
        for row in cells
    ]
    rule = f"|{'|'.join('-' * (width + 2) for width in widths)}|"
    return "\n".join([lines[0], rule, *lines[1:]])


def cell(value: Any) -> str:
    """Return a value as a cell: three digits of a number."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def percent(fraction: float | None) -> str | None:
    """Return a fraction as per cent."""
    return None if fraction is None else f"{fraction:.2%}"


def mebibytes(size: int | None) -> str | None:
    """Return bytes as MiB."""
    return None if size is None else f"{size / 2**20:,.0f} MiB"
