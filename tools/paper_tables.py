"""Writes tables V.C (work sizes) and VI.C (frameworks) of docs/design/paper.md from stored results.

python -m tools.paper_tables

Each device has files benchmarks/results/work_sizes-DEVICE.json and frameworks-DEVICE.json: what
benchmarks/work_sizes.py and benchmarks/frameworks/comparison.py store with --out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tools.page_table import table_row

ROOT = Path(__file__).resolve().parents[1]

_PAGE, _RESULTS = ROOT / "docs" / "design" / "paper.md", ROOT / "benchmarks" / "results"


def main() -> None:
    """Replace the text between the marks of each table."""
    text = _PAGE.read_text(encoding="utf-8")
    text = between(text, "work sizes", work_sizes_table(stored("work_sizes")))
    text = between(text, "frameworks", frameworks_table(stored("frameworks")))
    _PAGE.write_text(text, encoding="utf-8")


def stored(name: str) -> list[dict[str, Any]]:
    """Return the stored results of a kind, a device each."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(_RESULTS.glob(f"{name}-*.json"))]


def between(text: str, mark: str, table: str) -> str:
    """Return a page with a table in place of the text between its two marks."""
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


def frameworks_table(results: list[dict[str, Any]]) -> str:
    """Return a table with a row for each device and framework, those that are missing too."""
    rows = []
    for result in results:
        for name, found in result["frameworks"].items():
            if "missing" in found:
                device = result["machine"]["opencl"]["device"]
                rows.append(table_row(device, f"{name}: {found['missing']}", *["–"] * 7))
                continue
            starts = [_digits(1e6 * found[what]) for what in ("start", "start_and_wait", "wait")]
            integrate, gather = found["integrate"], found["gather"]
            sums = (integrate["copy_in"], integrate["kernel"], gather["kernel"])
            out = _digits(1e6 * gather["copy_out"])
            rows.append(table_row(found["device"], name, *starts, *(_digits(1e3 * s) for s in sums), out))
    titles = (
        "device", "framework", "start, µs", "start and wait, µs", "wait for nothing, µs",
        "copy hemicubes in, ms", "integrate, ms", "gather, ms", "copy result out, µs",
    )  # fmt: skip
    return "\n".join([table_row(*titles), "|---" * len(titles) + "|", *rows])


def _digits(value: float) -> str:
    return f"{value:.3g}"


if __name__ == "__main__":
    main()
