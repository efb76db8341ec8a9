"""Write the tables of docs/paper.md that come from stored results: work sizes (V.C).

python -m tools.paper_tables

Each device has a file benchmarks/results/work_sizes-DEVICE.json, made by benchmarks/work_sizes.py --out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tools.page_table import table_row

ROOT = Path(__file__).resolve().parents[1]

_PAGE, _RESULTS = ROOT / "docs" / "paper.md", ROOT / "benchmarks" / "results"


def main() -> None:
    """Replace what is between the marks of each table."""
    text = _PAGE.read_text(encoding="utf-8")
    text = between(text, "work sizes", work_sizes_table(stored("work_sizes")))
    _PAGE.write_text(text, encoding="utf-8")


def stored(name: str) -> list[dict[str, Any]]:
    """Return the stored results of a kind, a device each."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(_RESULTS.glob(f"{name}-*.json"))]


def between(text: str, mark: str, table: str) -> str:
    """Return a page with a table in place of what is between its two marks."""
    begin, end = f"<!-- {mark} -->", f"<!-- end of {mark} -->"
    before, rest = text.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{table}\n{end}{after}"


def work_sizes_table(results: list[dict[str, Any]]) -> str:
    """Return a table with a row for each device and kernel: ms by shape, the usual shape's first."""
    rows = []
    for result in results:
        device = result["machine"]["opencl"]["device"]
        for kernel, times in result["ms"].items():
            (usual, at_first), *others = times.items()
            told = "; ".join(f"{shape}: {ms:.3g}" for shape, ms in others)
            rows.append(table_row(device, f"`{kernel}`", f"**{usual}: {at_first:.3g}**", told))
    titles = ("device", "kernel", "usual shape: ms", "other shapes: ms")
    return "\n".join([table_row(*titles), "|---" * len(titles) + "|", *rows])


if __name__ == "__main__":
    main()
